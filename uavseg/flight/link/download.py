"""Download: read the mission, the fence and the rally points of a vehicle."""

from collections.abc import Sequence
from dataclasses import replace

from uavseg.errors import MissionError
from uavseg.flight.link.link import AUTOPILOT_NAMES, POLL_S, Link, LinkedVehicle
from uavseg.flight.link.messages import (
    FENCE_RETURN,
    LinkItem,
    MissionType,
    RefusedError,
    TransferLostError,
    fence_of_items,
    home_of_row,
    mission_items,
    rally_of_items,
)
from uavseg.flight.link.transfer import Progress, receive_items
from uavseg.flight.mission.items import HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission

HOME_S = 2.5  # PX4 sends HOME_POSITION every 2 s


def download_mission(link: Link, progress: Progress | None = None) -> Mission:
    """Read the mission of a vehicle, with its fence and rally points.

    ArduPilot sends home as item 0, PX4 in a message; where neither is there, home is at the first item, at 0
    m above the sea, and a note says so. `progress` is called with the number of items of the mission that
    were received, and of all. A LinkError says that the vehicle falls silent or refuses, a MissionError that
    it holds no mission, or one that would not be safe.
    """
    report = progress or (lambda done, total: None)
    rows = receive_items(link, MissionType.MISSION, report)
    vehicle = link.vehicle
    if len(rows) <= int(vehicle.has_home_row):
        raise MissionError("the vehicle holds no mission")
    notes: list[str] = []
    fence_items = _optional(link, MissionType.FENCE, notes)
    rally_items = _optional(link, MissionType.RALLY, notes)
    if any(item.command == FENCE_RETURN for item in fence_items):
        notes.append("the return point of the fence was not read")
    try:
        items = mission_items(rows[1:] if vehicle.has_home_row else rows, vehicle.has_home_row)
        home = _home(link, rows, items, notes)
        fence, rally = fence_of_items(fence_items), rally_of_items(rally_items)
        mission = Mission(home, items, _autopilot(home, items, vehicle, notes), fence=fence, rally=rally)
    except MissionError as error:
        raise MissionError(f"what the vehicle holds cannot be used: {error}") from error
    return replace(mission, notes=tuple(notes))


def _optional(link: Link, list_type: MissionType, notes: list[str]) -> list[LinkItem]:
    """Receive a list that a vehicle need not support."""
    try:
        return receive_items(link, list_type, lambda done, total: None)
    except (TransferLostError, RefusedError) as error:
        notes.append(f"the {list_type} of the vehicle could not be read: {error}")
        return []


def _home(
    link: Link, rows: Sequence[LinkItem], items: Sequence[MissionItem], notes: list[str]
) -> HomePosition:
    home = home_of_row(rows[0]) if link.vehicle.has_home_row and rows else None
    if home is not None:
        return home
    if link.home is None and link.vehicle.autopilot == "px4":
        until = link.now() + HOME_S
        while link.home is None and link.now() < until:
            link.next_message(min(link.now() + POLL_S, until), none_expected=True)
    if link.home is not None:
        return HomePosition(*link.home)
    first = next((item for item in items if item.has_position and not item.is_at_vehicle), None)
    if first is None:
        raise MissionError("the mission of the vehicle flies to no position")
    notes.append("the vehicle does not tell its home: the position of the first item is taken, at 0 m")
    return HomePosition(first.lat, first.lon)


def _autopilot(
    home: HomePosition, items: tuple[MissionItem, ...], vehicle: LinkedVehicle, notes: list[str]
) -> str:
    """Return the autopilot that the mission is for; of a generic vehicle, the first whose rules it keeps."""
    if vehicle.autopilot != "generic":
        return vehicle.autopilot
    for autopilot in ("generic", *AUTOPILOT_NAMES):
        try:
            Mission(home, items, autopilot)
        except MissionError:
            continue
        if autopilot != "generic":
            name = AUTOPILOT_NAMES[autopilot]
            notes.append(f"the vehicle is a generic one: its mission is read as one for {name}")
        return autopilot
    return next(iter(AUTOPILOT_NAMES))  # whose rules the mission breaks, as its error then says
