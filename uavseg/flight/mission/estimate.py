"""Estimate of a mission from its path as flown: length, time, photographs and their footprints, energy."""

import math
from contextlib import suppress
from dataclasses import asdict, field
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Photos
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.duration import CALM, leg_seconds
from uavseg.flight.mission.items import MissionItem
from uavseg.flight.mission.mission import CRUISE_M_S, Mission
from uavseg.flight.mission.track import Plane, leg_lengths
from uavseg.flight.mission.vehicle import Vehicle, Wind, default_vehicle

Place = tuple[float, float, float]

CIRCLE_M = 10.0  # radius of turns without one: CIRCLE_RADIUS of ArduCopter


@dataclass(frozen=True, slots=True)
class FlownPath:
    """Legs of a mission, for n positions."""

    xyz_m: Floats  # (n, 3), metres east, north and above home; home first
    seconds: Floats  # (n - 1,)
    part: NDArray[np.str_]  # (n - 1,), "climb", "flight" or "return"
    hold_s: Floats  # (n,), wait at each position
    rise_m: Floats  # (n,), height of the ground there above home; 0 where not known
    photographs: Integers  # (n - 1,), on each leg; those taken while waiting count on the leg before
    shots: tuple["ShotRun", ...]
    return_hold_s: float
    landing_s: float
    is_line: Bools  # (n - 1,), whether photographs are taken along the leg, by distance or time
    has_shot: Bools  # (n,), whether a single photograph is taken
    pitch_deg: Floats  # (n - 1,), gimbal pitch on each leg; NaN where no item has set it

    @property
    def length_m(self) -> Floats:
        """Length of each leg over ground."""
        return leg_lengths(self.xyz_m[:, :2])

    @property
    def height_m(self) -> Floats:
        """Height of each leg above the ground at its higher end."""
        above = self.xyz_m[:, 2] - self.rise_m
        return np.maximum(above[:-1], above[1:])

    def direction(self, leg: int) -> Floats:
        """Return the unit vector of a leg, east and north; one of no length has that of another one."""
        steps = np.diff(self.xyz_m[:, :2], axis=0)
        for step in (*steps[leg::-1], *steps[leg + 1 :]):
            if length := math.hypot(*step):
                along: Floats = step / length
                return along
        return np.array([0.0, 1.0])

    def pitches_deg(self, photos: Photos) -> Floats:
        """Return the gimbal pitch on each leg: that of photographs until an item sets it."""
        return np.where(np.isnan(self.pitch_deg), photos.pitch_deg, self.pitch_deg)


@dataclass(frozen=True, slots=True)
class ShotRun:
    """Photographs at even steps along a leg; place of the first and step are shares of the leg."""

    leg: int
    count: int
    first: float
    step: float


@dataclass(slots=True)
class _Walk:
    """Positions so far, with speed, part and triggers of the leg to each, and stops and holds at each."""

    xyz: list[Place]
    speed: list[float] = field(default_factory=list)
    part: list[str] = field(default_factory=list)
    trigger: list[tuple[float, float]] = field(default_factory=list)  # metres, seconds
    shots: list[int] = field(default_factory=list)  # single photographs
    rise: list[float] = field(default_factory=lambda: [0.0])
    hold: list[float] = field(default_factory=lambda: [0.0])
    stop: list[bool] = field(default_factory=lambda: [True])
    pitch: list[float] = field(default_factory=list)
    gimbal_deg: float = math.nan

    def go(self, place: Place, speed: float, part: str, trigger: tuple[float, float]) -> None:
        self.xyz.append(place)
        self.speed.append(speed)
        self.part.append(part)
        self.trigger.append(trigger)
        self.shots.append(0)
        self.rise.append(0.0)
        self.hold.append(0.0)
        self.stop.append(part != "flight")
        self.pitch.append(self.gimbal_deg)

    def wait(self, seconds: float) -> None:
        self.hold[-1] += seconds
        self.stop[-1] = True


