"""Routes: what a mission makes a vehicle do at each waypoint, for formats that are no lists of commands.

A mission is a list of commands, in which a speed, a gimbal pitch or a camera trigger holds until another
command changes it. DJI's and Litchi's files are lists of waypoints, each with all that holds from there on.
"""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace

from uavseg.errors import MissionError
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    CONDITION_GATE,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    IMAGE_START,
    IMAGE_STOP,
    JUMP,
    LAND,
    LOITER_TIME,
    MOUNT_CONTROL,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

LAST_NAV = 95  # MAV_CMD_NAV_LAST: commands up to it move the vehicle
TARGETING = 2.0  # MAV_MOUNT_MODE_MAVLINK_TARGETING
FINISH_RETURN, FINISH_LAND, FINISH_NONE = "return", "land", "none"


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """One waypoint, and what holds on the leg from there to the next.

    Parameters
    ----------
    lat, lon : float
        Degrees, WGS 84.
    altitude_m : float
        Metres, relative to what `frame` says.
    frame : int
        MAV_FRAME: above home or above the terrain.
    hold_s : float
        Seconds at the waypoint.
    heading_deg : float, optional
        Of the vehicle at the waypoint, clockwise from north; None along the route.
    photo : bool
        Whether a photograph is taken there, after the hold.
    speed_m_s : float, optional
        From there on; None if the mission does not set it.
    pitch_deg : float, optional
        Of the gimbal, from there on.
    trigger_m, interval_s : float
        Distance and time between the photographs from there on; 0 for none.
    """

    lat: float
    lon: float
    altitude_m: float
    frame: int = FRAME_RELATIVE
    hold_s: float = 0.0
    heading_deg: float | None = None
    photo: bool = False
    speed_m_s: float | None = None
    pitch_deg: float | None = None
    trigger_m: float = 0.0
    interval_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Route:
    """The waypoints of a mission.

    Parameters
    ----------
    points : tuple of RoutePoint
    takeoff_m : float, optional
        Height above home to which the vehicle takes off.
    approach_m_s : float, optional
        Speed on the way to the first waypoint.
    finish : str
        "return", "land" or "none": what follows the last waypoint.
    dropped : tuple of str
        What a route does not hold.
    """

    points: tuple[RoutePoint, ...]
    takeoff_m: float | None
    approach_m_s: float | None
    finish: str
    dropped: tuple[str, ...] = ()


class _Walk:
    """The items of a mission, one after another, with what holds at each."""

    def __init__(self, home: HomePosition, format_name: str) -> None:
        self.home = home
        self.format_name = format_name
        self.points: list[RoutePoint] = []
        self.now = RoutePoint(0.0, 0.0, 0.0)
        self.takeoff_m: float | None = None
        self.approach_m_s: float | None = None
        self.finish = ""
        self.dropped: dict[str, None] = {}

    def step(self, number: int, item: MissionItem) -> None:
        if self.finish:
            raise MissionError(
                f"{self.format_name} ends with the return or landing, and item {number} follows"
            )
        if item.command in {WAYPOINT, LOITER_TIME}:
            self._fly_to(item)
        elif item.command == TAKEOFF:
            if self.points:
                raise MissionError(f"{self.format_name} cannot hold a second takeoff (item {number})")
            self.takeoff_m = self._height(item)[0]
        elif item.command == RETURN:
            self.finish = FINISH_RETURN
        elif item.command == LAND:
            if not item.is_at_vehicle:
                self._fly_to(replace(item, command=WAYPOINT, altitude_m=self._landing_height(item)))
            self.finish = FINISH_LAND
        elif item.command in {CHANGE_SPEED, MOUNT_CONTROL, CAMERA_DISTANCE, IMAGE_START, IMAGE_STOP}:
            self._set(item)
        elif item.has_position or item.command <= LAST_NAV or item.command in {JUMP, CONDITION_GATE}:
            raise MissionError(f"{self.format_name} cannot hold command {item.command} (item {number})")
        else:
            self.dropped[f"command {item.command} (item {number})"] = None

    def _landing_height(self, item: MissionItem) -> float:
        """Where it lands it comes at the height at which it flew before."""
        before = self.points[-1] if self.points else None
        sea_m = self.home.altitude_m if item.frame == FRAME_AMSL else 0.0
        return item.altitude_m if before is None else before.altitude_m + sea_m

    def _height(self, item: MissionItem) -> tuple[float, int]:
        """Height and frame; heights above the sea become heights above home."""
        if item.frame == FRAME_AMSL:
            return item.altitude_m - self.home.altitude_m, FRAME_RELATIVE
        return item.altitude_m, item.frame

    def _fly_to(self, item: MissionItem) -> None:
        height, frame = self._height(item)
        held = item.params[0] or 0.0
        heading = item.params[3] if item.command == WAYPOINT else None
        self.points.append(
            replace(
                self.now,
                lat=item.lat,
                lon=item.lon,
                altitude_m=height,
                frame=frame,
                hold_s=held,
                heading_deg=heading,
                photo=False,
            )
        )

    def _set(self, item: MissionItem) -> None:
        """Change what holds from the last waypoint on."""
        first, second, third, _ = (value or 0.0 for value in item.params)
        changes: dict[str, object]
        if item.command == CHANGE_SPEED:
            changes = {"speed_m_s": second} if second > 0 else {}  # negative: no change
        elif item.command == MOUNT_CONTROL:
            changes = {"pitch_deg": first}
            if second or third:
                self.dropped["roll and yaw of the gimbal"] = None
        elif item.command == CAMERA_DISTANCE:
            changes = {"trigger_m": max(first, 0.0)}
        elif item.command == IMAGE_STOP:
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
        if "photo" not in changes:
            self.now = replace(self.now, **changes)  # type: ignore[arg-type]
            if not self.points:
                self.approach_m_s = self.now.speed_m_s


