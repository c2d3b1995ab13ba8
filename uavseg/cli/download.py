"""`uavseg download`: the mission of a vehicle."""

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.cli.upload import vehicle_report
from uavseg.cli.write import write_mission_output
from uavseg.options.missions import DownloadOptions


@job_command("download", DownloadOptions)
def command(options: DownloadOptions) -> None:
    """Read the mission that a vehicle holds, with its fence and rally points, to a file.

    The file is for QGroundControl (.plan) or for Mission Planner (.waypoints, which holds no fence).
    """
    from uavseg.flight.formats.files import check_mission_format
    from uavseg.jobs.flights.link import LinkRequest, download
    from uavseg.output.atomic import check_target

    reporter = Reporter(options.messages, options.progress)
    output, overwrite = options.output, options.files.overwrite
    check_mission_format(output)
    check_target(output, overwrite)
    found = download(LinkRequest(options.link.connect, options.link.timeout), reporter.progress)
    unwritten = write_mission_output(found.mission, output, overwrite)
    reporter.finish((*found.warnings, *unwritten))
    reporter.say(f"{output}: {vehicle_report(found.mission, found.vehicle)}")
