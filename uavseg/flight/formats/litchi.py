"""Litchi's .csv files: waypoints with gimbal pitch, photographs at equal distances, and speeds.

The columns are those of Litchi's Mission Hub (import of CSV, metric units). Heights count from the place of
takeoff, or from the ground. Settings of the whole mission (what follows its end, straight or curved path,
heading mode) are not in the file.
"""

import csv
import io
import math
from collections.abc import Iterator
from contextlib import suppress

from uavseg.errors import MissionError, named_errors
from uavseg.flight.formats import wayline as waylines
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.formats.wayline import Wayline, WaylinePoint
from uavseg.flight.formats.waypoints import decimal
from uavseg.flight.mission.items import FRAME_RELATIVE, FRAME_TERRAIN
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import shown
from uavseg.raster.geodesy.globe import geod_wgs84

NAME = "a .csv of Litchi"
ACTIONS = 15
COLUMNS = (
    *("latitude", "longitude", "altitude(m)", "heading(deg)", "curvesize(m)", "rotationdir", "gimbalmode"),
    "gimbalpitchangle",
    *(f"action{field}{number}" for number in range(1, ACTIONS + 1) for field in ("type", "param")),
    *("altitudemode", "speed(m/s)", "poi_latitude", "poi_longitude", "poi_altitude(m)", "poi_altitudemode"),
    *("photo_timeinterval", "photo_distinterval"),
)
NO_ACTION, STAY, PHOTO = -1, 0, 1  # actiontype
PITCH_TO_POI, INTERPOLATED_PITCH = 1, 2  # gimbalmode; 0 leaves the gimbal to the pilot
MIN_WAYPOINTS, MAX_WAYPOINTS = 2, 99
MIN_HEIGHT_M, MAX_HEIGHT_M = -200.0, 500.0
MAX_SPEED_M_S = 15.0
MAX_STAY_MS = 32_000
MIN_LEG_M, MAX_LEG_M = 0.6, 1999.0
MAX_ROWS = 100_000


