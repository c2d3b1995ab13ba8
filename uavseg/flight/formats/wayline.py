"""Waylines: lists of waypoints, each with all that holds from there on, as DJI's and Litchi's files are.

A mission is a list of commands instead, in which a speed, a gimbal pitch or a camera trigger holds until
another command changes it.
"""

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.formats.waypoints import HOME_UNKNOWN
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import HomePosition, MissionItem, check_position, distance_m
from uavseg.flight.mission.mission import CRUISE_M_S, Mission

_SETTINGS = frozenset(
    {mav.CHANGE_SPEED, mav.MOUNT_CONTROL, mav.ROI_LOCATION, mav.ROI_NONE}
    | {mav.CAMERA_DISTANCE, mav.IMAGE_START, mav.IMAGE_STOP}
)
NEAR_M = 0.6  # DJI's aircraft and Litchi fly no shorter legs
TARGETING = 2.0  # MAV_MOUNT_MODE_MAVLINK_TARGETING
FINISH_RETURN, FINISH_LAND, FINISH_NONE = "return", "land", "none"


@dataclass(frozen=True, slots=True)
class WaylinePoint:
    """Waypoint, with what holds on the leg from there to the next."""

    lat: float  # degrees, WGS 84
    lon: float
    altitude_m: float  # above what `frame` says
    frame: int = mav.FRAME_RELATIVE  # MAV_FRAME: above home or above the terrain
    hold_s: float = 0.0
    heading_deg: float | None = None  # of the vehicle there, clockwise from north; None along the route
    photo: bool = False  # whether one photograph is taken there, after the hold
    speed_m_s: float | None = None  # from there on; None if the mission does not set it
    pitch_deg: float | None = None  # of the gimbal, from there on
    trigger_m: float = 0.0  # distance between photographs from there on; 0 for none
    interval_s: float = 0.0  # time between photographs from there on; 0 for none
    # place that vehicle and camera look at from there on: lat and lon in degrees, height above home
    looks_at: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.looks_at is not None:
            check_position(*self.looks_at[:2], "a place to look at")

    @property
    def flown_m_s(self) -> float:
        """Speed from there on; the default where the mission sets none."""
        return CRUISE_M_S if self.speed_m_s is None else self.speed_m_s

    @property
    def gimbal_deg(self) -> float | None:
        """Pitch of the gimbal there, to the place that it looks at if there is one; None if it is not set."""
        if self.looks_at is None:
            return self.pitch_deg
        lat, lon, height_m = self.looks_at
        away_m = distance_m(self.lat, self.lon, lat, lon)
        return round(math.degrees(math.atan2(height_m - self.altitude_m, away_m)), 1)


@dataclass(frozen=True, slots=True)
class Wayline:
    """Waypoints of a mission."""

    points: tuple[WaylinePoint, ...]
    takeoff_m: float | None  # height above home to which the vehicle takes off
    approach_m_s: float | None  # speed on the leg to the first waypoint
    finish: str  # "return", "land" or "none": what follows the last waypoint
    dropped: tuple[str, ...] = ()  # commands of the mission that a wayline cannot hold


def legs_m(points: Sequence[WaylinePoint]) -> list[float]:
    """Return the lengths of the legs between waypoints in metres, with climb and descent."""
    return [
        math.hypot(distance_m(one.lat, one.lon, two.lat, two.lon), two.altitude_m - one.altitude_m)
        for one, two in pairwise(points)
    ]


