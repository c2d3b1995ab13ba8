"""Flight path of a mission: its legs in metres with their times, holds and photographs."""

import math
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CAMERA_INTERVAL,
    CHANGE_SPEED,
    IMAGE_START,
    IMAGE_STOP,
    LANDINGS,
    LOITER,
    LOITER_TIME,
    LOITER_TURNS,
    RETURN,
    TAKEOFFS,
    WAYPOINT,
    MissionItem,
)
from uavseg.flight.mission.mission import CRUISE_M_S, Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.vehicle import Vehicle

Place = tuple[float, float, float]

CIRCLE_M = 10.0
"""Radius of turns without one: CIRCLE_RADIUS of ArduCopter."""


@dataclass(frozen=True, slots=True)
class FlownPath:
    """Legs of a mission, for n positions."""

    xyz_m: Floats  # (n, 3), metres east, north and above home; home first
    seconds: Floats  # (n - 1,)
    part: NDArray[np.str_]  # (n - 1,), "climb", "flight" or "return"
    hold_s: Floats  # (n,), wait at each position
    rise_m: Floats  # (n,), height of the ground there above home; 0 where not known
    photographs: NDArray[np.int64]  # (n - 1,), on each leg; those taken while waiting count on the leg before
    shots: tuple["ShotRun", ...]
    return_hold_s: float
    landing_s: float
    is_line: NDArray[np.bool_]  # (n - 1,), whether photographs are taken along the leg, by distance or time
    has_shot: NDArray[np.bool_]  # (n,), whether a single photograph is taken

    @property
    def length_m(self) -> Floats:
        """Length of each leg over ground."""
        lengths: Floats = np.hypot(*np.diff(self.xyz_m[:, :2], axis=0).T)
        return lengths

    @property
    def height_m(self) -> Floats:
        """Height of each leg above the ground at its higher end."""
        above = self.xyz_m[:, 2] - self.rise_m
        return np.maximum(above[:-1], above[1:])


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

    def go(self, place: Place, speed: float, part: str, trigger: tuple[float, float]) -> None:
        self.xyz.append(place)
        self.speed.append(speed)
        self.part.append(part)
        self.trigger.append(trigger)
        self.shots.append(0)
        self.rise.append(0.0)
        self.hold.append(0.0)
        self.stop.append(part != "flight")

    def wait(self, seconds: float) -> None:
        self.hold[-1] += seconds
        self.stop[-1] = True


def flown_path(mission: Mission, vehicle: Vehicle) -> FlownPath:
    """Return the legs of a mission as a vehicle flies them: up, along its items, back where it returns."""
    plane = Plane(mission.home.lat, mission.home.lon)
    walk = _Walk([(0.0, 0.0, 0.0)])
    speed, trigger, ends = CRUISE_M_S, (0.0, 0.0), ""
    for item in mission.items:
        if item.command == CHANGE_SPEED and (item.params[0] or 0) <= 1 and (item.params[1] or 0) > 0:
            speed = float(item.params[1] or speed)
        elif item.command == CAMERA_DISTANCE:
            trigger = (max(item.params[0] or 0.0, 0.0), 0.0)
            walk.shots[-1:] = [shots + (item.params[2] == 1) for shots in walk.shots[-1:]]
        elif item.command == CAMERA_INTERVAL:
            trigger = (0.0, max(item.params[0] or 0.0, 0.0) / 1000)  # milliseconds
        elif item.command == IMAGE_START:
            if item.params[2] != 1:
                trigger = (0.0, max(item.params[1] or 0.0, 0.0))
            walk.shots[-1:] = [shots + 1 for shots in walk.shots[-1:]]
        elif item.command == IMAGE_STOP:
            trigger = (0.0, 0.0)
        elif item.command == RETURN:
            _return(walk, vehicle)
            ends = "return"
            break
        elif item.has_position:
            part = "climb" if item.command in TAKEOFFS else "flight"
            walk.go(_place(item, mission, plane, walk.xyz[-1]), speed, part, trigger)
            if mission.ground is not None:
                home = (mission.home.lat, mission.home.lon)
                walk.rise[-1] = mission.ground.rise_m(home, (item.lat, item.lon))
            if seconds := _hold_s(item, speed):
                walk.wait(seconds)
            if item.command in LANDINGS:
                walk.stop[-1] = True
                ends = "land"
                break
            if item.command == LOITER:
                break  # for ever
    return _path(walk, vehicle, ends)


def _place(item: MissionItem, mission: Mission, plane: Plane, before: Place) -> Place:
    height = before[2] if item.command in LANDINGS else mission.height_above_home_m(item)
    if item.is_at_vehicle:
        return before[0], before[1], height
    x, y = plane.xy_from_lonlat(item.lon, item.lat)
    return float(x), float(y), height


def _hold_s(item: MissionItem, speed: float) -> float:
    first = abs(item.params[0] or 0.0)
    if item.command in {WAYPOINT, LOITER_TIME}:
        return first
    if item.command == LOITER_TURNS:
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


def _path(walk: _Walk, vehicle: Vehicle, ends: str) -> FlownPath:
    xyz = np.array(walk.xyz, np.float64).reshape(-1, 3)
    hold = np.array(walk.hold)
    seconds = leg_seconds(xyz, np.array(walk.speed, np.float64), vehicle, np.array(walk.stop), hold)
    climbs = np.flatnonzero(np.array(walk.part) == "climb")
    slow_m = np.clip(np.diff(xyz[:, 2])[climbs], 0.0, vehicle.takeoff_height_m)  # climbs begin slowly
    seconds[climbs] += slow_m * (1 / vehicle.takeoff_m_s - 1 / vehicle.climb_m_s)
    shots = _shots(walk, np.hypot(*np.diff(xyz[:, :2], axis=0).T), seconds + hold[1:])
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
        landing_s=landing_seconds(float(xyz[-1, 2]), vehicle) if ends else 0.0,
        is_line=np.array([any(trigger) for trigger in walk.trigger], np.bool_),
        has_shot=np.array([False, *(shots > 0 for shots in walk.shots)], np.bool_),
    )


def landing_seconds(height_m: float, vehicle: Vehicle) -> float:
    """Return the time of a vehicle's descent from a height to the ground, the last metres slowly."""
    slow = min(max(height_m, 0.0), vehicle.landing_height_m)
    return slow / vehicle.landing_m_s + max(height_m - slow, 0.0) / vehicle.descent_m_s


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
