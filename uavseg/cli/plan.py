"""`uavseg plan`: a file of regions becomes a mission file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli._write import keep_inputs, write_plan_output
from uavseg.cli.options.access import access_options
from uavseg.cli.options.classes import class_choice_options
from uavseg.cli.options.files import parse_file_options
from uavseg.cli.options.home_words import HomeCommand
from uavseg.cli.options.limits import zone_files, zones_of
from uavseg.cli.options.mission import mission_options, plan_request, report
from uavseg.cli.options.vehicle import missions_json
from uavseg.cli.options.verbosity import heed_verbose, showing_phases, verbosity_options
from uavseg.cli.terminal.say import show

if TYPE_CHECKING:
    from uavseg.jobs.source.source import Source


@click.command("plan", cls=HomeCommand)
@click.argument("regions", metavar="REGIONS")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="PATH",
    help="The mission: .plan, .waypoints, .kmz, .csv, .kml or .geojson.",
)
@mission_options
@click.option("--ids", metavar="N,N,...", help="Only the regions with these ids.")
@click.option("--largest", type=click.IntRange(min=1), metavar="N", help="Only the N largest.")
@click.option(
    "--where",
    metavar="CONDITION",
    help='Only regions that fulfil it, as in "mean > 0.7 and area_m2 > 500". A comparison with a missing '
    "number is neither true nor false, so != and not do not select it either.",
)
@class_choice_options("--class")
@click.option(
    "--raster",
    metavar="PATH",
    help="Where ranges of --avoid are looked for, and at whose edge no region may lie; see --allow-edge.",
)
@click.option("--layer", metavar="NAME", help="The layer of a file that has several.")
@click.option("--json", "as_json", is_flag=True, help="Write the estimates as JSON, for programs.")
@click.option(
    "--footprints",
    is_flag=True,
    help="With --json: also what ground each photograph shows, four corners (lon, lat) in degrees.",
)
@click.option("--overwrite", is_flag=True, help="Replace a mission that is there.")
@verbosity_options
@access_options
def command(**options: Any) -> None:
    """Plan a flight over REGIONS, a file of polygons (- is GeoJSON from standard input).

    Take off at home, fly to or over the chosen regions in a short order, return. The file is for
    QGroundControl (.plan), Mission Planner (.waypoints), DJI Pilot 2 (.kmz), Litchi (.csv), or to look at
    (.kml, .geojson). Length, time with turns, photographs and energy are estimates without wind.
    """
    from uavseg.flight.formats import files
    from uavseg.jobs.flights.plan import plan
    from uavseg.jobs.flights.plan_regions import open_regions
    from uavseg.output.atomic import check_target

    heed_verbose(options["quiet"], options["verbose"])
    output, regions = options["output"], options["regions"]
    if options["footprints"] and not options["as_json"]:
        raise click.UsageError("--footprints are a part of --json; give both")
    files.check_mission_format(output)
    check_target(output, options["overwrite"])
    raster = options["raster"]
    keep_inputs([output], regions, raster, zone_files(options), options["dem"])
    request, form = plan_request(options), parse_file_options(options)
    source = click.open_file("-", "rb").read() if regions == "-" else regions
    with showing_phases(options["quiet"]):
        found = open_regions(source, options["layer"])
        opened = None if raster is None else _opened(raster)
        planned = plan(found, request, zones_of(options, opened), opened)
    paths, unwritten = write_plan_output(planned, output, options["overwrite"], form)
    if options["as_json"]:
        notes = [*planned.warnings, *unwritten]
        written = missions_json(
            planned.missions, planned.regions, paths, notes, with_footprints=options["footprints"]
        )
        show(json.dumps(written, allow_nan=False))
    if not options["quiet"]:
        report(planned.missions, planned.regions, paths, [*planned.warnings, *unwritten])


def _opened(raster: str) -> Source:
    from uavseg.jobs.source.open_source import open_source

    return open_source(raster)