class _WaylineBuilder:
    """Wayline of the items of a mission, added one after another, with what holds at each."""

    def __init__(self, home: HomePosition, format_name: str) -> None:
        self.home, self.format_name = home, format_name
        self.points: list[WaylinePoint] = []
        self.now = WaylinePoint(0.0, 0.0, 0.0)
        self.takeoff_m: float | None = None
        self.approach_m_s: float | None = None
        self.finish = ""
        self.dropped: dict[str, None] = {}

    def add(self, number: int, item: MissionItem) -> None:
        if self.finish:
            raise MissionError(
                f"{self.format_name} ends with the return or landing, and item {number} follows"
            )
        if item.command in {mav.WAYPOINT, mav.LOITER_TIME}:
            self._fly_to(item)
        elif item.command == mav.TAKEOFF:
            if self.points:
                raise MissionError(f"{self.format_name} cannot hold a second takeoff (item {number})")
            self.takeoff_m = self._height(item)[0]
        elif item.command == mav.RETURN:
            self.finish = FINISH_RETURN
        elif item.command == mav.LAND:
            self._land_at(item)
            self.finish = FINISH_LAND
        elif item.command in _SETTINGS:
            self._set(item)
        elif item.command <= mav.LAST_NAV or item.command in {mav.JUMP, mav.CONDITION_GATE}:
            raise MissionError(f"{self.format_name} cannot hold command {item.command} (item {number})")
        else:
            self.dropped[f"command {item.command} (item {number})"] = None

    def _land_at(self, item: MissionItem) -> None:
        """Fly to where the vehicle lands at the height of the waypoint before, if a leg leads there."""
        if item.is_at_vehicle:
            return
        height_m = item.altitude_m
        for last in self.points[-1:]:
            if distance_m(last.lat, last.lon, item.lat, item.lon) < NEAR_M:
                return
            height_m = last.altitude_m + (self.home.altitude_m if item.frame == mav.FRAME_AMSL else 0.0)
        self._fly_to(replace(item, command=mav.WAYPOINT, altitude_m=height_m))

    def _height(self, item: MissionItem) -> tuple[float, int]:
        """Return height and frame; heights above the sea become heights above home."""
        if item.frame == mav.FRAME_AMSL:
            return item.altitude_m - self.home.altitude_m, mav.FRAME_RELATIVE
        return item.altitude_m, item.frame

    def _fly_to(self, item: MissionItem) -> None:
        height, frame = self._height(item)
        point = replace(self.now, lat=item.lat, lon=item.lon, altitude_m=height, frame=frame, photo=False)
        heading = item.params[3] if item.command == mav.WAYPOINT else None
        self.points.append(replace(point, hold_s=item.params[0] or 0.0, heading_deg=heading))

    def _set(self, item: MissionItem) -> None:
        """Change what holds from the last waypoint on."""
        first, second, third, _ = (value or 0.0 for value in item.params)
        changes: dict[str, object]
        if item.command == mav.CHANGE_SPEED:
            changes = {"speed_m_s": second} if second > 0 else {}  # negative: no change
        elif item.command == mav.MOUNT_CONTROL:
            changes = {"pitch_deg": first}
            if second or third:
                self.dropped["roll and yaw of the gimbal"] = None
        elif item.command == mav.ROI_LOCATION and item.frame != mav.FRAME_TERRAIN:
            changes = {"looks_at": (item.lat, item.lon, self._height(item)[0])}
        elif item.command == mav.ROI_LOCATION:
            self.dropped["places to look at by their height above the terrain"] = None
            return
        elif item.command == mav.ROI_NONE:
            changes = {"looks_at": None}
        elif item.command == mav.CAMERA_DISTANCE:
            changes = {"trigger_m": max(first, 0.0)}
            before, point = self.points[-2:-1], self.points[-1:]
            begun = any(one.trigger_m > 0 for one in point) and not any(one.trigger_m > 0 for one in before)
            if first <= 0 and begun:  # on and off at one waypoint: the photograph at once
                changes["photo"] = True
        elif item.command == mav.IMAGE_STOP:
            changes = {"interval_s": 0.0}
        elif third == 1:
            changes = {"photo": True}
        elif third == 0 and second > 0:
            changes = {"interval_s": second}
        else:
            self.dropped[f"a series of {third:g} photographs"] = None
            return
        if not changes:
            return
        if self.points:
            self.points[-1] = replace(self.points[-1], **changes)  # type: ignore[arg-type]
        elif changes.keys() & {"photo", "trigger_m", "interval_s"}:
            self.dropped["photographs before the first waypoint"] = None
        if changes != {"photo": True}:
            self.now = replace(self.now, **changes)  # type: ignore[arg-type]
            if not self.points:
                self.approach_m_s = self.now.speed_m_s


def wayline_of(mission: Mission, format_name: str) -> Wayline:
    """Turn the commands of a mission into a wayline; `format_name`, such as "a .kmz", is for messages.

    A MissionError says that an item is not for a flight along waypoints.
    """
    builder = _WaylineBuilder(mission.home, format_name)
    for number, item in enumerate(mission.items, start=1):
        builder.add(number, item)
    if not builder.points:
        raise MissionError(f"{format_name} needs a waypoint, and the mission has none")
    return Wayline(
        points=tuple(builder.points),
        takeoff_m=builder.takeoff_m,
        approach_m_s=builder.approach_m_s,
        finish=builder.finish or FINISH_NONE,
        dropped=tuple(builder.dropped),
    )