def write_litchi(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .csv file; raise MissionError if Litchi cannot fly it."""
    wayline = waylines.wayline_of(mission, NAME)
    check_wayline(wayline)
    rows = [COLUMNS, *map(_row, (None, *wayline.points), wayline.points)]
    return "".join(",".join(row) + "\n" for row in rows).encode()


def litchi_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return what a .csv cannot hold of a mission, and what has to be set in Litchi, one sentence each."""
    wayline, home = waylines.wayline_of(mission, NAME), mission.home
    end = {"return": "RTH", "land": "Land", "none": "None"}[wayline.finish]
    turned = any(point.heading_deg is not None or point.looks_at for point in wayline.points)
    heading = "custom" if turned else "auto"
    return [
        *waylines.wayline_losses(mission, wayline, NAME),
        f"in Litchi, set the path mode to straight lines, the heading mode to {heading} and the finish "
        f"action to {end}; the .csv does not hold them, nor home: take off at {home.lat:.6f},{home.lon:.6f}",
    ]


def check_wayline(wayline: Wayline) -> None:
    """Raise MissionError if Litchi does not fly a wayline."""
    count = len(wayline.points)
    if not MIN_WAYPOINTS <= count <= MAX_WAYPOINTS:
        raise MissionError(
            f"Litchi flies {MIN_WAYPOINTS} to {MAX_WAYPOINTS} waypoints, and the mission has {count}: split "
            f"it (--max-waypoints {MAX_WAYPOINTS}), or choose fewer regions or a wider spacing"
        )
    for number, point in enumerate(wayline.points, start=1):
        if not MIN_HEIGHT_M <= point.altitude_m <= MAX_HEIGHT_M:
            raise MissionError(
                f"Litchi flies at {MIN_HEIGHT_M:g} to {MAX_HEIGHT_M:g} m, and waypoint {number} is at "
                f"{point.altitude_m:g} m"
            )
        if not 0 < point.flown_m_s <= MAX_SPEED_M_S:
            raise MissionError(
                f"Litchi flies at up to {MAX_SPEED_M_S:g} m/s, and waypoint {number} asks for "
                f"{point.flown_m_s:g} m/s (--speed)"
            )
        if 1000 * point.hold_s > MAX_STAY_MS:
            raise MissionError(
                f"Litchi stays at a waypoint for up to {MAX_STAY_MS / 1000:g} s, and waypoint {number} asks "
                f"for {point.hold_s:g} s"
            )
    for number, leg_m in enumerate(waylines.legs_m(wayline.points), start=1):
        if not MIN_LEG_M <= leg_m <= MAX_LEG_M:
            raise MissionError(
                f"Litchi flies legs of {MIN_LEG_M:g} to {MAX_LEG_M:g} m, and the one from waypoint {number} "
                f"to {number + 1} is {leg_m:.1f} m long"
            )


def _row(before: WaylinePoint | None, point: WaylinePoint) -> list[str]:
    """Return the fields of a waypoint; where a leg from or to it looks at a place, so does the waypoint."""
    # Litchi turns evenly from what holds at one waypoint to what holds at the next.
    place = point.looks_at or (before and before.looks_at)
    heading, gimbal_mode = point.heading_deg, 0 if point.pitch_deg is None else INTERPOLATED_PITCH
    if place:
        heading = round(geod_wgs84().inv(point.lon, point.lat, place[1], place[0])[0], 1)
        gimbal_mode = PITCH_TO_POI
    actions = [(STAY, round(1000 * point.hold_s))] * (point.hold_s > 0) + [(PHOTO, 0)] * point.photo
    actions += [(NO_ACTION, 0)] * (ACTIONS - len(actions))
    return [
        *(decimal(point.lat, 8), decimal(point.lon, 8), decimal(point.altitude_m, 1)),
        "0" if heading is None else decimal(heading % 360 or 360.0, 1),
        *("0", "0"),
        str(gimbal_mode),
        decimal(point.pitch_deg or 0.0, 1),
        *(str(value) for action in actions for value in action),
        str(int(point.frame == FRAME_TERRAIN)),
        decimal(point.flown_m_s, 1),
        *([decimal(place[0], 8), decimal(place[1], 8), decimal(place[2], 1), "0"] if place else ["0"] * 4),
        decimal(point.interval_s, 1) if point.interval_s else "-1",
        decimal(point.trigger_m, 1) if point.trigger_m else "-1",
    ]


def read_litchi(content: bytes, name: str) -> Mission:
    """Read a .csv file of Litchi in metric units."""
    notes: dict[str, None] = {}
    points = tuple(_points(content.decode("utf-8-sig"), notes))
    if not points:
        raise MissionError("it holds no waypoints")
    notes["what follows the last waypoint is set in Litchi, not in its file"] = None
    takeoff_m = max(points[0].altitude_m, 1.0)  # Litchi takes off, and climbs to the first waypoint
    wayline = Wayline(points=points, takeoff_m=takeoff_m, approach_m_s=None, finish=waylines.FINISH_NONE)
    return waylines.mission_of_wayline(wayline, name, list(notes))


def _points(text: str, notes: dict[str, None]) -> Iterator[WaylinePoint]:
    with named_errors("it is not a table", csv.Error, MissionError):
        rows = csv.reader(io.StringIO(text), strict=True)
        header = [column.strip().lower() for column in next(rows, [])]
        _check_header(header)
        for number, row in enumerate(rows, start=1):
            if number > MAX_ROWS:
                raise MissionError(f"it has more than {MAX_ROWS:,} rows")
            if row and len(row) != len(header):
                raise MissionError(f"waypoint {number} has {len(row)} fields instead of {len(header)}")
            if row:
                yield _point(number, dict(zip(header, row, strict=True)), notes)


def _check_header(header: list[str]) -> None:
    if "altitude(ft)" in header:
        raise MissionError("its heights are in feet; export it from Litchi in metres")
    missing = [column for column in COLUMNS[:3] if column not in header]
    if missing:
        raise MissionError(
            f"its first line does not name {', '.join(missing)}: it is not a mission of Litchi"
        )
    if len(set(header)) < len(header):
        raise MissionError("two columns have the same name")


def _point(waypoint: int, row: dict[str, str], notes: dict[str, None]) -> WaylinePoint:
    def value(column: str, default: float = 0.0) -> float:
        text = row.get(column, "").strip()
        with suppress(ValueError):
            number = float(text) if text else default
            if math.isfinite(number):
                return number
        raise MissionError(f"{column} of waypoint {waypoint} is {shown(text)}; expected a number")

    if value("curvesize(m)"):
        notes["curves at waypoints were not read"] = None
    lat, lon, height_m = (value(f"poi_{name}") for name in ("latitude", "longitude", "altitude(m)"))
    looks_at = None
    if value("gimbalmode") == PITCH_TO_POI and (lat or lon) and not value("poi_altitudemode"):
        looks_at = lat, lon, height_m
    elif value("gimbalmode") not in {0, INTERPOLATED_PITCH} or lat or lon:
        notes["points of interest were not read"] = None
    hold_ms, photo = 0.0, False
    for action in range(1, ACTIONS + 1):
        code = value(f"actiontype{action}", NO_ACTION)
        if code == STAY:
            hold_ms += value(f"actionparam{action}")
        elif code == PHOTO:
            photo = True
        elif code != NO_ACTION:
            notes[f"actions of type {code:g} were not read"] = None
    heading = value("heading(deg)")
    return WaylinePoint(
        lat=value("latitude"),
        lon=value("longitude"),
        altitude_m=value("altitude(m)"),
        frame=FRAME_TERRAIN if value("altitudemode") else FRAME_RELATIVE,
        hold_s=hold_ms / 1000,
        heading_deg=heading % 360 if heading and looks_at is None else None,
        photo=photo,
        speed_m_s=value("speed(m/s)") or None,
        pitch_deg=value("gimbalpitchangle") if value("gimbalmode") == INTERPOLATED_PITCH else None,
        trigger_m=max(value("photo_distinterval"), 0.0),
        interval_s=max(value("photo_timeinterval"), 0.0),
        looks_at=looks_at,
    )
