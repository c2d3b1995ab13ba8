"""`uavseg resume`: the rest of a mission whose flight was cut."""

from dataclasses import asdict

from uavseg.cli.command import job_command
from uavseg.cli.mission_report import report
from uavseg.cli.terminal.say import Reporter, showing_phases
from uavseg.cli.write import keep_inputs, write_plan_output
from uavseg.options.missions import ResumeOptions


@job_command("resume", ResumeOptions)
def command(options: ResumeOptions) -> None:
    """Plan the rest of MISSION (any file that uavseg check reads), whose flight was cut.

    Take off as before, fly to the last photograph, take it again, and go on with what is left; camera,
    gimbal and speed are set as they were. Fence and rally points stay.
    """
    from uavseg.flight.formats import files
    from uavseg.jobs.flights.resume import resume
    from uavseg.output.atomic import check_target

    quiet, output, overwrite = Reporter(options.messages).quiet, options.output, options.files.overwrite
    files.file_options(output, **asdict(options.mission_files))
    check_target(output, overwrite)
    keep_inputs([output], options.file, options.start if isinstance(options.start, str) else None)
    with showing_phases(quiet):
        planned = resume(options.file, options.start)
    paths, unwritten = write_plan_output(planned, output, overwrite, options.mission_files)
    if not quiet:
        report(planned.missions, 0, paths, [*planned.warnings, *unwritten])
