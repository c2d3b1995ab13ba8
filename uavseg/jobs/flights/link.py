"""Upload of a mission to a vehicle, and download of the one that it holds.

An address is udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD]; `timeout_s` says how
many seconds to wait for an answer, and without progress. Another address, or a time not above 0 and at most
600 s, is refused with ParameterError.
"""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.execution.executors import Progress as Progress, decided, phase
from uavseg.flight.formats.files import check_mission_format, read_mission
from uavseg.flight.link.link import TIMEOUT_S, Link, connect
from uavseg.flight.link.missions import download_mission, upload_mission
from uavseg.flight.link.transport import parse_address
from uavseg.flight.mission.mission import Mission

MAX_TIMEOUT_S = 600.0
UPLOADABLE = (".plan", ".waypoints")


@dataclass(frozen=True)
class Transferred:
    """A mission that a vehicle holds, as reading it, or reading it back, has shown.

    `vehicle` names its autopilot and system id; the warnings are those of the mission, and what the upload
    found.
    """

    mission: Mission
    vehicle: str
    warnings: tuple[str, ...]


def upload(
    source: str | os.PathLike[str] | Mission,
    address: str,
    timeout_s: float = TIMEOUT_S,
    progress: Progress | None = None,
    while_armed: bool = False,
) -> Transferred:
    """Send a mission to a vehicle with its fence and rally points, read them back and compare.

    `progress` is called with the number of items that were sent or read back, and of all. With `while_armed`,
    the mission of a vehicle whose motors are armed may be replaced. A MissionError says that the file cannot
    be read, or that the mission is for another autopilot; an UnverifiedError that the vehicle accepted the
    mission, which could then not be read back; a LinkError that it is armed, cannot be reached, refuses,
    falls silent, or is not alone on the link.
    """
    _check(address, timeout_s)
    mission = source if isinstance(source, Mission) else _read_uploadable(source)
    with _connected(address, timeout_s) as link:
        with phase("upload and comparison"):
            found = upload_mission(link, mission, progress, while_armed)
        return Transferred(mission, str(link.vehicle), (*mission.warnings, *found))


def _check(address: str, timeout_s: float) -> None:
    parse_address(address)
    if not 0 < timeout_s <= MAX_TIMEOUT_S:
        raise ParameterError(f"the timeout is above 0 and at most {MAX_TIMEOUT_S:g} s, not {timeout_s:g}")


@contextmanager
def _connected(address: str, timeout_s: float) -> Iterator[Link]:
    with ExitStack() as closing:
        with phase("connection"):
            link = closing.enter_context(connect(address, timeout_s))
        decided("%s at %s", link.vehicle, address)
        yield link


def _read_uploadable(source: str | os.PathLike[str]) -> Mission:
    """Return a mission of a file for autopilots that MAVLink reaches."""
    if check_mission_format(source) not in UPLOADABLE:
        raise MissionError(
            f"{os.fspath(source)}: only {' and '.join(UPLOADABLE)} files are sent to vehicles; others do not "
            "hold all of a mission, or are there to look at"
        )
    return read_mission(source)


def download(address: str, timeout_s: float = TIMEOUT_S, progress: Progress | None = None) -> Transferred:
    """Read the mission of a vehicle, with its fence and rally points.

    A MissionError says that the vehicle holds no mission, or one that would not be safe, a LinkError that it
    cannot be reached, refuses, falls silent, or is not alone on the link.
    """
    _check(address, timeout_s)
    with _connected(address, timeout_s) as link:
        with phase("download"):
            found = download_mission(link, progress)
        return Transferred(found, str(link.vehicle), found.warnings)
