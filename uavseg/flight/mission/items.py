"""MAVLink mission items, home, geofence and rally points, checked when they are made."""

import math

import shapely

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, named_errors
from uavseg.raster.geodesy.globe import geod_wgs84

# MAV_CMD
WAYPOINT, LOITER, LOITER_TURNS, LOITER_TIME, RETURN, LAND, TAKEOFF = 16, 17, 18, 19, 20, 21, 22
LOITER_TO_ALTITUDE, SPLINE_WAYPOINT, VTOL_TAKEOFF, VTOL_LAND = 31, 82, 84, 85
JUMP, CHANGE_SPEED, MOUNT_CONTROL, CAMERA_DISTANCE, CAMERA_INTERVAL = 177, 178, 205, 206, 214
ROI_LOCATION, ROI_NONE = 195, 197
IMAGE_START, IMAGE_STOP = 2000, 2001
CONDITION_GATE = 4501
LAST_NAV = 95  # commands up to it move the vehicle
TAKEOFFS = frozenset({TAKEOFF, VTOL_TAKEOFF})
LANDINGS = frozenset({LAND, VTOL_LAND})
HEADING_COMMANDS = frozenset({WAYPOINT, LOITER, LAND, *TAKEOFFS})  # param4 is a heading that may be unset
POSITION_COMMANDS = frozenset(  # the vehicle flies to a position
    {*HEADING_COMMANDS, *LANDINGS, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALTITUDE, SPLINE_WAYPOINT}
)
PX4_MISSION_FRAME = frozenset(
    {RETURN, JUMP, CHANGE_SPEED, MOUNT_CONTROL, CAMERA_DISTANCE, CAMERA_INTERVAL}
    | {ROI_NONE, IMAGE_START, IMAGE_STOP}
)
# Jumps (601 to a tag), curves, circles and gates: paths that are more than straight legs between positions
ELSEWHERE = frozenset({JUMP, SPLINE_WAYPOINT, LOITER_TURNS, CONDITION_GATE, 601})
KNOWN = frozenset(  # with delay, wait, yaw, start of a landing, ROI, shutter and tag of jumps
    {*POSITION_COMMANDS, *PX4_MISSION_FRAME, *ELSEWHERE, ROI_LOCATION, 93, 112, 115, 189, 201, 203, 600}
)
DEGREE_DECIMALS = 8  # a millimetre
# MAV_FRAME
FRAME_AMSL, FRAME_MISSION, FRAME_RELATIVE, FRAME_TERRAIN = 0, 2, 3, 10

AUTOPILOTS = {"ardupilot": 3, "px4": 12, "generic": 0}  # MAV_AUTOPILOT
AUTOPILOT_NAMES = {"ardupilot": "ArduPilot", "px4": "PX4"}  # for people
MAX_ITEMS = 65534  # the link counts in 16 bits, and the home of ArduPilot takes one
MAX_HEIGHT_M = 1000.0  # above home: more is nearly always a height above the sea, or feet
MAX_FIRST_LEG_M = 20_000.0
MAX_DISTANCE_M = 100_000.0
MIN_PHOTO_STEP = 0.01  # metres or seconds between photographs: less is a damaged file
MIN_SPEED_M_S = 0.01

ItemParams = tuple[float | None, float | None, float | None, float | None]
Position = tuple[float, float]  # lat, lon in degrees, WGS 84


