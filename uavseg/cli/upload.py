"""`uavseg upload`: a mission to a vehicle."""

from typing import Any

import click

from uavseg.cli.options.link import link_options, reporter_of, vehicle_report


@click.command("upload", short_help="Send a mission to a vehicle, and verify it.")
@click.argument("file", metavar="FILE")
@click.option(
    "--while-armed",
    is_flag=True,
    help="Replace the mission of a vehicle whose motors are armed; it may be flying, and ArduPilot replaces "
    "the items one by one.",
)
@link_options
def command(**options: Any) -> None:
    """Send the mission in FILE (.plan or .waypoints) to a vehicle with its fence and rally points, read them
    back and compare.

    Only heartbeats and the MAVLink mission protocol are sent: nothing arms or starts the vehicle. A fence and
    rally points that the file does not have are left as they are.

    Exit codes: 0, the vehicle holds the mission; 1, it is armed, it refused it, or something failed; 3, it
    accepted the mission, which could then not be read back.
    """
    from uavseg.jobs.flights.link import LinkRequest, upload
    from uavseg.output.written import noted_stream

    request, reporter = LinkRequest(options["connect"], options["timeout"]), reporter_of(options)
    with noted_stream("the mission of the vehicle"):
        done = upload(options["file"], request, reporter.progress, options["while_armed"])
    reporter.finish(done.warnings)
    reporter.say(f"{options['file']}: {vehicle_report(done.mission, done.vehicle)}, read back and equal")