def flown_path(mission: Mission, vehicle: Vehicle | None = None, wind: Wind = CALM) -> FlownPath:
    """Return the legs of a mission as a vehicle flies them: up, along its items, back where it returns.

    By default the vehicle is that of the mission, or the default one of its autopilot.
    In a wind from any direction, times are those of the direction in which the flight takes longest.
    """
    vehicle = vehicle or mission.vehicle or default_vehicle(mission.autopilot)
    plane = Plane(mission.home.lat, mission.home.lon)
    walk = _Walk([(0.0, 0.0, 0.0)])
    speed, trigger, ends = CRUISE_M_S, (0.0, 0.0), ""
    for item in mission.items:
        if item.command == mav.CHANGE_SPEED and (item.params[0] or 0) <= 1 and (item.params[1] or 0) > 0:
            speed = float(item.params[1] or speed)
        elif item.command == mav.CAMERA_DISTANCE:
            trigger = (max(item.params[0] or 0.0, 0.0), 0.0)
            walk.shots[-1:] = [shots + (item.params[2] == 1) for shots in walk.shots[-1:]]
        elif item.command == mav.CAMERA_INTERVAL:
            trigger = (0.0, max(item.params[0] or 0.0, 0.0) / 1000)  # milliseconds
        elif item.command == mav.IMAGE_START:
            if item.params[2] != 1:
                trigger = (0.0, max(item.params[1] or 0.0, 0.0))
            walk.shots[-1:] = [shots + 1 for shots in walk.shots[-1:]]
        elif item.command == mav.IMAGE_STOP:
            trigger = (0.0, 0.0)
        elif item.command == mav.MOUNT_CONTROL:
            walk.gimbal_deg = float(item.params[0] or 0.0)
        elif item.command == mav.RETURN:
            _return(walk, vehicle)
            ends = "return"
            break
        elif item.has_position:
            part = "climb" if item.command in mav.TAKEOFFS else "flight"
            walk.go(_place(item, mission, plane, walk.xyz[-1]), speed, part, trigger)
            if mission.ground is not None:
                home = (mission.home.lat, mission.home.lon)
                walk.rise[-1] = mission.ground.rise_m(home, (item.lat, item.lon))
            if seconds := _hold_s(item, speed):
                walk.wait(seconds)
            if item.command in mav.LANDINGS:
                walk.stop[-1] = True
                ends = "land"
                break
            if item.command == mav.LOITER:
                break  # for ever
    return _path(walk, vehicle, wind, ends)


def _place(item: MissionItem, mission: Mission, plane: Plane, before: Place) -> Place:
    height = before[2] if item.command in mav.LANDINGS else mission.height_above_home_m(item)
    if item.is_at_vehicle:
        return before[0], before[1], height
    x, y = plane.xy_from_lonlat(item.lon, item.lat)
    return float(x), float(y), height


def _hold_s(item: MissionItem, speed: float) -> float:
    first = abs(item.params[0] or 0.0)
    if item.command in {mav.WAYPOINT, mav.LOITER_TIME}:
        return first
    if item.command == mav.LOITER_TURNS:
        return first * 2 * math.pi * (abs(item.params[2] or 0.0) or CIRCLE_M) / speed
    return 0.0


def _return(walk: _Walk, vehicle: Vehicle) -> None:
    """Climb to the height of the return where that is higher, then go straight home."""
    x, y, height = walk.xyz[-1]
    walk.stop[-1] = True
    return_height = min(vehicle.return_height_m, vehicle.return_slope * math.hypot(x, y))
    if return_height > height:
        height = return_height
        walk.go((x, y, height), vehicle.return_speed_m_s, "return", (0.0, 0.0))
    walk.go((0.0, 0.0, height), vehicle.return_speed_m_s, "return", (0.0, 0.0))