def items_of_wayline(wayline: Wayline, home: HomePosition) -> Iterator[MissionItem]:
    """Yield the items of a mission that flies a wayline; the inverse of `wayline_of`."""
    first = wayline.points[0]
    now = WaylinePoint(0.0, 0.0, 0.0)
    if wayline.takeoff_m is not None:
        yield MissionItem(
            mav.TAKEOFF, mav.FRAME_RELATIVE, (0.0, 0.0, 0.0, None), home.lat, home.lon, wayline.takeoff_m
        )
    now = yield from _changes(now, replace(now, speed_m_s=wayline.approach_m_s, pitch_deg=first.pitch_deg))
    for point in wayline.points:
        params = (point.hold_s, 0.0, 0.0, point.heading_deg)
        yield MissionItem(mav.WAYPOINT, point.frame, params, point.lat, point.lon, point.altitude_m)
        now = yield from _changes(now, point)
    if wayline.finish == FINISH_RETURN:
        yield MissionItem(mav.RETURN, mav.FRAME_MISSION)
    elif wayline.finish == FINISH_LAND:
        yield MissionItem(mav.LAND, mav.FRAME_RELATIVE, (0.0, 0.0, 0.0, None))


def _changes(before: WaylinePoint, after: WaylinePoint) -> Generator[MissionItem, None, WaylinePoint]:
    """Yield items for what differs from before; return what holds then."""
    if after.speed_m_s is not None and after.speed_m_s != before.speed_m_s:
        yield MissionItem(mav.CHANGE_SPEED, mav.FRAME_MISSION, (1.0, after.speed_m_s, -1.0, 0.0))
    if after.pitch_deg is not None and after.pitch_deg != before.pitch_deg:
        yield MissionItem(
            mav.MOUNT_CONTROL, mav.FRAME_MISSION, (after.pitch_deg, 0.0, 0.0, 0.0), altitude_m=TARGETING
        )
    if after.looks_at is not None and after.looks_at != before.looks_at:
        lat, lon, height_m = after.looks_at
        yield MissionItem(mav.ROI_LOCATION, mav.FRAME_RELATIVE, lat=lat, lon=lon, altitude_m=height_m)
    elif after.looks_at != before.looks_at:
        yield MissionItem(mav.ROI_NONE, mav.FRAME_MISSION)
    if after.photo:
        yield MissionItem(mav.IMAGE_START, mav.FRAME_MISSION, (0.0, 0.0, 1.0, 0.0))
    if after.trigger_m != before.trigger_m:
        immediate = float(after.trigger_m > 0)
        yield MissionItem(mav.CAMERA_DISTANCE, mav.FRAME_MISSION, (after.trigger_m, 0.0, immediate, 0.0))
    if after.interval_s != before.interval_s:
        if after.interval_s > 0:
            yield MissionItem(mav.IMAGE_START, mav.FRAME_MISSION, (0.0, after.interval_s, 0.0, 0.0))
        else:
            yield MissionItem(mav.IMAGE_STOP, mav.FRAME_MISSION)
    return after


def mission_of_wayline(wayline: Wayline, name: str, notes: Sequence[str]) -> Mission:
    """Turn a wayline into a mission whose home is not known: at its first waypoint, 0 m above the sea.

    A MissionError says that the mission would not be safe.
    """
    home = HomePosition(wayline.points[0].lat, wayline.points[0].lon)
    items = tuple(items_of_wayline(wayline, home))
    autopilot = "ardupilot" if any(item.frame == mav.FRAME_TERRAIN for item in items) else "generic"
    return Mission(home, items, autopilot, name, (*notes, HOME_UNKNOWN))


def wayline_losses(mission: Mission, wayline: Wayline, format_name: str) -> list[str]:
    """Return what a list of waypoints cannot hold of a mission, one sentence each."""
    notes = []
    if not all(item.autocontinue for item in mission.items):
        notes.append(f"{format_name} cannot hold where a mission waits (autocontinue 0): it goes on there")
    if mission.fence or mission.rally:
        notes.append(f"{format_name} cannot hold a fence or rally points: they were not written")
    if wayline.dropped:
        notes.append(f"{format_name} cannot hold all items; not written: {', '.join(wayline.dropped[:5])}")
    if any(item.has_position and item.frame == mav.FRAME_AMSL for item in mission.items):
        notes.append(
            f"heights above the sea were written as heights above home ({mission.home.altitude_m:g} m above "
            "the sea)"
        )
    return notes
