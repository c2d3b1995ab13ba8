"""Time of each leg of a flight without wind: acceleration, braking and corners as an autopilot flies them.

A change of speed with limited acceleration and jerk (S-curve) is symmetric: the acceleration rises, stays at
its limit where the change is large enough, and falls, so the mean speed is that of its ends (L. Biagiotti and
C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, section 3.4). The jerk itself
rises and falls within `jerk_rise_s`, like a raised cosine.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from uavseg.arrays import Bools, Floats
from uavseg.dataclass import dataclass
from uavseg.flight.mission.braked import braked_seconds
from uavseg.flight.mission.vehicle import Vehicle

HALVINGS = 30  # of an interval, in a search for a root: to a thousandth of a millionth of it


@dataclass(frozen=True, slots=True)
class Ramp:
    """Limits of a change of speed; the acceleration may be one for each leg, (n,)."""

    acceleration_m_s2: Floats | float
    jerk_m_s3: float
    jerk_rise_s: float

    def seconds(self, change_m_s: Floats) -> Floats:
        """Return the time of a change of speed.

        With acceleration a, jerk j and jerk rise r it is dv / a + a / j + r where a is reached, which is at
        dv >= a (a / j + r); else 2 (u + r), with u (u + r) j = dv.

        Examples
        --------
        >>> Ramp(2.0, 1.0, 0.0).seconds(np.array([0.0, 1.0, 10.0])).tolist()
        [0.0, 2.0, 7.0]
        """
        a, j, r = self.acceleration_m_s2, self.jerk_m_s3, self.jerk_rise_s
        rise = (np.sqrt(r * r + 4 * change_m_s / j) - r) / 2
        short = 2 * (rise + r)
        long = change_m_s / a + a / j + r
        seconds: Floats = np.where(change_m_s >= a * (a / j + r), long, short) * (change_m_s > 0)
        return seconds

    def start(self, seconds: Floats, speed_m_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Return distance, speed and acceleration at a time after the start, in the first half of the ramp.

        The acceleration is taken to rise linearly, in the time that the whole ramp needs.
        """
        a, j, r = self.acceleration_m_s2, self.jerk_m_s3, self.jerk_rise_s
        whole = self.seconds(speed_m_s)
        rise = np.maximum(np.minimum(a / j + r, whole / 2), 1e-9)
        peak = speed_m_s / np.maximum(whole - rise, 1e-9)
        early, late = np.minimum(seconds, rise), np.maximum(seconds - rise, 0.0)
        distance = peak * (early**3 / (6 * rise) + rise / 2 * late + late**2 / 2)
        speed = peak * (early**2 / (2 * rise) + late)
        return distance, speed, peak * early / rise


