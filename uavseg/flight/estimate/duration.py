"""Time of each leg of a flight without wind: acceleration, braking and corners as an autopilot flies them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.estimate.ramps import Ramp, largest
from uavseg.flight.estimate.vehicle import Vehicle

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SHORTEST_M = 1e-3  # a leg that is shorter is not flown
NEAR_M = 0.8
"""A height is reached within this distance where turns are "slow": NAV_MC_ALT_RAD of PX4."""


def leg_seconds(
    xyz_m: Floats, speed_m_s: float | Floats, vehicle: Vehicle, stops: Bools | None = None
) -> Floats:
    """Time of each leg of a path that is flown from rest to rest.

    Parameters
    ----------
    xyz_m : (n, 3) float64 array
        Corners of the path in metres: east, north and up.
    speed_m_s : float or (n - 1,) float64 array
        Speed over ground, of each leg.
    vehicle : Vehicle
    stops : (n,) bool array, optional
        Corners at which the vehicle stops, as for a hold; by default the first and the last, at which it
        always does.

    Returns
    -------
    seconds : (n - 1,) float64 array
        The time saved in a corner is shared by the legs before and after it.

    Notes
    -----
    With ``turns="blend"`` each leg is an S-curve from rest to rest, and the next one begins before it ends:
    as early as the middle of the turn lies within the radius of the corner, and neither speed nor
    acceleration exceed their limits there (ArduPilot, libraries/AP_Math/SCurve.cpp,
    advance_target_along_track).

    With ``turns="slow"`` the speed v at a distance d from a corner is limited by braking to the speed w of
    the corner, v^2 + 4 a^2 / j v = 2 a d + w^2. With an angle t between the legs w^2 = a' r / tan(t / 2), for
    the circle that touches both legs at the acceptance radius r with the acceleration a' (PX4,
    src/lib/motion_planning/TrajectoryConstraints.hpp and TrajMath.hpp). Height changes at the same time, with
    its own limits.

    Examples
    --------
    >>> from uavseg.flight.estimate.vehicle import ARDUCOPTER
    >>> path = np.array([[0, 0, 30], [100, 0, 30], [100, 50, 30]], float)
    >>> leg_seconds(path, 5.0, ARDUCOPTER).round(1).tolist()
    [22.6, 12.6]
    """
    xyz = np.asarray(xyz_m, np.float64)
    legs = np.diff(xyz, axis=0)
    if len(legs) == 0:
        return np.zeros(0)
    speeds = np.broadcast_to(np.asarray(speed_m_s, np.float64), len(legs))
    stop = np.zeros(len(xyz), bool) if stops is None else np.array(stops, bool)
    stop[[0, -1]] = True
    flown = np.linalg.norm(legs, axis=1) > SHORTEST_M
    seconds = np.zeros(len(legs))
    if flown.any():
        index = np.flatnonzero(flown)  # a corner of several equal points stops if one of them does
        groups = np.concatenate([[0], index + 1, [len(xyz)]])
        kept = np.array([stop[first:end].any() for first, end in pairwise(groups)])
        times = _BY_TURNS[vehicle.turns]
        seconds[flown] = times(legs[flown], speeds[flown], vehicle, kept)
    return seconds


def _blended(legs: Floats, speeds: Floats, vehicle: Vehicle, stops: Bools) -> Floats:
    """S-curves from rest to rest, less the time by which each overlaps with the next."""
    length = np.linalg.norm(legs, axis=1)
    flat, up = np.hypot(legs[:, 0], legs[:, 1]), legs[:, 2]
    vertical = np.where(up > 0, vehicle.climb_m_s, vehicle.descent_m_s)
    limit = length * _slower(speeds, flat, vertical, np.abs(up))
    accelerations = (vehicle.acceleration_m_s2, vehicle.vertical_acceleration_m_s2)
    level, upward = (np.full(len(legs), one) for one in accelerations)
    acceleration = length * _slower(level, flat, upward, np.abs(up))
    ramp = Ramp(acceleration, vehicle.jerk_m_s3, vehicle.jerk_rise_s)
    speed = largest(lambda v: v * ramp.seconds(v) <= length, np.full(len(legs), 1e-6), limit)
    seconds: Floats = ramp.seconds(speed) + length / speed
    overlap = np.where(stops[1:-1], 0.0, _overlaps(legs / length[:, None], speed, limit, ramp, vehicle))
    seconds[:-1] -= overlap / 2
    seconds[1:] -= overlap / 2
    return seconds


def _slower(along: Floats, flat: Floats, vertical: Floats, height: Floats) -> Floats:
    """A limit along a slope, in slope lengths: by its horizontal part, or by its vertical part."""
    with np.errstate(divide="ignore"):
        slower: Floats = np.minimum(along / flat, vertical / height)
    return slower


def _overlaps(directions: Floats, speed: Floats, limit: Floats, ramp: Ramp, vehicle: Vehicle) -> Floats:
    """Time by which each leg overlaps with the next."""
    if len(speed) < 2:
        return np.zeros(0)
    before, after = directions[:-1], directions[1:]
    first, second = _part(ramp, slice(None, -1)), _part(ramp, slice(1, None))
    slowest = np.minimum(limit[:-1], limit[1:])

    def fits(overlap: Floats) -> Bools:
        half = overlap / 2
        way_in, speed_in, braking = first.start(half, speed[:-1])
        way_out, speed_out, accelerating = second.start(half, speed[1:])
        offset = way_out[:, None] * after - way_in[:, None] * before
        velocity = speed_out[:, None] * after + speed_in[:, None] * before
        turning = (accelerating[:, None] * after - braking[:, None] * before)[:, :2]
        found: Bools = np.linalg.norm(offset, axis=1) <= vehicle.radius_m
        found &= np.linalg.norm(velocity, axis=1) <= slowest * (1 + 1e-6)
        found &= np.linalg.norm(turning, axis=1) <= vehicle.corner_acceleration_m_s2
        return found

    longest = np.minimum(first.seconds(speed[:-1]), second.seconds(speed[1:]))
    return largest(fits, np.zeros(len(longest)), longest)


def _part(ramp: Ramp, some: slice) -> Ramp:
    return Ramp(np.asarray(ramp.acceleration_m_s2)[some], ramp.jerk_m_s3, ramp.jerk_rise_s)


def _slowed(legs: Floats, speeds: Floats, vehicle: Vehicle, stops: Bools) -> Floats:
    """Acceleration from one corner and braking to the speed of the next; the height changes meanwhile."""
    radius, limits = vehicle.radius_m, _Braking(vehicle.acceleration_m_s2, vehicle)
    length, straight = np.hypot(legs[:, 0], legs[:, 1]), _cosines(legs)
    through = np.minimum(_corner_speeds(straight, vehicle), limits.speed(length[1:], 0.0))
    through = np.minimum(through, np.minimum(speeds[:-1], speeds[1:]))
    passed = ~stops[1:-1]
    through[~passed | (length[1:] < radius)] = 0.0
    corner = np.append(through, 0.0)
    arrival = np.minimum(np.maximum(limits.speed(np.full(len(legs), radius), corner), corner), speeds)
    start = np.concatenate([[0.0], arrival[:-1] * passed])
    way = np.maximum(length - radius + np.concatenate([[0.0], radius * straight * passed]), 0.0)
    turned_s, turned_m = _turns(np.append(1.0, straight), start, limits.ramp)
    share = np.minimum(way / np.maximum(turned_m, 1e-9), 1.0)
    rest_m = np.maximum(way - turned_m, 0.0)
    flat = turned_s * share + limits.seconds(
        _Way(rest_m, np.minimum(start, speeds), arrival, corner, radius), speeds
    )
    up = legs[:, 2]
    vertical = _Braking(vehicle.vertical_acceleration_m_s2, vehicle)
    rest = np.zeros(len(legs))
    near = vertical.speed(np.full(len(legs), NEAR_M), 0.0)
    height = _Way(np.abs(up) - NEAR_M, rest, near, rest, NEAR_M)
    steep = vertical.seconds(height, np.where(up > 0, vehicle.climb_m_s, vehicle.descent_m_s))
    slower: Floats = np.maximum(flat, steep)
    return slower


@dataclass(frozen=True, slots=True)
class _Way:
    """Ways that end before their corners: length, first and last speed, the speed of the corner, radius."""

    length: Floats
    start: Floats
    arrival: Floats
    corner: Floats
    radius: float


class _Braking:
    """How PX4 brakes: v^2 + b v = 2 a d + w^2, with b = 4 a^2 / j."""

    def __init__(self, acceleration_m_s2: float, vehicle: Vehicle) -> None:
        self.acceleration = acceleration_m_s2
        self.delay = 4 * acceleration_m_s2**2 / vehicle.jerk_m_s3
        self.ramp = Ramp(acceleration_m_s2, vehicle.jerk_m_s3, vehicle.jerk_rise_s)

    def speed(self, distance_m: Floats, final_m_s: Floats | float) -> Floats:
        """Speed from which the vehicle brakes to a final one within a distance."""
        under = self.delay**2 + 8 * self.acceleration * distance_m + 4 * np.square(final_m_s)
        speeds: Floats = (np.sqrt(under) - self.delay) / 2
        return speeds

    def seconds(self, way: _Way, speeds: Floats) -> Floats:
        """Time of ways: speeding up, going on, and braking."""
        a, b = self.acceleration, self.delay

        def used(v: Floats) -> Floats:
            braking = np.maximum((v * v + b * v - way.corner**2) / (2 * a) - way.radius, 0.0) * (
                v > way.arrival
            )
            total: Floats = self.ramp.seconds(np.maximum(v - way.start, 0.0)) * (v + way.start) / 2 + braking
            return total

        least = np.maximum(way.start, way.arrival)
        top = largest(lambda v: used(v) <= way.length, least, np.maximum(speeds, way.arrival))
        seconds = self.ramp.seconds(np.maximum(top - way.start, 0.0))
        seconds += np.maximum(way.length - used(top), 0.0) / top
        seconds += (top - way.arrival) / a + b / (2 * a) * np.log(top / way.arrival)
        found: Floats = np.where(way.length > 0, seconds, 0.0)
        return found


def _turns(straight: Floats, speed: Floats, ramp: Ramp) -> tuple[Floats, Floats]:
    """Time in which the velocity turns at a constant speed, and the way along the next leg meanwhile.

    With an angle t the velocity changes by 2 v sin(t / 2), and half of it is along v cos(t / 2).
    """
    seconds = ramp.seconds(2 * speed * np.sqrt((1 - straight) / 2))
    way: Floats = seconds * speed * (1 + straight) / 2
    return seconds, way


def _corner_speeds(straight: Floats, vehicle: Vehicle) -> Floats:
    """Speed of the circle that touches both legs at the acceptance radius."""
    with np.errstate(divide="ignore"):
        cotangent = np.sqrt(np.maximum(1 + straight, 0.0) / np.maximum(1 - straight, 0.0))
    speeds: Floats = np.sqrt(vehicle.corner_acceleration_m_s2 * vehicle.radius_m * cotangent)
    return speeds


def _cosines(legs: Floats) -> Floats:
    """Cosine of the angle between each leg and the next, over ground; 0 at a vertical one."""
    flat = legs[:, :2]
    norms = np.hypot(*flat.T)
    products = norms[:-1] * norms[1:]
    dots = (flat[:-1] * flat[1:]).sum(axis=1)
    cosines: Floats = np.zeros_like(dots)
    np.divide(dots, products, out=cosines, where=products > 0)
    np.clip(cosines, -1.0, 1.0, out=cosines)
    return cosines


_BY_TURNS = {"blend": _blended, "slow": _slowed}
