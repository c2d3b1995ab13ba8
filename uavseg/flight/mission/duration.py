"""Time of each leg of a flight without wind: acceleration, braking and corners as an autopilot flies them."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.braked import braked_seconds
from uavseg.flight.mission.ramps import Ramp, largest
from uavseg.flight.mission.vehicle import Vehicle

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SHORTEST_M = 1e-3  # a leg that is shorter is not flown


def leg_seconds(
    xyz_m: Floats,
    speed_m_s: float | Floats,
    vehicle: Vehicle,
    stops: Bools | None = None,
    hold_s: Floats | None = None,
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
    hold_s : (n,) float64 array, optional
        How long it waits at each corner; by default not at all. This time is not part of the result.

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
