"""Simulated flight as ArduCopter flies missions: an S-curve for each leg, legs that overlap in corners.

Transcribed from the behaviour of ArduPilot's AP_Math/SCurve.cpp, AC_WPNav.cpp and ArduCopter's modes (auto,
rtl, land), with default parameters. It shares nothing with the estimates of the package: legs are tables that
are integrated from the jerk, and the vehicle follows them in small time steps.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.flight.body import DT, Body, Vector
from benchmarks.flight.log import Log
from benchmarks.flight.route import Stop

ACCELERATION, JERK, JERK_RISE = 2.5, 1.0, 0.3
CORNER_ACCELERATION, RADIUS = 5.0, 2.0
CLIMB, DESCENT, VERTICAL_ACCELERATION = 2.5, 1.5, 1.0
RETURN_SPEED, RETURN_HEIGHT, CONE, RETURN_WAIT_S = 10.0, 15.0, 3.0, 5.0
LAND_SPEED, LAND_LOW = 0.5, 10.0
SPOOL_S = 0.5  # MOT_SPOOL_TIME
SLEW_S = 2.0  # TKOFF_SLEW_TIME, for all of the throttle
HOVER_THROTTLE = 0.39  # of the simulated quadrotor
LIFT_M_S = 0.5  # the climb is controlled from this speed on
DETECT_S = 1.0  # LAND_DETECTOR_TRIGGER_SEC
LOWER_S = 1.5  # until the throttle is at its lower limit
_TABLE_S = 0.01

Rise = Callable[[float, float], float]
_LONGEST_S = 4 * 3600.0


def ramp(speed: float, acceleration: float) -> list[tuple[float, float, float]]:
    """Way, speed and acceleration of a start from rest, every hundredth of a second.

    The jerk rises and falls as a raised cosine; how long the acceleration lasts is found by trial.
    """

    def pieces(peak: float, plateau: float) -> list[float]:
        rise = JERK_RISE if peak > JERK * JERK_RISE else math.sqrt(peak * JERK_RISE / JERK)
        flat = max(peak / JERK - rise, 0.0)
        jerk = peak / (rise + flat)
        return [rise, flat, rise, plateau, jerk]

    def speed_of(peak: float, plateau: float) -> float:
        rise, flat, _, hold, _ = pieces(peak, plateau)
        return peak * (2 * rise + flat + hold)

    low, high = 0.0, acceleration
    if speed_of(acceleration, 0.0) <= speed:
        peak, plateau = acceleration, (speed - speed_of(acceleration, 0.0)) / acceleration
    else:
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if speed_of(middle, 0.0) < speed else (low, middle)
        peak, plateau = low, 0.0
    rise, flat, _, hold, jerk = pieces(peak, plateau)
    up = 2 * rise + flat
    whole = 2 * up + hold

    def jerk_at(t: float) -> float:
        if up <= t < up + hold or t >= whole:
            return 0.0
        sign = 1.0 if t < up else -1.0
        t = t if t < up else t - up - hold
        if t < rise:
            return sign * jerk * (1 - math.cos(math.pi * t / rise)) / 2
        if t < rise + flat:
            return sign * jerk
        return sign * jerk * (1 + math.cos(math.pi * (t - rise - flat) / rise)) / 2

    steps = max(math.ceil(whole / _TABLE_S), 1)
    step = whole / steps
    table = [(0.0, 0.0, 0.0)]
    way = v = a = 0.0
    for k in range(steps):
        j = jerk_at((k + 0.5) * step)
        way += v * step + a * step * step / 2 + j * step**3 / 6
        v += a * step + j * step * step / 2
        a += j * step
        table.append((way, v, a))
    return table


@dataclass(slots=True)
class Leg:
    """An S-curve from rest to rest, as a table, and the time for which it has been flown."""

    start: Vector
    end: Vector
    unit: Vector
    limit: float
    times: list[float]
    states: list[tuple[float, float, float]]
    accelerated: float
    braking: float
    elapsed: float = 0.0

    @property
    def remaining(self) -> float:
        """Time until its end."""
        return self.times[-1] - self.elapsed

    def pass_time(self, seconds: float) -> None:
        """Fly on."""
        self.elapsed = min(self.elapsed + seconds, self.times[-1])

    def at(self, t: float) -> tuple[Vector, Vector, Vector]:
        """Way from the start, velocity and acceleration at a time, as vectors."""
        t = min(max(t, 0.0), self.times[-1])
        k = min(max(bisect_right(self.times, t) - 1, 0), len(self.times) - 2)
        span = self.times[k + 1] - self.times[k]
        part = (t - self.times[k]) / span if span else 0.0
        first, second = self.states[k], self.states[k + 1]
        way, speed, pull = (one + part * (two - one) for one, two in zip(first, second, strict=True))
        return _times(self.unit, way), _times(self.unit, speed), _times(self.unit, pull)


def _times(vector: Vector, factor: float) -> Vector:
    return vector[0] * factor, vector[1] * factor, vector[2] * factor


def _sum(one: Vector, two: Vector) -> Vector:
    return one[0] + two[0], one[1] + two[1], one[2] + two[2]


def _difference(one: Vector, two: Vector) -> Vector:
    return one[0] - two[0], one[1] - two[1], one[2] - two[2]


def make_leg(start: Vector, end: Vector, speed: float) -> Leg | None:
    """The S-curve of a leg; None if it has no length."""
    delta = [b - a for a, b in zip(start, end, strict=True)]
    length = math.hypot(*delta)
    if length < 1e-3:
        return None
    unit = (delta[0] / length, delta[1] / length, delta[2] / length)
    flat, steep = math.hypot(unit[0], unit[1]), abs(unit[2])
    vertical = CLIMB if delta[2] > 0 else DESCENT
    limit = min(speed / flat if flat else math.inf, vertical / steep if steep else math.inf)
    most = min(
        ACCELERATION / flat if flat else math.inf, VERTICAL_ACCELERATION / steep if steep else math.inf
    )
    table = ramp(limit, most)
    if table[-1][0] > length / 2:
        low, high = 0.0, limit
        for _ in range(30):
            middle = (low + high) / 2
            low, high = (middle, high) if ramp(middle, most)[-1][0] < length / 2 else (low, middle)
        table = ramp(max(low, 1e-4), most)
    way, top, _ = table[-1]
    seconds = 2 * way / top  # a ramp is symmetric: its mean speed is half of its last
    step = seconds / (len(table) - 1)
    cruise = max(length - 2 * way, 0.0) / top
    times = [k * step for k in range(len(table))]
    times += [seconds + cruise + k * step for k in range(len(table))]
    states = list(table)
    states += [(length - w, v, -a) for w, v, a in reversed(table)]
    return Leg(start, end, unit, limit, times, states, seconds, seconds + cruise)


class Copter:
    """The vehicle, its log, and the target that it follows along the legs."""

    def __init__(self, wind: Vector, gust_m_s: float = 0.0) -> None:
        self.log, self.body = Log(), Body(wind=wind, gust_m_s=gust_m_s)
        self.rise: Rise | None = None  # of the ground, where heights are above it
        self.offset = 0.0
        self.before: Leg | None = None
        self.scale = 1.0
        self.heading = 0.0

    def fly(self, leg: Leg, following: Leg | None) -> None:
        """Fly a leg to its end, or to the middle of the turn to the following one."""
        done = False
        while not done and self.log.seconds < _LONGEST_S:
            seconds = self.scale * DT
            leg.pass_time(seconds)
            way, velocity, acceleration = leg.at(leg.elapsed)
            target = _sum(leg.start, way)
            if self.before is not None:
                self.before.pass_time(seconds)
                way, speed, pull = self.before.at(self.before.elapsed)
                missing = _difference(_sum(self.before.start, way), self.before.end)
                target, velocity = _sum(target, missing), _sum(velocity, speed)
                acceleration = _sum(acceleration, pull)
            done = leg.remaining <= 0
            if following is not None and (following.elapsed > 0 or _may_turn(leg, following)):
                following.pass_time(seconds)
                way, speed, pull = following.at(following.elapsed)
                target, velocity = _sum(target, way), _sum(velocity, speed)
                acceleration = _sum(acceleration, pull)
                done = done or following.elapsed >= leg.remaining
            self.follow(target, velocity, acceleration)
        self.before = leg

    def follow(
        self, target: Vector, velocity: Vector = (0.0, 0.0, 0.0), acceleration: Vector = (0.0, 0.0, 0.0)
    ) -> None:
        """One time step; the target is slowed down while the vehicle lags behind it."""
        if self.rise is not None:
            change = self.rise(target[0], target[1]) - self.offset
            climb = min(max(change / DT, -DESCENT), CLIMB)
            self.offset += climb * DT
            target = (target[0], target[1], target[2] + self.offset)
            velocity = (velocity[0], velocity[1], velocity[2] + climb)
        self.body.step(target, velocity, acceleration)
        self.log.note(self.body, self.heading)
        speed = math.hypot(*velocity)
        wanted = 1.0
        if speed > 0:
            unit = _times(velocity, 1 / speed)
            error = sum(u * e for u, e in zip(unit, _difference(target, self.body.position), strict=True))
            actual = sum(u * v for u, v in zip(unit, self.body.velocity, strict=True))
            wanted = min(max(0.05 + (actual - error) / speed, 0.0), 1.0)
        self.scale += (wanted - self.scale) * DT / (ACCELERATION / JERK)

    def settle(self, place: Vector, radius: float = RADIUS) -> None:
        """Stay until the vehicle is near."""
        there = (place[0], place[1], place[2] + self.offset)
        while math.dist(self.body.position, there) > radius and self.log.seconds < _LONGEST_S:
            self.follow(place)
        self.before, self.scale = None, 1.0

    def go(self, start: Vector, end: Vector, speed: float) -> None:
        """A leg from rest to rest."""
        if leg := make_leg(start, end, speed):
            self.fly(leg, None)
        self.settle(end)

    def wait(self, place: Vector, seconds: float) -> None:
        """Hover."""
        for _ in range(round(seconds / DT)):
            self.follow(place)

    def start(self) -> None:
        """Rotors speed up, and the throttle rises until the vehicle climbs."""
        thrust, speed = HOVER_THROTTLE, 0.0
        self.log.stand(self.body, SPOOL_S + HOVER_THROTTLE * SLEW_S)
        while speed < LIFT_M_S:
            thrust += DT / SLEW_S
            speed += 9.81 * (thrust / HOVER_THROTTLE - 1) * DT
            self.log.stand(self.body, DT)

    def land(self, height: float) -> None:
        """Down, slowly near the ground: the speed is that of a square-root controller to the low altitude."""
        target, speed = height, 0.0
        while self.body.position[2] > 0.05 and self.log.seconds < _LONGEST_S:
            above = max(target - LAND_LOW, 0.0)
            knee = VERTICAL_ACCELERATION
            fast = above if above < knee else math.sqrt(2 * VERTICAL_ACCELERATION * (above - knee / 2))
            wanted = min(max(fast, LAND_SPEED), DESCENT)
            change = VERTICAL_ACCELERATION * DT
            speed += min(max(wanted - speed, -change), change)
            target -= speed * DT
            self.follow((0.0, 0.0, target), (0.0, 0.0, -speed))
        self.log.stand(self.body, LOWER_S + DETECT_S)


def fly(
    height: float,
    stops: list[Stop],
    returns: bool,
    wind: Vector = (0.0, 0.0, 0.0),
    rise: Rise | None = None,
    gust_m_s: float = 0.0,
) -> Log:
    """Fly a route from home and back, as `benchmarks.flight.route` gives it.

    Heights above the ground are flown over `rise`, the height of the ground above that at home; the target
    follows it no faster than the vehicle climbs and descends (AC_WPNav, terrain altitudes).
    """
    copter = Copter(wind, gust_m_s)
    place: Vector = (0.0, 0.0, height)
    copter.start()
    copter.go((0.0, 0.0, 0.0), place, CLIMB)
    copter.log.begin = len(copter.log.track)
    if any(stop.above_ground for stop in stops):
        copter.rise = rise
    leg = make_leg(place, stops[0].place, stops[0].speed)
    for k, stop in enumerate(stops):
        ahead = stops[k + 1] if k + 1 < len(stops) else None
        following = make_leg(stop.place, ahead.place, ahead.speed) if ahead else None
        copter.heading = _heading(place, stop.place, copter.heading)
        if leg is not None:
            copter.fly(leg, following if stop.hold_s == 0 else None)
        if stop.hold_s or ahead is None:
            copter.settle(stop.place)
            copter.wait(stop.place, stop.hold_s)
        place, leg = stop.place, following
        if ahead is not None:
            copter.heading = _heading(place, ahead.place, copter.heading)
        for action in stop.actions:
            copter.log.act(action, copter.body)
    place = (place[0], place[1], place[2] + copter.offset)
    copter.rise, copter.offset = None, 0.0  # it returns at a height above home
    if returns:
        _return(copter, place)
    return copter.log


def _return(copter: Copter, place: Vector) -> None:
    """Up to the height of the return where that is higher, home, wait, land."""
    above = max(min(RETURN_HEIGHT, CONE * math.hypot(place[0], place[1])), place[2])
    copter.go(place, (place[0], place[1], above), RETURN_SPEED)
    copter.go((place[0], place[1], above), (0.0, 0.0, above), RETURN_SPEED)
    copter.log.end = len(copter.log.track)
    copter.wait((0.0, 0.0, above), RETURN_WAIT_S)
    copter.land(above)


def _heading(start: Vector, end: Vector, otherwise: float) -> float:
    if math.dist(start[:2], end[:2]) < 1e-3:
        return otherwise
    return math.atan2(end[0] - start[0], end[1] - start[1])


def _may_turn(leg: Leg, following: Leg) -> bool:
    """Whether the next leg may begin: the middle of the turn is near, slow and gentle enough."""
    left = leg.remaining
    if leg.elapsed < leg.braking or left > following.accelerated:
        return False
    way, velocity, pull = leg.at(leg.elapsed + left / 2)
    ahead, speed, more = following.at(left / 2)
    offset = _sum(_difference(_sum(leg.start, way), leg.end), ahead)
    turning = _sum(pull, more)
    return (
        math.hypot(*offset) < RADIUS
        and math.hypot(*_sum(velocity, speed)) < min(leg.limit, following.limit)
        and math.hypot(turning[0], turning[1]) < CORNER_ACCELERATION
        and abs(turning[2]) < VERTICAL_ACCELERATION
    )