@dataclass(frozen=True, slots=True)
class HomePosition:
    """Home position, where the vehicle starts and returns to; MissionError if it is not on Earth."""

    lat: float  # degrees, WGS 84
    lon: float
    altitude_m: float = 0.0  # above the sea, -500 to 9000

    def __post_init__(self) -> None:
        check_position(self.lat, self.lon, "home")
        if not -500 <= self.altitude_m <= 9000:
            raise MissionError(f"home lies at {self.altitude_m:g} m above the sea; expected -500 to 9000 m")


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One MAVLink mission item.

    A MissionError says that a number is not finite, that the position is not on Earth, at or below home, or
    too high, that photographs follow one another by less than 0.01 m or s, or that the speed is less than
    0.01 m/s.
    """

    command: int  # MAV_CMD
    frame: int  # MAV_FRAME: 3 relative to home, 0 above the sea, 10 above the terrain, 2 without position
    params: ItemParams = (0.0, 0.0, 0.0, 0.0)  # param1 to param4; None means "not set" (NaN on the link)
    lat: float = 0.0  # degrees, WGS 84; not used by commands without position
    lon: float = 0.0
    altitude_m: float = 0.0  # above the zero of `frame`
    autocontinue: bool = True  # ArduPilot always continues; PX4 waits at the item where it is False

    def __post_init__(self) -> None:
        if len(self.params) != 4 or not all(p is None or math.isfinite(p) for p in self.params):
            raise MissionError(f"an item has four parameters, finite numbers or None, not {self.params}")
        if not all(map(math.isfinite, (self.lat, self.lon, self.altitude_m))):
            raise MissionError(
                f"an item of command {self.command} lies at lat {self.lat}, lon {self.lon}, "
                f"altitude {self.altitude_m}; these must be finite numbers"
            )
        if self.has_position:
            _check_item_position(self)
        _check_photo_step(self)
        speed = self.params[1] or 0.0  # 0 and less: as it was, or the default
        if self.command == CHANGE_SPEED and 0 < speed < MIN_SPEED_M_S:
            raise MissionError(
                f"command {self.command} sets a speed of {speed:g} m/s; expected {MIN_SPEED_M_S:g} m/s at "
                "least"
            )

    @property
    def has_position(self) -> bool:
        """Whether the vehicle flies to the position of this item."""
        return self.command in POSITION_COMMANDS

    @property
    def is_at_vehicle(self) -> bool:
        """Whether the item is at the position of the vehicle: a takeoff or landing at 0, 0."""
        return self.command in {*TAKEOFFS, *LANDINGS} and self.lat == 0 and self.lon == 0


def _check_item_position(item: MissionItem) -> None:
    check_position(item.lat, item.lon, f"an item of command {item.command}")
    if item.frame not in {FRAME_AMSL, FRAME_RELATIVE, FRAME_TERRAIN}:
        raise MissionError(
            f"an item with a position has frame 3 (above home), 0 (the sea) or 10 (terrain), not {item.frame}"
        )
    if item.frame == FRAME_AMSL:
        return
    if item.altitude_m < 0 or (item.altitude_m == 0 and item.command not in LANDINGS):
        raise MissionError(
            f"altitude is {item.altitude_m:g} m; the flight must be above home: give more than 0"
        )
    if item.altitude_m > MAX_HEIGHT_M:
        raise MissionError(
            f"altitude is {item.altitude_m:g} m above home, more than {MAX_HEIGHT_M:g} m: "
            "is it above the sea, or in feet? Give metres above home"
        )


def _check_photo_step(item: MissionItem) -> None:
    first, second, third, _ = (value or 0.0 for value in item.params)
    steps = {CAMERA_DISTANCE: (first, "m"), CAMERA_INTERVAL: (first / 1000, "s")}
    if third != 1:  # one photograph has no interval
        steps[IMAGE_START] = second, "s"
    step, unit = steps.get(item.command, (0.0, ""))
    if 0 < step < MIN_PHOTO_STEP:
        raise MissionError(
            f"command {item.command} takes a photograph every {step:g} {unit}; expected "
            f"{MIN_PHOTO_STEP:g} {unit} at least, or 0 for none"
        )


def check_position(lat: float, lon: float, what: str) -> None:
    """Refuse a position, in degrees, that is not on Earth; `what` names it in the message (MissionError)."""
    if not (math.isfinite(lat) and math.isfinite(lon)):
        raise MissionError(f"{what} lies at lat {lat}, lon {lon}; both must be finite numbers")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        swapped = "; latitude and longitude look swapped" if -90 <= lon <= 90 and -180 <= lat <= 180 else ""
        raise MissionError(
            f"{what} lies at lat {lat:g}, lon {lon:g}; expected -90..90 and -180..180{swapped}"
        )


def check_accepted(item: MissionItem, autopilot: str, number: int) -> None:
    """Refuse an item that the autopilot refuses or is known to fly differently (MissionError).

    For "generic", ArduPilot and PX4 must both accept the item. `number` names it in the message.
    """
    with named_errors(f"item {number}", MissionError):
        if autopilot != "px4":
            _check_ardupilot(item)
        if autopilot != "ardupilot":
            _check_px4(item)


def _check_ardupilot(item: MissionItem) -> None:
    unset = {number for number, value in enumerate(item.params, start=1) if value is None}
    may_be_unset = {VTOL_LAND: {3, 4}}.get(item.command, {4} if item.command in HEADING_COMMANDS else set())
    if unset - may_be_unset:
        raise MissionError(
            f"ArduPilot refuses command {item.command} with param{min(unset - may_be_unset)} unset"
        )
    if item.command in {CAMERA_INTERVAL, CONDITION_GATE}:
        raise MissionError(f"ArduPilot does not know command {item.command}")
    unset_place = item.altitude_m == 0 or item.lat == item.lon == 0
    if unset_place and item.has_position and item.command not in {*TAKEOFFS, *LANDINGS}:
        raise MissionError("ArduPilot reads altitude 0 and position 0,0 as those that the vehicle has")


def _check_px4(item: MissionItem) -> None:
    if item.frame == FRAME_TERRAIN:
        raise MissionError("PX4 has no heights above the terrain (frame 10); give them above home")
    if item.command == LOITER_TURNS:
        raise MissionError("PX4 does not fly LOITER_TURNS (18) in a mission")
    if item.command in PX4_MISSION_FRAME and item.frame != FRAME_MISSION:
        raise MissionError(f"PX4 takes command {item.command} in frame 2 only, not {item.frame}")


def check_near(home: HomePosition, lat: float, lon: float) -> None:
    """Refuse a first position to fly to, in degrees, more than 20 km from home (MissionError)."""
    away = distance_m(home.lat, home.lon, lat, lon)
    if away <= MAX_FIRST_LEG_M:
        return
    hint = "is its latitude first, then its longitude?"
    if abs(home.lon) <= 90 and distance_m(home.lon, home.lat, lat, lon) <= MAX_DISTANCE_M:
        hint = "home's latitude and longitude look swapped"
    raise MissionError(
        f"home ({home.lat:.6f},{home.lon:.6f}) is {away / 1000:.0f} km from the first position to fly to "
        f"({lat:.6f},{lon:.6f}), farther than {MAX_FIRST_LEG_M / 1000:.0f} km: {hint}"
    )


def distance_m(lat: float, lon: float, other_lat: float, other_lon: float) -> float:
    """Return the geodesic distance in metres between two positions in degrees."""
    return float(geod_wgs84().inv(lon, lat, other_lon, other_lat)[2])


@dataclass(frozen=True, slots=True)
class FencePolygon:
    """A polygon that the vehicle must stay inside or outside of.

    The vertices, degrees (WGS 84), are stored clockwise, as QGroundControl asks for, and without a repetition
    of the first. A MissionError says that a vertex is not on Earth, that there are fewer than three, or that
    the outline is not simple.
    """

    vertices: tuple[Position, ...]
    inclusion: bool = True  # whether the vehicle stays inside; False is a keep-out zone

    def __post_init__(self) -> None:
        vertices = tuple((float(lat), float(lon)) for lat, lon in self.vertices)
        for lat, lon in vertices:
            check_position(lat, lon, "a vertex of the fence")
        if len(vertices) > 1 and vertices[0] == vertices[-1]:
            vertices = vertices[:-1]
        if len(set(vertices)) < 3:
            raise MissionError(
                f"a fence polygon has at least three vertices; this one has {len(set(vertices))}"
            )
        first = vertices[0][1]  # longitudes near to it, also over the antimeridian
        ring = shapely.LinearRing([(first + (lon - first + 180) % 360 - 180, lat) for lat, lon in vertices])
        if not ring.is_simple:
            raise MissionError("the outline of a fence polygon crosses or touches itself")
        clockwise = (vertices[0], *vertices[:0:-1]) if ring.is_ccw else vertices  # as seen from above
        object.__setattr__(self, "vertices", clockwise)

    @property
    def positions(self) -> tuple[Position, ...]:
        """The vertices."""
        return self.vertices


@dataclass(frozen=True, slots=True)
class FenceCircle:
    """A circle that the vehicle must stay inside or outside of.

    A MissionError says that the centre is not on Earth, or the radius not above 0 and at most 100 km.
    """

    lat: float  # of the centre, in degrees, WGS 84
    lon: float
    radius_m: float
    inclusion: bool = True  # whether the vehicle stays inside; False is a keep-out zone

    def __post_init__(self) -> None:
        check_position(self.lat, self.lon, "the centre of a fence")
        if not 0 < self.radius_m <= MAX_DISTANCE_M:
            raise MissionError(
                f"the radius of a fence is above 0 and at most {MAX_DISTANCE_M:g} m, not {self.radius_m:g}"
            )

    @property
    def positions(self) -> tuple[Position, ...]:
        """The centre."""
        return ((self.lat, self.lon),)


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """A place to which the vehicle may return instead of home.

    A MissionError says that it is not on Earth, or the altitude not above 0 and at most 1000 m.
    """

    lat: float  # degrees, WGS 84
    lon: float
    altitude_m: float  # above home

    def __post_init__(self) -> None:
        check_position(self.lat, self.lon, "a rally point")
        if not (math.isfinite(self.altitude_m) and 0 < self.altitude_m <= MAX_HEIGHT_M):
            raise MissionError(
                f"a rally point is above home by more than 0 and at most {MAX_HEIGHT_M:g} m, "
                f"not {self.altitude_m:g}"
            )

    @property
    def positions(self) -> tuple[Position, ...]:
        """Its position."""
        return ((self.lat, self.lon),)


Fence = FencePolygon | FenceCircle
