"""`uavseg download`: the mission of a vehicle."""

from typing import Any

import click

from uavseg.cli._write import write_mission_output
from uavseg.cli.options.link import link_options, reporter_of, vehicle_report


@click.command("download", short_help="Read the mission of a vehicle.")
@link_options
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE",
    help="The mission: .plan or another file as of uavseg plan.",
)
@click.option("--overwrite", is_flag=True, help="Replace a mission that is there.")
def command(**options: Any) -> None:
    """Read the mission that a vehicle holds, with its fence and rally points, to a file.

    The file is for QGroundControl (.plan) or for Mission Planner (.waypoints, which holds no fence).
    """
    from uavseg.flight.formats.files import check_mission_format
    from uavseg.jobs.flights.link import LinkRequest, download
    from uavseg.output.atomic import check_target

    output, reporter = options["output"], reporter_of(options)
    check_mission_format(output)
    check_target(output, options["overwrite"])
    found = download(LinkRequest(options["connect"], options["timeout"]), reporter.progress)
    unwritten = write_mission_output(found.mission, output, options["overwrite"])
    reporter.finish((*found.warnings, *unwritten))
    reporter.say(f"{output}: {vehicle_report(found.mission, found.vehicle)}")