def _path(walk: _Walk, vehicle: Vehicle, wind: Wind, ends: str) -> FlownPath:
    xyz = np.array(walk.xyz, np.float64).reshape(-1, 3)
    hold = np.array(walk.hold)
    speed, stop = np.array(walk.speed, np.float64), np.array(walk.stop)
    seconds = max(
        (leg_seconds(xyz, speed, vehicle, stop, hold, one) for one in wind.directions()), key=np.sum
    )
    climbs = np.flatnonzero(np.array(walk.part) == "climb")
    seconds[climbs[:1]] += vehicle.start_s
    slow_m = np.clip(np.diff(xyz[:, 2])[climbs], 0.0, vehicle.takeoff_height_m)  # climbs begin slowly
    seconds[climbs] += slow_m * (1 / vehicle.takeoff_m_s - 1 / vehicle.climb_m_s)
    shots = _shots(walk, leg_lengths(xyz[:, :2]), seconds + hold[1:])
    photographs = np.zeros(len(seconds), np.int64)
    for run in shots:
        photographs[run.leg] += run.count
    return FlownPath(
        xyz_m=xyz,
        seconds=seconds,
        part=np.array(walk.part, dtype="<U6"),
        hold_s=hold,
        rise_m=np.array(walk.rise),
        photographs=photographs,
        shots=shots,
        return_hold_s=vehicle.return_hold_s if ends == "return" else 0.0,
        landing_s=float(landing_seconds(xyz[-1, 2], vehicle)) + vehicle.stop_s if ends else 0.0,
        is_line=np.array([any(trigger) for trigger in walk.trigger], np.bool_),
        has_shot=np.array([False, *(shots > 0 for shots in walk.shots)], np.bool_),
        pitch_deg=np.array(walk.pitch, np.float64),
    )


def landing_seconds(height_m: Floats | float, vehicle: Vehicle) -> Floats:
    """Return the time of a vehicle's descent from a height to the ground, the last metres slowly."""
    slow = np.clip(height_m, 0.0, vehicle.landing_height_m)
    seconds: Floats = slow / vehicle.landing_m_s + np.maximum(height_m - slow, 0.0) / vehicle.descent_m_s
    return seconds


def _shots(walk: _Walk, length: Floats, seconds: Floats) -> tuple[ShotRun, ...]:
    """Return the photographs of each leg: a distance or time continues over corners until it is changed."""
    runs: list[ShotRun] = []
    carried, before = 0.0, (0.0, 0.0)
    for leg, (trigger, shots) in enumerate(zip(walk.trigger, walk.shots, strict=True)):
        if trigger != before or (leg and walk.shots[leg - 1]):
            carried = 0.0
        before = trigger
        every = trigger[0] or trigger[1]
        if every:
            whole = float(length[leg] if trigger[0] else seconds[leg])
            done = carried + whole
            count = math.floor(done / every + 1e-6)
            if count and whole:
                runs.append(ShotRun(leg, count, (every - carried) / whole, every / whole))
            elif count:
                runs.append(ShotRun(leg, count, 1.0, 0.0))
            carried = max(done - count * every, 0.0)
        # a photograph that starts a line is taken where the leg before ends, and shows the line
        if shots:
            last = len(length) - 1
            runs.append(ShotRun(min(leg + 1, last), shots, float(leg == last), 0.0))
    return tuple(runs)


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimated length, time, photographs and energy of a flight, in its wind."""

    distance_m: float  # over ground, with the return
    duration_s: float  # from when the motors start until they stop: the sum of the five times that follow
    climb_s: float
    flight_s: float
    hold_s: float
    return_s: float  # to above home, with the wait there
    landing_s: float
    photographs: int
    # of photographs, where the ground sampling distance is coarsest; None where the camera is not known
    gsd_m: float | None = None
    footprint_m: tuple[float, float] | None = None  # width and depth, across and along the line of flight
    photographed_m2: float | None = None  # flat ground that the photographs show
    energy_wh: float | None = None  # None where the power of the vehicle is not known
    battery: float | None = None  # share of a full battery
    wind_m_s: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the estimate for JSON: times and lengths to a tenth, unknown values as None."""
        decimals = {"gsd_m": 6, "battery": 4}
        return {name: _rounded(value, decimals.get(name, 1)) for name, value in asdict(self).items()}