def route_of(mission: Mission, format_name: str) -> Route:
    """What a mission does at its waypoints.

    Parameters
    ----------
    mission : Mission
    format_name : str
        Such as "a .kmz", for messages.

    Raises
    ------
    MissionError
        If an item would make the vehicle fly otherwise than along waypoints.
    """
    walk = _Walk(mission.home, format_name)
    for number, item in enumerate(mission.items, start=1):
        walk.step(number, item)
    if not walk.points:
        raise MissionError(f"{format_name} needs a waypoint, and the mission has none")
    finish = walk.finish or FINISH_NONE
    return Route(tuple(walk.points), walk.takeoff_m, walk.approach_m_s, finish, tuple(walk.dropped))


def items_of_route(route: Route, home: HomePosition) -> Iterator[MissionItem]:
    """The items of a mission that does what a route says; the inverse of `route_of`."""
    first = route.points[0]
    now = RoutePoint(0.0, 0.0, 0.0)
    if route.takeoff_m is not None:
        yield MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), home.lat, home.lon, route.takeoff_m)
    begin = replace(now, speed_m_s=route.approach_m_s, pitch_deg=first.pitch_deg)
    now = yield from _changes(now, begin)
    for point in route.points:
        params = (point.hold_s, 0.0, 0.0, point.heading_deg)
        yield MissionItem(WAYPOINT, point.frame, params, point.lat, point.lon, point.altitude_m)
        now = yield from _changes(now, point)
    if route.finish == FINISH_RETURN:
        yield MissionItem(RETURN, FRAME_MISSION)
    elif route.finish == FINISH_LAND:
        yield MissionItem(LAND, FRAME_RELATIVE, (0.0, 0.0, 0.0, None))


def _changes(before: RoutePoint, after: RoutePoint) -> Generator[MissionItem, None, RoutePoint]:
    """Items for what differs from before; returns what holds then."""
    if after.speed_m_s is not None and after.speed_m_s != before.speed_m_s:
        yield MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, after.speed_m_s, -1.0, 0.0))
    if after.pitch_deg is not None and after.pitch_deg != before.pitch_deg:
        yield MissionItem(
            MOUNT_CONTROL, FRAME_MISSION, (after.pitch_deg, 0.0, 0.0, 0.0), altitude_m=TARGETING
        )
    if after.photo:
        yield MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 0.0, 1.0, 0.0))
    if after.trigger_m != before.trigger_m:
        immediate = float(after.trigger_m > 0)
        yield MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (after.trigger_m, 0.0, immediate, 0.0))
    if after.interval_s != before.interval_s:
        if after.interval_s > 0:
            yield MissionItem(IMAGE_START, FRAME_MISSION, (0.0, after.interval_s, 0.0, 0.0))
        else:
            yield MissionItem(IMAGE_STOP, FRAME_MISSION)
    return after


def mission_of_route(route: Route, name: str, notes: Sequence[str]) -> Mission:
    """A route whose home is not known as a mission; home is at its first waypoint, at 0 m above the sea.

    Raises
    ------
    MissionError
        If the mission would not be safe.
    """
    first = route.points[0]
    home = HomePosition(first.lat, first.lon)
    items = tuple(items_of_route(route, home))
    autopilot = "ardupilot" if any(item.frame == FRAME_TERRAIN for item in items) else "generic"
    where = "the file does not hold home: the position of the first waypoint is taken, at 0 m above the sea"
    return Mission(home, items, autopilot, name, (*notes, where))


def route_losses(mission: Mission, route: Route, format_name: str) -> list[str]:
    """What a list of waypoints does not hold of a mission."""
    notes = []
    if not all(item.autocontinue for item in mission.items):
        notes.append(f"{format_name} cannot hold where a mission waits (autocontinue 0): it goes on there")
    if mission.fence or mission.rally:
        notes.append(f"{format_name} cannot hold a fence or rally points: they were not written")
    if route.dropped:
        notes.append(f"{format_name} cannot hold all items; not written: {', '.join(route.dropped[:5])}")
    if any(item.has_position and item.frame == FRAME_AMSL for item in mission.items):
        notes.append(
            f"heights above the sea were written as heights above home ({mission.home.altitude_m:g} m above "
            "the sea)"
        )
    return notes
