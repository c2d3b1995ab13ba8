"""Mission Planner's .waypoints files (QGC WPL 110)."""

import re
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import cause_of, first_of, shown

HEADER = "QGC WPL 110"
_ENDS = mav.TAKEOFFS | mav.LANDINGS
MISFITS = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError)
R = TypeVar("R")
HOME_UNKNOWN = (
    "the file does not hold home: the position of the first waypoint is taken, at 0 m above the sea"
)
_SEPARATOR = re.compile(r"\s*,\s*|\s+")
# Frames of integer coordinates are those of floats; without a frame, heights are above the sea.
_FRAMES = {mav.FRAME_MISSION: mav.FRAME_AMSL, 5: mav.FRAME_AMSL, 6: mav.FRAME_RELATIVE, 11: mav.FRAME_TERRAIN}


def waypoints_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return what a .waypoints file cannot hold of a mission, one sentence each."""
    if mission.fence or mission.rally:
        return ["a .waypoints file cannot hold a fence or rally points: they were not written; use a .plan"]
    return []


def write_waypoints(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .waypoints file (QGC WPL 110), home in row 0."""
    home = mission.home
    # altitude 1: only the position is checked
    start = MissionItem(mav.WAYPOINT, mav.FRAME_RELATIVE, (0.0,) * 4, home.lat, home.lon, 1.0)
    rows = [_row(0, 1, mav.FRAME_AMSL, start, home.altitude_m)]
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
    rows: list[list[str]] = []
    for line, text in enumerate(lines, start=2):
        row = _SEPARATOR.split(text.strip())
        if row == [""] or row[0].startswith("#"):
            continue
        number = int(rows[-1][0]) + 1 if rows else int(row[0] == "1")  # the first one may be missing
        if len(row) != 12 or row[0] != str(number):
            raise MissionError(
                f"line {line} is not item {number} with 12 fields separated by TAB, spaces or commas"
            )
        rows.append(row)
    home, notes = _home(rows)
    reader = ItemReader(home)
    items = reader.read((row for row in rows if row[0] != "0"), _fields_of)
    return Mission(home, items, name=name, notes=(*notes, *reader.notes))


def _home(rows: list[list[str]]) -> tuple[HomePosition, list[str]]:
    """Return home, which is row 0, or the first position, with notes."""
    notes = []
    if rows and rows[0][0] == "0" and [*map(int, rows[0][2:4])] != [mav.FRAME_AMSL, mav.WAYPOINT]:
        notes.append(f"row 0 is home for ArduPilot, which does not fly its command {rows[0][3]}")
    for fields in rows:
        lat, lon, altitude_m = map(float, fields[8:11])
        if lat == 0 and lon == 0:
            continue
        if fields[0] == "0":
            return HomePosition(lat, lon, altitude_m), notes
        if int(fields[3]) in mav.POSITION_COMMANDS:
            return HomePosition(lat, lon), [*notes, HOME_UNKNOWN]
    raise MissionError("it holds neither home nor a position to fly to")


def _fields_of(row: list[str]) -> dict[str, Any]:
    """Return the fields of `MissionItem` of a row."""
    frame, command = int(row[2]), int(row[3])
    first, second, third, fourth, lat, lon, altitude_m = map(float, row[4:11])
    if row[11] not in {"0", "1"}:
        raise MissionError(f"autocontinue is {shown(row[11])}; expected 0 or 1")
    return {
        "command": command,
        "frame": frame,
        "params": (first, second, third, None if command in mav.HEADING_COMMANDS and fourth == 0 else fourth),
        "lat": lat,
        "lon": lon,
        "altitude_m": altitude_m,
        "autocontinue": row[11] == "1",
    }


class ItemReader:
    """Reader of items in their order, with position and height of the vehicle at each.

    To ArduPilot, altitude 0 is the height that it has, and 0, 0 where it is (`ModeAuto::loc_from_cmd`).
    """

    def __init__(self, home: HomePosition, autopilot: str = "ardupilot") -> None:
        self.home = home
        self.is_ardupilot = autopilot == "ardupilot"
        self.lat, self.lon = home.lat, home.lon
        self.height: tuple[int, float] | None = None  # frame and metres, by the last item that says them
        self.filled: list[str] = []  # what items were given of it

    def read(self, rows: Iterable[R], fields_of: Callable[[R], dict[str, Any]]) -> tuple[MissionItem, ...]:
        """Return the items of rows, by the fields of `MissionItem` of each; errors name their number."""
        items = []
        for number, row in enumerate(rows, start=1):
            try:
                fields = fields_of(row)
                items.append(MissionItem(**(self._filled(number, fields) if self.is_ardupilot else fields)))
            except MissionError as error:
                raise MissionError(f"item {number}: {error}") from error
            except MISFITS as error:
                raise MissionError(f"item {number}: {cause_of(error)}") from error
        return tuple(items)

    @property
    def notes(self) -> list[str]:
        """What was taken from the state of the vehicle."""
        means = "altitude 0 is the height that the vehicle has, and position 0,0 where it is, to ArduPilot"
        return [f"{means}: {first_of(self.filled, 3)}"] if self.filled else []

    def _filled(self, number: int, fields: dict[str, Any]) -> dict[str, Any]:
        command, at_vehicle = fields["command"], fields["lat"] == 0 and fields["lon"] == 0
        if command == mav.RETURN:
            self.lat, self.lon = self.home.lat, self.home.lon
        elif not at_vehicle and command <= mav.LAST_NAV and command not in mav.TAKEOFFS:  # which only climb
            self.lat, self.lon = fields["lat"], fields["lon"]
        if command not in mav.POSITION_COMMANDS:
            return fields
        fields["frame"] = _FRAMES.get(fields["frame"], fields["frame"])
        if at_vehicle and command not in _ENDS:
            fields |= {"lat": self.lat, "lon": self.lon}
            self.filled.append(f"item {number} at {self.lat:.6f},{self.lon:.6f}")
        if fields["altitude_m"] == 0 and command in mav.LANDINGS and fields["frame"] == mav.FRAME_AMSL:
            fields["frame"] = mav.FRAME_RELATIVE
        elif fields["altitude_m"] == 0 and self.height and command not in {*_ENDS, mav.LOITER_TO_ALTITUDE}:
            fields["frame"], fields["altitude_m"] = self.height
            self.filled.append(f"item {number} at {self.height[1]:g} m")
        if command not in mav.LANDINGS:
            self.height = fields["frame"], fields["altitude_m"]
        return fields