def _rounded(value: Any, decimals: int) -> Any:
    if isinstance(value, tuple):
        return [round(part, decimals) for part in value]
    return value if value is None or isinstance(value, int) else round(value, decimals)


def estimate(
    mission: Mission, vehicle: Vehicle | None = None, photos: Photos | None = None, wind: Wind | None = None
) -> Estimate:
    """Estimate a mission.

    By default with the photographs, the wind and the vehicle of the mission, or else a multirotor with the
    default parameters of its autopilot in calm air. In a wind that may come from any direction, it is the
    longest flight of those in 12 directions. A MissionError says that a leg cannot be flown against the wind.

    Examples
    --------
    >>> from uavseg.flight.mission.items import FRAME_RELATIVE, RETURN, TAKEOFF, HomePosition, MissionItem
    >>> from uavseg.flight.mission.mission import Mission
    >>> up = MissionItem(TAKEOFF, FRAME_RELATIVE, lat=47.0, lon=8.0, altitude_m=30.0)
    >>> there = MissionItem(16, FRAME_RELATIVE, lat=47.001, lon=8.0, altitude_m=30.0)
    >>> flight = estimate(Mission(HomePosition(47, 8), (up, there, MissionItem(RETURN, 2))))
    >>> round(flight.distance_m), round(flight.duration_s)
    (222, 105)
    """
    vehicle = vehicle or mission.vehicle or default_vehicle(mission.autopilot)
    wind = wind or mission.wind or CALM
    path = flown_path(mission, vehicle, wind)
    times = {part: float(path.seconds[path.part == part].sum()) for part in ("climb", "flight", "return")}
    hold, landing = float(path.hold_s.sum()), path.landing_s
    waits = hold + path.return_hold_s
    photos = photos or mission.photos
    gsd_m = footprint_m = photographed_m2 = energy = None
    if photos and path.photographs.any():
        with suppress(ParameterError):  # of a pitch in a file that no photograph of the ground has
            legs, pitches = np.flatnonzero(path.photographs), path.pitches_deg(photos)
            slant_m = path.height_m[legs] / np.maximum(np.sin(np.radians(-pitches[legs])), 1e-9)
            seen = float(path.height_m[legs][slant_m.argmax()]), float(pitches[legs][slant_m.argmax()])
            gsd_m, footprint_m = photos.camera.gsd_m(*seen), photos.camera.footprint_m(*seen)
            photographed_m2 = _photographed_m2(path, photos)
    if vehicle.hover_w is not None and vehicle.cruise_w is not None:
        hover_s, cruise_s = times["climb"] + waits + landing, times["flight"] + times["return"]
        energy = (vehicle.cruise_w * cruise_s + vehicle.hover_w * hover_s) / 3600
    return Estimate(
        distance_m=float(path.length_m.sum()),
        duration_s=sum(times.values()) + waits + landing,
        climb_s=times["climb"],
        flight_s=times["flight"],
        hold_s=hold,
        return_s=times["return"] + path.return_hold_s,
        landing_s=landing,
        photographs=int(path.photographs.sum()),
        gsd_m=gsd_m,
        footprint_m=footprint_m,
        photographed_m2=photographed_m2,
        energy_wh=energy,
        battery=None if energy is None else energy / (vehicle.battery_wh or math.nan),
        wind_m_s=wind.speed_m_s,
    )


