"""Mission Planner's .waypoints files (QGC WPL 110)."""

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_RELATIVE,
    HEADING_COMMANDS,
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
    """Read a .waypoints file."""
    header, *rows = content.decode().splitlines()
    if header.split() != HEADER.split():
        raise MissionError(f"its first line is {header[:40]!r}; expected {HEADER!r}")
    home, *items = (_item_of_row(number, row) for number, row in enumerate(rows))
    assert isinstance(home, HomePosition)
    return Mission(home, tuple(item for item in items if isinstance(item, MissionItem)), name=name)


def _item_of_row(number: int, row: str) -> HomePosition | MissionItem:
    fields = row.split("\t")
    if len(fields) != 12 or int(fields[0]) != number:
        raise MissionError(f"line {number + 2} is not item {number} with 12 fields separated by TAB")
    frame, command = int(fields[2]), int(fields[3])
    first, second, third, fourth, lat, lon, altitude_m = map(float, fields[4:11])
    if number == 0:
        return HomePosition(lat, lon, altitude_m)
    heading = None if command in HEADING_COMMANDS and fourth == 0 else fourth
    try:
        if fields[11].strip() not in {"0", "1"}:
            raise MissionError(f"autocontinue is {shown(fields[11])}; expected 0 or 1")
        params = (first, second, third, heading)
        return MissionItem(
            command=command,
            frame=frame,
            params=params,
            lat=lat,
            lon=lon,
            altitude_m=altitude_m,
            autocontinue=fields[11].strip() == "1",
        )
    except MissionError as error:
        raise MissionError(f"item {number}: {error}") from error
