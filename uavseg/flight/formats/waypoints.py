"""Mission Planner's .waypoints files (QGC WPL 110)."""

import re

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.formats.vehicle_state import HOME_UNKNOWN, VehicleState
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_RELATIVE,
    HEADING_COMMANDS,
    POSITION_COMMANDS,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import shown

HEADER = "QGC WPL 110"


def waypoints_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return what a .waypoints file cannot hold of a mission, one sentence each."""
    if mission.fence or mission.rally:
        return ["a .waypoints file cannot hold a fence or rally points: they were not written; use a .plan"]
    return []


def write_waypoints(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .waypoints file (QGC WPL 110), home in row 0."""
    home = mission.home
    # altitude 1: only the position is checked
    start = MissionItem(WAYPOINT, FRAME_RELATIVE, (0.0,) * 4, home.lat, home.lon, 1.0)
    rows = [_row(0, 1, FRAME_AMSL, start, home.altitude_m)]
    rows += [_row(n, 0, item.frame, item, item.altitude_m) for n, item in enumerate(mission.items, start=1)]
    return "".join(f"{row}\n" for row in [HEADER, *rows]).encode()


def _row(number: int, current: int, frame: int, item: MissionItem, altitude_m: float) -> str:
    floats = [*(value or 0.0 for value in item.params), item.lat, item.lon]
    fields = [number, current, frame, item.command, *(decimal(value, 8) for value in floats)]
    return "\t".join(map(str, [*fields, decimal(altitude_m, 6), int(item.autocontinue)]))


def decimal(value: float, min_decimals: int) -> str:
    """Format a number without exponent, with at least `min_decimals` decimals; it is read back equal."""
    return np.format_float_positional(value, unique=True, min_digits=min_decimals, trim="k")


def read_waypoints(content: bytes, name: str) -> Mission:
    """Read a .waypoints file as ArduPilot reads it; notes say what is odd.

    Fields are separated by white space or commas; blank lines and comments (#) are skipped. Row 0 is home,
    whatever its command; where it is missing, or at 0, 0, home is at the first position.
    """
    header, *lines = content.decode("utf-8-sig").splitlines()
    if header.split() != HEADER.split():
        raise MissionError(f"its first line is {header[:40]!r}; expected {HEADER!r}")
    rows = [
        (number, _SEPARATOR.split(line.strip()))
        for number, line in enumerate(lines, start=2)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    first = int(rows[0][1][0] == "1") if rows else 0
    for number, (line, fields) in enumerate(rows, start=first):
        if len(fields) != 12 or int(fields[0]) != number:
            raise MissionError(
                f"line {line} is not item {number} with 12 fields separated by TAB, spaces or commas"
            )
    items = [fields for _, fields in rows[1 - first :]]
    home, notes = _home(rows[0][1] if rows and not first else None, items)
    state = VehicleState(home)
    read = tuple(_item_of_row(fields, state) for fields in items)
    return Mission(home, read, name=name, notes=(*notes, *state.notes()))


_SEPARATOR = re.compile(r"\s*,\s*|\s+")


def _home(row: list[str] | None, items: list[list[str]]) -> tuple[HomePosition, list[str]]:
    """Return home, by its row where there is one, with notes."""
    notes = []
    if row is not None:
        if (int(row[3]), int(row[2])) != (WAYPOINT, FRAME_AMSL):
            notes.append(
                f"row 0 (command {row[3]} in frame {row[2]}) is home for ArduPilot, which does not fly it"
            )
        lat, lon, altitude_m = map(float, row[8:11])
        if lat != 0 or lon != 0:
            return HomePosition(lat, lon, altitude_m), notes
    positions = (
        (float(fields[8]), float(fields[9])) for fields in items if int(fields[3]) in POSITION_COMMANDS
    )
    first = next((position for position in positions if position != (0, 0)), None)
    if first is None:
        raise MissionError("it holds neither home nor a position to fly to")
    return HomePosition(*first), [*notes, HOME_UNKNOWN]


def _item_of_row(fields: list[str], state: VehicleState) -> MissionItem:
    """Read an item; errors name its number."""
    number, _, frame, command = map(int, fields[:4])
    first, second, third, fourth, lat, lon, altitude_m = map(float, fields[4:11])
    heading = None if command in HEADING_COMMANDS and fourth == 0 else fourth
    try:
        if fields[11] not in {"0", "1"}:
            raise MissionError(f"autocontinue is {shown(fields[11])}; expected 0 or 1")
        return state.item(
            number,
            command=command,
            frame=frame,
            params=(first, second, third, heading),
            lat=lat,
            lon=lon,
            altitude_m=altitude_m,
            autocontinue=fields[11] == "1",
        )
    except MissionError as error:
        raise MissionError(f"item {number}: {error}") from error
