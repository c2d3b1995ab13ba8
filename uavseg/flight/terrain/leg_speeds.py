"""Speed of each leg: what the camera allows where photographs are taken, and the mission's speed elsewhere.

Each change of speed is a mission item, and must save time. Which legs share a speed is a shortest path over
the legs, from each possible change to the next (segmentation by dynamic programming: R. Bellman, On the
approximation of curves by line segments using dynamic programming, 1961).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavseg.arrays import Floats
from uavseg.flight.mission.duration import ramp_seconds
from uavseg.flight.mission.track import Track, leg_lengths
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import PlanParams

CHANGE_S = 5.0  # what a change of speed must save, and what speeding up and slowing down take
LONGEST_RUN = 1000  # limits that one speed may be for
SHORT_M = 5.0  # a leg of which less would be left is slow as a whole


def with_speeds(track: Track, home: Floats, params: PlanParams) -> Track:
    """Give a track the speed of each leg, and add points where the vehicle slows down for a line.

    The speed is low from the first photograph on: the point lies as far before the line as the vehicle needs
    to slow down. A shorter leg is slow as a whole.

    The track, in metres, has no repeated corners, and `home` (2,) is where the leg to the first one starts.
    Where no photograph limits the speed, it is returned as it is.
    """
    limit = _limits_m_s(track, params)
    if (limit >= params.speed_m_s).all():
        return track
    whole = Track.joined([Track.transit(np.array([home, track.xy[0]])), track])
    length = leg_lengths(whole.xy)
    limit = np.minimum(np.append(np.inf, limit), params.speed_m_s)
    speed = _fewest_changes(limit, length)
    splits = _slow_down(whole, speed, length, params)
    parts, speeds, first = [], [], 0
    for leg, share in splits:
        start, end = whole.xy[leg : leg + 2]
        middle = start + share * (end - start)
        parts += [whole.part(first, leg), whole.leg(leg, np.array([start, middle]))]
        parts.append(whole.leg(leg, np.array([middle, end])))
        speeds += [speed[first : leg + 1], speed[leg + 1 : leg + 2]]
        first = leg + 1
    parts.append(whole.part_from(first))
    return replace(Track.joined(parts).part_from(1), speed_m_s=np.concatenate([*speeds, speed[first:]]))


def fewest_changes(track: Track, params: PlanParams) -> Floats:
    """Return the speed of each leg of a track, (n - 1,), before points are added to slow down."""
    return _fewest_changes(np.minimum(_limits_m_s(track, params), params.speed_m_s), leg_lengths(track.xy))


def speeds_of(track: Track, params: PlanParams) -> Floats:
    """Return the speed on the leg to each corner, (n,): that of the mission where the track sets none."""
    return np.where(np.isnan(track.speed_m_s), params.speed_m_s, track.speed_m_s)


def speed_notes(tracks: Sequence[Track], params: PlanParams) -> list[str]:
    """Return a note where photographs limit the speed of tracks."""
    limits = np.concatenate([_limits_m_s(track, params) for track in tracks])
    photos = params.photos
    if photos is None or not (limits < params.speed_m_s).any():
        return []
    flown = np.concatenate([speeds_of(track, params)[1:] for track in tracks])
    low, high = (f"{bound:.2f}" for bound in (flown[limits < np.inf].min(), flown[limits < np.inf].max()))
    interval = f"{photos.camera.name} needs {photos.camera.min_interval_s:g} s between photographs, and "
    others = f"; ways of some length are flown at {params.speed_m_s:g} m/s"
    return [
        f"the speed of photographed lines is lowered from {params.speed_m_s:g} m/s to "
        f"{low if low == high else f'{low} to {high}'} m/s: "
        f"{interval * bool(photos.camera.min_interval_s)}more speed would blur them at "
        f"1/{1 / photos.shutter_s:.0f} s{others * bool((flown == params.speed_m_s).any())}"
    ]


def _limits_m_s(track: Track, params: PlanParams) -> Floats:
    """Return the highest speed on each leg at which its photographs are taken and sharp, else infinity."""
    photos, legs = params.photos, len(track.is_line)
    if photos is None or params.pattern == "visit":
        return np.full(legs, np.inf)
    triggers = track.trigger_m
    if photos.trigger == "none":  # the pilot triggers the camera
        triggers = np.where(track.is_line, photos.trigger_m(params.altitude_m), 0.0)
    limits = {
        trigger: photos.max_speed_m_s(params.altitude_m, trigger) if trigger > 0 else np.inf
        for trigger in set(triggers.tolist())
    }
    return np.array([limits[trigger] for trigger in triggers.tolist()], np.float64)


def _fewest_changes(limit: Floats, length: Floats) -> Floats:
    """Choose the speeds within their limits that take the minimum time, with the time of changes."""
    first = np.flatnonzero(np.append(True, np.diff(limit) != 0))
    limits, lengths = limit[first], np.add.reduceat(length, first)
    count = len(first)
    best, start = np.append(0.0, np.full(count, np.inf)), np.zeros(count + 1, np.int64)
    for last in range(count):
        low = max(0, last + 1 - LONGEST_RUN)
        run = slice(low, last + 1)
        total = np.cumsum(lengths[run][::-1])[::-1] / np.minimum.accumulate(limits[run][::-1])[::-1]
        cost = best[low : last + 1] + total + CHANGE_S * (np.arange(low, last + 1) > 0)
        choice = int(cost.argmin())
        best[last + 1], start[last + 1] = cost[choice], low + choice
    speed = np.empty(count)
    stop = count
    while stop:
        run = slice(int(start[stop]), stop)
        speed[run] = limits[run].min()
        stop = run.start
    return np.repeat(speed, np.diff(np.append(first, len(limit))))


def _slow_down(track: Track, speed: Floats, length: Floats, params: PlanParams) -> list[tuple[int, float]]:
    """Lower the speed before slower legs; return the legs that are slow at their end only, and from where."""
    vehicle = params.vehicle or default_vehicle(params.autopilot)
    ramp = vehicle.acceleration_m_s2, vehicle.jerk_m_s3, vehicle.jerk_rise_s
    is_photographed = np.isfinite(_limits_m_s(track, params))
    splits = []
    for slow in (np.flatnonzero(np.diff(speed) < 0) + 1).tolist():
        fast, low = float(speed[slow - 1]), float(speed[slow])
        left = ramp_seconds(fast - low, *ramp) * (fast + low) / 2 + vehicle.radius_m
        leg = slow - 1
        while leg >= 0 and left > 0 and speed[leg] == fast and not is_photographed[leg]:
            if length[leg] - left >= SHORT_M:
                splits.append((leg, 1 - left / float(length[leg])))
                break
            left -= float(length[leg])
            speed[leg] = low
            leg -= 1
    return splits
