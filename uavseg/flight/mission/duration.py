"""Time of each leg of a flight: acceleration, braking and corners as an autopilot flies them.

A change of speed with limited acceleration and jerk (S-curve) is symmetric: the acceleration rises, stays at
its limit where the change is large enough, and falls, so the mean speed is that of its ends (L. Biagiotti and
C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, section 3.4). The jerk itself
rises and falls within `jerk_rise_s`, like a raised cosine.
"""

import math

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats
from uavseg.flight.mission.vehicle import Vehicle, Wind

HALVINGS = 30  # of an interval, in a search for a root: to a thousandth of a millionth of it
STEP_S = 0.05
MAX_STEPS = 200_000
"""Of one leg; a vehicle with unusual limits that has not arrived by then is taken to fly on at its limits."""
NEAR_M = 0.8  # a height is reached within this distance: NAV_MC_ALT_RAD of PX4
AHEAD_M = 5.0
TURNING_M_S, TURNING_COSINE = 0.2, 0.98
"""The vehicle turns where it is faster, and its direction and that to the corner differ by more."""
AT_REST_M_S = 1e-3
BEHIND_S_PER_M_S = 0.01
"""The vehicle follows its trajectory late, and at sharp corners that waits: simulated, 0.1 s at 10 m/s."""
SHARP_COSINE = 0.4  # of the angle by which it turns there
SHORTEST_M = 1e-3  # a leg that is shorter is not flown
CALM = Wind(0.0, 0.0)


@inlined
def ramp_seconds(change_m_s, acceleration_m_s2, jerk_m_s3, jerk_rise_s):  # type: ignore[no-untyped-def]
    """Return the time of a change of speed.

    With acceleration a, jerk j and jerk rise r it is dv / a + a / j + r where a is reached, which is at
    dv >= a (a / j + r); else 2 (u + r), with u (u + r) j = dv.

    Examples
    --------
    >>> [ramp_seconds(change, 2.0, 1.0, 0.0) for change in (0.0, 1.0, 10.0)]
    [0.0, 2.0, 7.0]
    """
    if change_m_s <= 0:
        return 0.0
    whole = acceleration_m_s2 / jerk_m_s3 + jerk_rise_s
    if change_m_s >= acceleration_m_s2 * whole:
        return change_m_s / acceleration_m_s2 + whole
    return jerk_rise_s + math.sqrt(jerk_rise_s * jerk_rise_s + 4 * change_m_s / jerk_m_s3)


@inlined
def ramp_start(seconds, speed_m_s, acceleration_m_s2, jerk_m_s3, jerk_rise_s):  # type: ignore[no-untyped-def]
    """Return distance, speed and acceleration at a time after the start, in the first half of the ramp.

    The acceleration is taken to rise linearly, in the time that the whole ramp needs.
    """
    whole = ramp_seconds(speed_m_s, acceleration_m_s2, jerk_m_s3, jerk_rise_s)
    rise = max(min(acceleration_m_s2 / jerk_m_s3 + jerk_rise_s, whole / 2), 1e-9)
    peak = speed_m_s / max(whole - rise, 1e-9)
    early, late = min(seconds, rise), max(seconds - rise, 0.0)
    distance = peak * (early * early * early / (6 * rise) + rise / 2 * late + late * late / 2)
    return distance, peak * (early * early / (2 * rise) + late), peak * early / rise


