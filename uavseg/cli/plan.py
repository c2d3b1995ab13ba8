"""`uavseg plan` and `uavseg resume`: a mission over regions, and the rest of one that was cut."""

import json
from dataclasses import asdict

import click

from uavseg.cli.command import job_command
from uavseg.cli.mission_report import missions_json, report
from uavseg.cli.terminal.say import Reporter, show, showing_phases
from uavseg.cli.write import check_output, write_plan_output
from uavseg.options.flights import PlanOptions
from uavseg.options.missions import ResumeOptions


@job_command("plan", PlanOptions)
def command(options: PlanOptions, reporter: Reporter) -> None:
    """Plan a flight over REGIONS, a file of polygons (- is GeoJSON from standard input).

    Take off at home, fly to or over the chosen regions in a short order, return. The file is for
    QGroundControl (.plan), Mission Planner (.waypoints), DJI Pilot 2 (.kmz), Litchi (.csv), or to look at
    (.kml, .geojson). Length, time with turns, photographs and energy are estimates, without wind
    unless --wind gives one.
    """
    from uavseg.flight.formats import files
    from uavseg.jobs.flights.plan import plan
    from uavseg.jobs.flights.request import open_regions, plan_request, widths_of, zone_polygons

    output, overwrite, avoid = options.output, options.files.overwrite, options.mission.safety.avoid
    if options.footprints and not options.as_json:
        raise click.UsageError("--footprints are a part of --json; give both")
    files.file_options(output, **asdict(options.mission.files))
    names = [zone for zone in avoid if isinstance(zone, str)]
    check_output(output, overwrite, options.regions, options.raster, names, options.mission.terrain.dem)
    request = plan_request(options)
    regions = click.open_file("-", "rb").read() if options.regions == "-" else options.regions
    with showing_phases(reporter.quiet):
        found = open_regions(regions, options.layer, widths_of(request.flight))
        raster = None
        if options.raster is not None:
            from uavseg.jobs.source.open_source import open_source

            raster = open_source(options.raster)
        zones, notes = zone_polygons(options.mission.safety, raster)
        planned = plan(found, request, zones, raster, notes)
    paths, unwritten = write_plan_output(planned, output, overwrite, options.mission.files)
    notes = [*planned.warnings, *unwritten]
    if options.as_json:
        written = missions_json(
            planned.missions, planned.regions, paths, notes, with_footprints=options.footprints
        )
        show(json.dumps(written, allow_nan=False))
    if not reporter.quiet:
        report(planned.missions, planned.regions, paths, notes)


@job_command("resume", ResumeOptions)
def resume(options: ResumeOptions, reporter: Reporter) -> None:
    """Plan the rest of MISSION (any file that uavseg check reads), whose flight was cut.

    Take off as before, fly to the last photograph, take it again, and go on with what is left; camera,
    gimbal and speed are set as they were. Fence and rally points stay.
    """
    from uavseg.flight.formats import files
    from uavseg.jobs.flights.resume import resume

    quiet, output, overwrite = reporter.quiet, options.output, options.files.overwrite
    files.file_options(output, **asdict(options.mission_files))
    check_output(output, overwrite, options.file, options.start if isinstance(options.start, str) else None)
    with showing_phases(quiet):
        planned = resume(options.file, options.start)
    paths, unwritten = write_plan_output(planned, output, overwrite, options.mission_files)
    if not quiet:
        report(planned.missions, 0, paths, [*planned.warnings, *unwritten])
