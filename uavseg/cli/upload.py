"""`uavseg upload` and `uavseg download`: a mission to a vehicle, and the mission that it holds."""

from typing import TYPE_CHECKING

from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.cli.write import write_mission_output
from uavseg.options.missions import DownloadOptions, UploadOptions

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission


@job_command("upload", UploadOptions)
def command(options: UploadOptions) -> None:
    """Send the mission in FILE (.plan or .waypoints) to a vehicle with its fence and rally points, read them
    back and compare.

    Only heartbeats and the MAVLink mission protocol are sent: nothing arms or starts the vehicle. A fence and
    rally points that the file does not have are left as they are.

    Exit codes: 0, the vehicle holds the mission; 1, it is armed, it refused it, or something failed; 3, it
    accepted the mission, which could then not be read back.
    """
    from uavseg.jobs.flights.link import LinkRequest, upload
    from uavseg.output.disk import noted_stream

    reporter = Reporter(options.messages, options.progress)
    request = LinkRequest(options.link.connect, options.link.timeout)
    with noted_stream("the mission of the vehicle"):
        done = upload(options.file, request, reporter.progress, options.while_armed)
    reporter.finish(done.warnings)
    reporter.say(f"{options.file}: {vehicle_report(done.mission, done.vehicle)}, read back and equal")


def vehicle_report(mission: "Mission", vehicle: str) -> str:
    """Return what was transferred, and the vehicle."""
    parts = [f"{len(mission.items)} items"]
    if mission.fence:
        parts.append(f"a fence of {len(mission.fence)} shape{'s' * (len(mission.fence) > 1)}")
    if mission.rally:
        parts.append(f"{len(mission.rally)} rally point{'s' * (len(mission.rally) > 1)}")
    return f"{', '.join(parts)} ({vehicle})"


@job_command("download", DownloadOptions)
def download(options: DownloadOptions) -> None:
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