def _largest(fits: Callable[[Floats], Bools], low: Floats, high: Floats) -> Floats:
    """Return the largest values between low and high that fit, by bisection; low where none does."""
    top = fits(high)
    if top.all():
        return np.array(high, float)
    low, high = np.array(low, float), np.array(high, float)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = fits(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.where(top, high, low)


SHORTEST_M = 1e-3  # a leg that is shorter is not flown


def leg_seconds(
    xyz_m: Floats,
    speed_m_s: float | Floats,
    vehicle: Vehicle,
    stops: Bools | None = None,
    hold_s: Floats | None = None,
) -> Floats:
    """Compute the time of each leg of a path that is flown from rest to rest.

    There are n - 1 times; what is saved in a corner is shared by the legs before and after it. The corners
    `xyz_m`, (n, 3), are metres east, north and up; the speed over ground is one, or that of each leg. At
    `stops`, (n,), the vehicle stops, as for a hold; it always does at the first and the last. The wait
    `hold_s`, (n,), is not part of the result.

    With ``turns="blend"`` each leg is an S-curve from rest to rest, and the next one begins before it ends:
    as early as the middle of the turn lies within the radius of the corner, and neither speed nor
    acceleration exceed their limits there (ArduPilot, libraries/AP_Math/SCurve.cpp,
    advance_target_along_track).

    With ``turns="slow"`` the speed at a distance from a corner is limited by braking to the speed of the
    corner, and the trajectory is integrated in steps (PX4, see `uavseg.flight.mission.braked`). A hold
    begins within the acceptance radius of its corner, and the vehicle is still moving then.

    Examples
    --------
    >>> from uavseg.flight.mission.vehicle import ARDUCOPTER
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
    hold = np.zeros(len(xyz)) if hold_s is None else np.asarray(hold_s, np.float64)
    flown = np.linalg.norm(legs, axis=1) > SHORTEST_M
    seconds = np.zeros(len(legs))
    if flown.any():
        index = np.flatnonzero(flown)  # a corner of several equal points stops if one of them does
        groups = list(pairwise([0, *(index + 1).tolist(), len(xyz)]))
        kept = np.array([stop[first:end].any() for first, end in groups])
        if vehicle.turns == "blend":
            seconds[flown] = _blended(legs[flown], speeds[flown], vehicle, kept)
        else:
            held = np.array([hold[first:end].sum() for first, end in groups])
            corners = xyz[[0, *(index + 1)]]
            seconds[flown] = braked_seconds(corners, speeds[flown], vehicle, kept, held)
    return seconds


def _blended(legs: Floats, speeds: Floats, vehicle: Vehicle, stops: Bools) -> Floats:
    """Return the time of S-curves from rest to rest, less the time by which each overlaps with the next."""
    length = np.linalg.norm(legs, axis=1)
    flat, up = np.hypot(legs[:, 0], legs[:, 1]), legs[:, 2]
    vertical = np.where(up > 0, vehicle.climb_m_s, vehicle.descent_m_s)
    limit = length * _slower(speeds, flat, vertical, np.abs(up))
    accelerations = (vehicle.acceleration_m_s2, vehicle.vertical_acceleration_m_s2)
    level, upward = (np.full(len(legs), one) for one in accelerations)
    acceleration = length * _slower(level, flat, upward, np.abs(up))
    ramp = Ramp(acceleration, vehicle.jerk_m_s3, vehicle.jerk_rise_s)
    speed = _largest(lambda v: v * ramp.seconds(v) <= length, np.full(len(legs), 1e-6), limit)
    seconds: Floats = ramp.seconds(speed) + length / speed
    overlap = np.where(stops[1:-1], 0.0, _overlaps(legs / length[:, None], speed, limit, ramp, vehicle))
    seconds[:-1] -= overlap / 2
    seconds[1:] -= overlap / 2
    return seconds


def _slower(along: Floats, flat: Floats, vertical: Floats, height: Floats) -> Floats:
    """Return a limit along a slope, in slope lengths: by its horizontal part, or by its vertical part."""
    with np.errstate(divide="ignore"):
        slower: Floats = np.minimum(along / flat, vertical / height)
    return slower


def _overlaps(directions: Floats, speed: Floats, limit: Floats, ramp: Ramp, vehicle: Vehicle) -> Floats:
    """Return the time by which each leg overlaps with the next."""
    if len(speed) < 2:
        return np.zeros(0)
    before, after = directions[:-1], directions[1:]
    accelerations = np.asarray(ramp.acceleration_m_s2)
    first = replace(ramp, acceleration_m_s2=accelerations[:-1])
    second = replace(ramp, acceleration_m_s2=accelerations[1:])
    slowest = np.minimum(limit[:-1], limit[1:])

    def fits(overlap: Floats) -> Bools:
        half = overlap / 2
        before_m, speed_in, braking = first.start(half, speed[:-1])
        after_m, speed_out, accelerating = second.start(half, speed[1:])
        offset = after_m[:, None] * after - before_m[:, None] * before
        velocity = speed_out[:, None] * after + speed_in[:, None] * before
        turning = (accelerating[:, None] * after - braking[:, None] * before)[:, :2]
        inside: Bools = np.linalg.norm(offset, axis=1) <= vehicle.radius_m
        inside &= np.linalg.norm(velocity, axis=1) <= slowest * (1 + 1e-6)
        inside &= np.linalg.norm(turning, axis=1) <= vehicle.corner_acceleration_m_s2
        return inside

    longest = np.minimum(first.seconds(speed[:-1]), second.seconds(speed[1:]))
    return _largest(fits, np.zeros(len(longest)), longest)