def leg_seconds(
    xyz_m: Floats,
    speed_m_s: float | Floats,
    vehicle: Vehicle,
    stops: Bools | None = None,
    hold_s: Floats | None = None,
    wind: Wind = CALM,
) -> Floats:
    """Compute the time of each leg of a path that is flown from rest to rest.

    There are n - 1 times; what is saved in a corner is shared by the legs before and after it. The corners
    `xyz_m`, (n, 3), are metres east, north and up; the speed over ground is one, or that of each leg. At
    `stops`, (n,), the vehicle stops, as for a hold; it always does at the first and the last. The wait
    `hold_s`, (n,), is not part of the result. In a `wind`, which has a direction, a leg is flown no faster
    than the vehicle makes way against it; a MissionError says that it makes none.

    With ``turns="blend"`` each leg is an S-curve from rest to rest, and the next one begins before it ends:
    as early as the middle of the turn lies within the radius of the corner, and neither speed nor
    acceleration exceed their limits there (ArduPilot, libraries/AP_Math/SCurve.cpp,
    advance_target_along_track).

    With ``turns="slow"`` the speed at a distance from a corner is limited by braking to the speed of the
    corner, and the trajectory is integrated in steps (PX4, see `uavseg.flight.mission.duration`). A hold
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
    over_ground = wind.over_ground_m_s(legs[:, :2], vehicle.airspeed_m_s)
    speeds = np.minimum(np.asarray(speed_m_s, np.float64), over_ground)
    stop = np.zeros(len(xyz), bool) if stops is None else np.array(stops, bool)
    stop[[0, -1]] = True
    hold = np.zeros(len(xyz)) if hold_s is None else np.asarray(hold_s, np.float64)
    flown = np.linalg.norm(legs, axis=1) > SHORTEST_M
    seconds = np.zeros(len(legs))
    if flown.any():
        index = np.flatnonzero(flown)  # a corner of several equal points stops if one of them does
        place = np.concatenate([[0], index + 1])
        kept = np.logical_or.reduceat(stop, place)
        if vehicle.turns == "blend":
            seconds[flown] = _blended(legs[flown], speeds[flown], vehicle, kept)
        else:
            held = np.add.reduceat(hold, place)
            seconds[flown] = braked_seconds(xyz[place], speeds[flown], vehicle, kept, held)
    return seconds


def _blended(legs: Floats, speeds: Floats, vehicle: Vehicle, stops: Bools) -> Floats:
    """Return the time of S-curves from rest to rest, less the time by which each overlaps with the next."""
    length = np.linalg.norm(legs, axis=1)
    flat, up = np.hypot(legs[:, 0], legs[:, 1]), legs[:, 2]
    vertical = np.where(up > 0, vehicle.climb_m_s, vehicle.descent_m_s)
    with np.errstate(divide="ignore"):  # limits along a slope: by its horizontal part, or by its vertical one
        limit = length * np.minimum(speeds / flat, vertical / np.abs(up))
        acceleration = length * np.minimum(
            vehicle.acceleration_m_s2 / flat, vehicle.vertical_acceleration_m_s2 / np.abs(up)
        )
    corner = (vehicle.radius_m, vehicle.corner_acceleration_m_s2)
    limits = np.array([vehicle.jerk_m_s3, vehicle.jerk_rise_s, *corner])
    speed, seconds, stop = np.zeros(len(legs)), np.zeros(len(legs)), np.array(stops, np.bool_)
    _blend(legs / length[:, None], length, limit, acceleration, stop, limits, speed, seconds)
    return seconds


@inlined
def _fits(before, after, half_s, speeds, accelerations, slowest, limits):  # type: ignore[no-untyped-def]
    """Return whether two legs may overlap by twice a time: speed, acceleration and place are within limits.

    `before` and `after` are their directions; speeds and accelerations are pairs.
    """
    before_m, in_m_s, braking = ramp_start(half_s, speeds[0], accelerations[0], limits[0], limits[1])
    after_m, out_m_s, rising = ramp_start(half_s, speeds[1], accelerations[1], limits[0], limits[1])
    off2 = speed2 = turn2 = 0.0
    for axis in range(3):
        offset = after_m * after[axis] - before_m * before[axis]
        velocity = out_m_s * after[axis] + in_m_s * before[axis]
        turning = rising * after[axis] - braking * before[axis]
        off2 += offset * offset
        speed2 += velocity * velocity
        turn2 += turning * turning * (axis < 2)
    return (
        math.sqrt(off2) <= limits[2]
        and math.sqrt(speed2) <= slowest * (1 + 1e-6)
        and math.sqrt(turn2) <= limits[3]
    )


@kernel("void(f8[:,::1], f8[::1], f8[::1], f8[::1], b1[::1], f8[::1], f8[::1], f8[::1])")
def _blend(unit, length, limit, acceleration, stops, limits, speed, seconds):  # type: ignore[no-untyped-def]
    """Fill the speed that each leg reaches, and its time; limits are jerk, its rise, radius and acceleration.

    Roots are found by bisection.
    """
    jerk, rise = limits[0], limits[1]
    for k in range(len(length)):
        low, high = 1e-6, limit[k]
        if high * ramp_seconds(high, acceleration[k], jerk, rise) <= length[k]:
            low = high
        else:
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                if middle * ramp_seconds(middle, acceleration[k], jerk, rise) <= length[k]:
                    low = middle
                else:
                    high = middle
        speed[k] = low
        seconds[k] = ramp_seconds(low, acceleration[k], jerk, rise) + length[k] / low
    for k in range(len(length) - 1):
        if stops[k + 1]:
            continue
        speeds, accelerations = (speed[k], speed[k + 1]), (acceleration[k], acceleration[k + 1])
        slowest = min(limit[k], limit[k + 1])
        low, high = (
            0.0,
            min(
                ramp_seconds(speeds[0], accelerations[0], jerk, rise),
                ramp_seconds(speeds[1], accelerations[1], jerk, rise),
            ),
        )
        if _fits(unit[k], unit[k + 1], high / 2, speeds, accelerations, slowest, limits):
            low = high
        else:
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                if _fits(unit[k], unit[k + 1], middle / 2, speeds, accelerations, slowest, limits):
                    low = middle
                else:
                    high = middle
        seconds[k] -= low / 2
        seconds[k + 1] -= low / 2


def braked_seconds(xyz_m: Floats, speeds: Floats, vehicle: Vehicle, stops: Bools, hold_s: Floats) -> Floats:
    """Compute the time of each leg, without holds, of a path whose neighbouring corners differ.

    Parameters are arrays as of `leg_seconds`; a hold begins at the moment at which the vehicle is within the
    acceptance radius. The trajectory is integrated in steps. Every step has a target velocity: towards the
    corner, at a speed v from which the vehicle can still brake to the speed w of the corner,

        v^2 + 4 a^2 / j v = 2 a d + w^2, and v >= w

    with the distance d. With an angle t between the legs, w^2 = a' r / tan(t / 2): the circle with the
    acceleration a' that touches both legs at the acceptance radius r; and from w it can brake before the end
    of the next leg. While the velocity turns, the speed does not rise, and the vehicle aims at the place of
    the leg that is 5 m away. The velocity is followed with limited acceleration and jerk; the height changes
    at the same time, within separate limits (PX4, src/lib/motion_planning: PositionSmoothing.cpp,
    VelocitySmoothing.cpp, TrajectoryConstraints.hpp; src/lib/mathlib/math/TrajMath.hpp;
    src/modules/navigator/mission_block.cpp).
    """
    level = (vehicle.acceleration_m_s2, vehicle.jerk_m_s3, vehicle.corner_acceleration_m_s2, vehicle.radius_m)
    vertical = (vehicle.climb_m_s, vehicle.descent_m_s, vehicle.vertical_acceleration_m_s2)
    limits = np.array([*level, *vertical])
    arrays = [np.array(one, np.float64, order="C") for one in (xyz_m, speeds, hold_s)]
    seconds = np.zeros(len(xyz_m) - 1)
    _fly(arrays[0], arrays[1], np.array(stops, np.bool_), arrays[2], limits, seconds)
    unit = np.diff(arrays[0], axis=0)
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    waits = ((unit[:-1] * unit[1:]).sum(axis=1) < SHARP_COSINE) & ~np.asarray(stops)[1:-1]
    seconds[:-1] += BEHIND_S_PER_M_S * arrays[1][:-1] * waits
    return seconds


@inlined
def _length(x, y):  # type: ignore[no-untyped-def]
    return math.sqrt(x * x + y * y)


@inlined
def _braking_speed(distance, final, acceleration, jerk):  # type: ignore[no-untyped-def]
    """Return the speed from which the vehicle brakes to a final one within a distance."""
    b = 4 * acceleration * acceleration / jerk
    root = math.sqrt(b * b + 8 * acceleration * distance + 4 * final * final)
    return max((root - b) / 2, final)


@inlined
def _braking_distance(speed, final, acceleration, jerk):  # type: ignore[no-untyped-def]
    """Return the distance within which it brakes from one speed to another."""
    b = 4 * acceleration * acceleration / jerk
    return max((speed * speed + b * speed - final * final) / (2 * acceleration), 0.0)


@inlined
def _corner_speed(xyz, k, x, y, cruise, limits):  # type: ignore[no-untyped-def]
    """Return the speed at which corner k is passed by a vehicle that comes from (x, y)."""
    next_x, next_y = xyz[k + 1, 0] - xyz[k, 0], xyz[k + 1, 1] - xyz[k, 1]
    length = _length(next_x, next_y)
    if length < max(limits[3], 1e-3):
        return 0.0
    to_x, to_y = xyz[k, 0] - x, xyz[k, 1] - y
    product = _length(to_x, to_y) * length
    cosine = 0.0
    if product > 0:
        cosine = min(max((to_x * next_x + to_y * next_y) / product, -1.0), 1.0)
    circle = math.sqrt(limits[2] * limits[3] * math.sqrt((1 + cosine) / max(1 - cosine, 1e-12)))
    return min(circle, cruise, _braking_speed(length, 0.0, limits[0], limits[1]))


@inlined
def _place_ahead(xyz, k, x, y):  # type: ignore[no-untyped-def]
    """Return the step from (x, y) to the place of the leg to corner k that is 5 m away, or to the corner."""
    leg_x, leg_y = xyz[k, 0] - xyz[k - 1, 0], xyz[k, 1] - xyz[k - 1, 1]
    to_x, to_y = xyz[k, 0] - x, xyz[k, 1] - y
    length = _length(leg_x, leg_y)
    if length < 1e-6 or leg_x * to_x + leg_y * to_y < 0:
        return to_x, to_y
    unit_x, unit_y = leg_x / length, leg_y / length
    left = to_x * unit_x + to_y * unit_y  # from the nearest place of the leg to its end
    near_x, near_y = to_x - left * unit_x, to_y - left * unit_y
    ahead = math.sqrt(max(AHEAD_M * AHEAD_M - near_x * near_x - near_y * near_y, 0.0))
    return near_x + ahead * unit_x, near_y + ahead * unit_y


@inlined
def _acceleration(error, maximum, jerk):  # type: ignore[no-untyped-def]
    """Return the maximum acceleration that is back at 0 when an error of the velocity is corrected."""
    return min(maximum, math.sqrt(2 * jerk * error))


@inlined
def _steady_seconds(left, speed):  # type: ignore[no-untyped-def]
    if speed <= 0:
        return np.inf
    return max(left, 0.0) / speed


@kernel("void(f8[:,::1], f8[::1], b1[::1], f8[::1], f8[::1], f8[::1])")
def _fly(xyz, speeds, stops, hold_s, limits, seconds):  # type: ignore[no-untyped-def]
    level_max, jerk, radius, up_max = limits[0], limits[1], limits[3], limits[6]
    x, y, z = xyz[0, 0], xyz[0, 1], xyz[0, 2]
    vx, vy, vz, ax, ay, az = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    turning_speed = np.inf
    for k in range(1, xyz.shape[0]):
        spent, held, is_reached, is_flown = 0.0, 0.0, False, False
        for _ in range(MAX_STEPS):
            to_x, to_y, rise = xyz[k, 0] - x, xyz[k, 1] - y, xyz[k, 2] - z
            away, moving = _length(to_x, to_y), _length(vx, vy)
            is_reached = is_reached or (away < radius and abs(rise) < NEAR_M)
            is_at_rest = moving < AT_REST_M_S and abs(vz) < AT_REST_M_S
            if is_reached and (held >= hold_s[k] or is_at_rest):
                is_flown = True
                break

            # the target velocity
            corner = 0.0
            if not stops[k]:
                corner = _corner_speed(xyz, k, x, y, speeds[k - 1], limits)
            speed = min(speeds[k - 1], _braking_speed(away, corner, level_max, jerk))
            is_turning = (
                moving > TURNING_M_S
                and vx * to_x + vy * to_y < TURNING_COSINE * moving * away
                and away > radius
            )
            aim_x, aim_y = to_x, to_y
            if is_turning:
                speed = min(speed, turning_speed)
                aim_x, aim_y = _place_ahead(xyz, k, x, y)
            turning_speed = speed
            aim = max(_length(aim_x, aim_y), 1e-9)
            rate = limits[4]
            if rise < 0:
                rate = limits[5]
            climb = math.copysign(min(rate, _braking_speed(abs(rise), 0.0, up_max, jerk)), rise)
            change_x, change_y, change_z = speed * aim_x / aim - vx, speed * aim_y / aim - vy, climb - vz

            # a long distance at one velocity is one step, and so is a wait for the height
            step = STEP_S
            if moving > 0:
                step = min(step, max(away, radius) / (2 * moving))
            change, slack = _length(change_x, change_y), jerk * STEP_S * STEP_S
            is_steady = change <= slack and _length(ax, ay) <= jerk * STEP_S
            is_steady_up = abs(change_z) <= slack and abs(az) <= jerk * STEP_S
            if is_steady:
                vx, vy, ax, ay = vx + change_x, vy + change_y, 0.0, 0.0
            if is_steady_up:
                vz, az = climb, 0.0
            if is_steady and is_steady_up and not is_turning and not is_reached:
                level_s, climb_s = 0.0, 0.0
                if speed == speeds[k - 1]:
                    braking = max(_braking_distance(speed, corner, level_max, jerk), radius)
                    level_s = _steady_seconds(away - braking, speed)
                elif away < radius / 2:
                    level_s, vx, vy = np.inf, 0.0, 0.0
                if abs(climb) == rate:
                    braking = max(_braking_distance(rate, 0.0, up_max, jerk), NEAR_M)
                    climb_s = _steady_seconds(abs(rise) - braking, rate)
                elif abs(rise) < NEAR_M / 2:
                    climb_s, vz = np.inf, 0.0
                whole = min(level_s, climb_s)
                if step < whole < np.inf:
                    step = whole

            # one step towards it
            if is_reached:
                step = min(step, max(hold_s[k] - held, 1e-9))
                held += step
            else:
                spent += step
            if not is_steady:
                target = _acceleration(change, level_max, jerk) / max(change, 1e-12)
                add_x, add_y = target * change_x - ax, target * change_y - ay
                share = min(1.0, jerk * step / max(_length(add_x, add_y), 1e-12))
                ax, ay = ax + share * add_x, ay + share * add_y
                vx, vy = vx + ax * step, vy + ay * step
            if not is_steady_up:
                target = math.copysign(_acceleration(abs(change_z), up_max, jerk), change_z)
                az += min(max(target - az, -jerk * step), jerk * step)
                vz += az * step
            x, y, z = x + vx * step, y + vy * step, z + vz * step
        if not is_flown:
            level_s = _steady_seconds(_length(xyz[k, 0] - x, xyz[k, 1] - y), speeds[k - 1])
            spent += max(level_s, abs(xyz[k, 2] - z) / min(limits[4], limits[5]))
            x, y, z = xyz[k, 0], xyz[k, 1], xyz[k, 2]
            vx, vy, vz, ax, ay, az = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        seconds[k - 1] = spent