def _photographed_m2(path: FlownPath, photos: Photos) -> float:
    """Return the area of the union of the strips that the photographs of each leg show."""
    strips, pitches = [], path.pitches_deg(photos).tolist()
    for leg in np.flatnonzero(path.photographs > 0):
        start, end = path.xyz_m[leg, :2], path.xyz_m[leg + 1, :2]
        length = float(np.hypot(*(end - start)))
        height = float(path.height_m[leg])
        if height <= 0:
            continue
        along = (end - start) / length if length else np.array([0.0, 1.0])
        across = np.array([along[1], -along[0]])
        near, far = photos.camera.ground_reach_m(height, pitches[leg])
        half = photos.camera.footprint_m(height, pitches[leg])[0] / 2
        first, last = start + near * along, end + far * along
        ring = [first - half * across, first + half * across, last + half * across, last - half * across]
        strips.append(shapely.Polygon(ring))
    return float(shapely.union_all(strips).area)


def estimate_text(distance_m: float, duration_s: float) -> str:
    """Return length (metres) and duration (seconds) of flights for people.

    >>> estimate_text(4410.3, 425)
    '4.41 km, about 7 min 05 s'
    """
    return f"{distance_m / 1000:.2f} km, {duration_text(duration_s)}"


def duration_text(seconds: float | None) -> str:
    """Return a duration for people: about 7 min 05 s."""
    if seconds is None or not math.isfinite(seconds):  # a sum of waits may overflow
        return "without end"
    minutes, rest = divmod(round(seconds), 60)
    return f"about {minutes} min {rest:02d} s"


MAX_FOOTPRINTS = 5000


@dataclass(frozen=True)
class Footprints:
    """Footprints of the photographs of a mission on flat ground."""

    lonlat: Floats  # (n, 4, 2), corners in degrees: near left, near right, far right, far left, as flown
    note: str = ""  # reason why there are none; empty where there are


def footprints(mission: Mission, photos: Photos | None = None) -> Footprints:
    """Compute the flat ground that each photograph of a mission shows; the camera looks along the flight.

    `photos` are by default those of the mission. A gimbal pitch that items of the mission set takes
    precedence.
    """
    path = flown_path(mission)
    count = int(path.photographs.sum())
    known = photos or mission.photos
    if not count:
        return _none("the mission takes no photographs" if photos else "")
    if known is None:
        return _none("a mission file does not say which camera: name it for footprints of photographs")
    if any(item.command == mav.ROI_LOCATION for item in mission.items):
        return _none("no footprints: the camera looks at places, not along the flight")
    if count > MAX_FOOTPRINTS:
        return _none(f"no footprints: {count:,} photographs are more than {MAX_FOOTPRINTS:,}")
    pitches = path.pitches_deg(known).tolist()
    ground = []
    for run in path.shots:
        shares = np.clip(run.first + run.step * np.arange(run.count), 0, 1)
        try:
            corners = known.camera.footprint_corners_m(1.0, pitches[run.leg])
        except ParameterError as error:
            return _none(f"no footprints: {error}")
        ground.append(_on_ground(path, run.leg, shares, corners))
    xy = np.concatenate(ground)
    plane = Plane(mission.home.lat, mission.home.lon)
    lon, lat = plane.lonlat_from_xy(xy[..., 0].ravel(), xy[..., 1].ravel())
    return Footprints(np.stack([lon, lat], axis=-1).reshape(-1, 4, 2))


def _none(note: str) -> Footprints:
    return Footprints(np.empty((0, 4, 2)), note)


def _on_ground(path: FlownPath, leg: int, shares: Floats, corners: Floats) -> Floats:
    """Project corners (4, 2) at a height of 1 m to metres from home; they coincide at or below the ground."""
    start, end = path.xyz_m[leg], path.xyz_m[leg + 1]
    heights = path.xyz_m[leg : leg + 2, 2] - path.rise_m[leg : leg + 2]
    height = np.maximum(heights[0] + shares * (heights[1] - heights[0]), 0.0)
    along = path.direction(leg)
    across = np.array([along[1], -along[0]])
    offsets = corners[:, :1] * across + corners[:, 1:] * along
    places = start[:2] + shares[:, None] * (end - start)[:2]
    ground: Floats = places[:, None] + height[:, None, None] * offsets
    return ground
