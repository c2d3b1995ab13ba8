"""Heights and speeds along a track: waypoints above the ground of a DEM, added points, the path home.

The speed of each leg is what the camera allows where photographs are taken, and the mission's elsewhere. Each
change of speed is a mission item, and must save time. Which legs share a speed is a shortest path over the
legs, from each possible change to the next (segmentation by dynamic programming: R. Bellman, On the
approximation of curves by line segments using dynamic programming, 1961).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.duration import ramp_seconds
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.mission import Ground
from uavseg.flight.mission.track import OF_LEGS, Track, leg_lengths
from uavseg.flight.mission.vehicle import returning_vehicles
from uavseg.flight.params.plan import FRAME, RELATIVE, PlanParams, TerrainParams
from uavseg.flight.terrain import altitude_profile
from uavseg.flight.terrain.altitude_profile import AltitudeProfile, GroundProfile, fly_over, profile_along
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import geod_wgs84

ONBOARD_TERRAIN = (
    "heights are above the terrain that the vehicle itself knows (ArduPilot: TERRAIN_ENABLE 1, data of the "
    "place on board); give --dem to have slopes and the way home checked"
)
RETURN_SLACK_M = 1.0
RAISED_M = 0.05  # a smaller difference is not reported
STARTS = 250  # samples of the flight from which return paths are examined
SAMPLES = 250  # of each return path
NOTED_M = 10.0  # a larger difference is reported: satellite heights and most models are better than that
REFUSED_M = 50.0  # a larger one is refused: as large as the distance of geoid and ellipsoid in many places
CHANGE_S = 5.0  # what a change of speed must save, and what speeding up and slowing down take
LONGEST_RUN = 1000  # limits that one speed may be for
SHORT_M = 5.0  # a leg of which less would be left is slow as a whole


def terrain_notes(
    flight: AltitudeProfile,
    added: int,
    speed_m_s: Floats,
    requested_m_s: Floats,
    params: PlanParams,
    leads_home: bool,
) -> Iterator[str]:
    """Yield what the pilot of a flight over the ground should know.

    `added` is how many points were added on legs for their height, `leads_home` whether there are some for
    the path home. `speed_m_s` and `requested_m_s` (n,) are the speed on the leg to each waypoint, and the one
    where it is not too steep. `params` have a DEM.
    """
    terrain = params.terrain
    assert terrain is not None and terrain.dem is not None
    dem, ground_m = terrain.dem, float(flight.ground.upper_m[0])
    within = f"{params.altitude_m:g} m above the ground within {terrain.tolerance_for(params.altitude_m):g} m"
    points = f"{within}; {added} point{'s are' if added != 1 else ' is'} added where it bends"
    if terrain.mode == FRAME:
        yield (
            "heights are above the terrain that the vehicle itself knows (ArduPilot: TERRAIN_ENABLE 1, data "
            f"of the place on board), not above {dem.name}, by which only slopes and the way home are checked"
        )
    elif terrain.mode == RELATIVE:
        yield (
            f"heights are above home, whose ground ({ground_m:.1f} m) is that of {dem.name} too: {points}; "
            "take off there, a higher or lower place moves the whole flight"
        )
    else:
        yield (
            f"heights are above the sea, from {dem.name}: {points}; before takeoff, compare the vehicle's "
            f"own height above the sea with that of home ({ground_m:.1f} m), a difference moves the whole "
            "flight"
        )
    yield from dem.notes()
    yield from _slope_notes(flight, speed_m_s, requested_m_s, params)
    if leads_home:
        yield "waypoints lead home above the ground: a level return would be too low or too high somewhere"
    paths = _return_paths(dem, flight.ground)
    yield from _rise_notes(paths, flight.ground, params.altitude_m)
    yield from _early_return_notes(paths, flight, params)


def _slope_notes(
    flight: AltitudeProfile, speed_m_s: Floats, requested_m_s: Floats, params: PlanParams
) -> Iterator[str]:
    terrain, ground = params.terrain, flight.ground
    assert terrain is not None
    climb, descent = altitude_profile.rates_m_s(params)
    slow = speed_m_s < requested_m_s
    if slow.any():
        legs, speed = int(slow.sum()), float(speed_m_s[slow].min())
        yield (
            f"the speed is lowered on {legs} leg{'s' * (legs != 1)}, down to {speed:g} m/s, where the ground "
            f"is too steep for {float(requested_m_s[slow].max()):g} m/s with a climb of {climb:g} and a "
            f"descent of {descent:g} m/s"
        )
    raised = flight.target_m - params.altitude_m - ground.upper_m
    k = int(raised.argmax())
    if raised[k] > RAISED_M:
        place = f"lat {ground.lat[k]:.6f}, lon {ground.lon[k]:.6f}"
        if terrain.mode == FRAME:
            yield f"the ground at {place} is steeper than the vehicle climbs or descends: it may come nearer"
        else:
            yield (
                f"the flight is up to {raised[k]:.1f} m higher above the ground, at {place}, next to ground "
                "that is steeper than the vehicle climbs or descends"
            )


@dataclass(frozen=True, slots=True, eq=False)
class _ReturnPaths:
    """Ground on straight paths to home, from n samples of a flight."""

    # The ground on the flight itself is known exactly, that on these paths at k evenly spaced samples, from
    # home on; NaN where it is not known.
    start: Integers  # samples of the flight, (n,)
    length_m: Floats  # (n,)
    lon: Floats  # (k, n)
    lat: Floats  # (k, n)
    ground_m: Floats  # (k, n)


def _return_paths(dem: Dem, ground: GroundProfile) -> _ReturnPaths:
    start = np.unique(np.linspace(0, len(ground.lon) - 1, STARTS).astype(np.int64))
    lon, lat = ground.lon[start], ground.lat[start]
    geod = geod_wgs84()
    azimuth, _, length = geod.inv(
        np.full_like(lon, ground.lon[0]), np.full_like(lat, ground.lat[0]), lon, lat
    )
    shape = (SAMPLES, len(start))
    away = [np.broadcast_to(part, shape).ravel() for part in (ground.lon[0], ground.lat[0], azimuth)]
    path_lon, path_lat, _ = geod.fwd(*away, (np.linspace(0, 1, SAMPLES)[:, None] * length).ravel())
    return _ReturnPaths(
        start=start,
        length_m=length,
        lon=path_lon.reshape(shape),
        lat=path_lat.reshape(shape),
        ground_m=dem.heights_m(path_lon, path_lat).reshape(shape),
    )


def _rise_notes(paths: _ReturnPaths, ground: GroundProfile, altitude_m: float) -> Iterator[str]:
    """Yield how far the ground rises above home between the flight and home."""
    is_unknown = np.isnan(paths.ground_m)
    height_m = np.append(ground.upper_m, np.where(is_unknown, -np.inf, paths.ground_m))
    k = int(height_m.argmax())
    above_home = float(height_m[k] - ground.upper_m[0])
    if above_home > 0.1 * altitude_m:
        lat, lon = (np.append(*both)[k] for both in ((ground.lat, paths.lat), (ground.lon, paths.lon)))
        yield (
            f"on straight ways from the flight to home the ground rises to {above_home:.0f} m above home, at "
            f"lat {lat:.6f}, lon {lon:.6f}: for a return that starts early, set the autopilot's "
            f"return altitude (RTL_ALT, RTL_RETURN_ALT) to {np.ceil(above_home + altitude_m):.0f} m at least"
        )
    if is_unknown.any():
        yield (
            "the elevation model has holes between the flight and home: returns that start early are not "
            "checked there"
        )


def _early_return_notes(paths: _ReturnPaths, flight: AltitudeProfile, params: PlanParams) -> Iterator[str]:
    """Yield from where a level return, after a climb, would be too low or too high above the ground."""
    assert params.terrain is not None
    minimum_m = params.altitude_m - params.terrain.tolerance_for(params.altitude_m)
    maximum_m = params.safety.max_altitude_m
    height_m = flight.height_m[paths.start]
    above = []
    for vehicle in returning_vehicles(params.vehicle, params.autopilot):
        climbed = np.minimum(vehicle.return_height_m, vehicle.return_slope * paths.length_m)
        above.append(np.maximum(height_m, float(flight.ground.upper_m[0]) + climbed) - paths.ground_m)
    lowest, highest = np.nanmin(above, axis=1), np.nanmax(above, axis=1)  # of each vehicle and path
    low, high = int(np.nanargmin(lowest)), int(np.nanargmax(highest))
    places = [
        f"lat {flight.ground.lat[k]:.6f}, lon {flight.ground.lon[k]:.6f}"
        for k in paths.start[[low % len(paths.start), high % len(paths.start)]]
    ]
    lowest_m, highest_m = float(lowest.flat[low]), float(highest.flat[high])
    if lowest_m < minimum_m - RETURN_SLACK_M:
        near = f"comes within {lowest_m:.0f} m of" if lowest_m > 0 else "leads into"
        yield (
            f"a return that starts early is level: from {places[0]} it "
            f"{near} the ground at the usual return altitude; set it higher"
        )
    if highest_m > maximum_m + RETURN_SLACK_M:
        yield (
            f"a return that starts early is level: from {places[1]} it leads "
            f"{highest_m:.0f} m above lower ground, and {maximum_m:g} m are allowed (--max-altitude)"
        )


@dataclass(frozen=True, slots=True, eq=False)
class WaypointHeights:
    """Heights and speeds of n waypoints."""

    frame: int  # MAV_FRAME: 0 above the sea, 3 above home, 10 above the terrain
    height_m: Floats  # above what `frame` says, (n,)
    takeoff_m: float  # height above home to which the vehicle climbs first
    added: Bools  # on a leg, for its height alone: photographs continue there, (n,)
    speed_m_s: Floats  # on the leg to each waypoint, (n,)


def constant_height(track: Track, params: PlanParams, frame: int = mav.FRAME_RELATIVE) -> WaypointHeights:
    """Return one height for the waypoints of a track, (n, 2), above what `frame` (MAV_FRAME) says."""
    count, height = len(track.xy), float(params.altitude_m)
    heights, added = np.full(count, height), np.zeros(count, np.bool_)
    speeds = speeds_of(track, params)
    return WaypointHeights(frame=frame, height_m=heights, takeoff_m=height, added=added, speed_m_s=speeds)


@dataclass(frozen=True, slots=True, eq=False)
class GroundPath:
    """Path in longitude and latitude with heights, and with the points that were added for them."""

    track: Track
    heights: WaypointHeights
    ground: Ground | None = None  # where a DEM is known
    notes: tuple[str, ...] = ()  # for the pilot


def follow_ground(track: Track, home: HomePosition, params: PlanParams) -> GroundPath:
    """Give a path a constant height: above home, or above the ground as `params.terrain` says.

    At each place of the flight, takeoff and return aside, its height above the bilinear surface of the DEM
    differs from `params.altitude_m` by the tolerance at most; before and after ground that is too steep to
    follow at 1 m/s it may be more, never less. Legs that are too steep for the speed are flown slower. Where
    a straight return at the height of the last point would leave the tolerance, the path leads home.

    The places of the track are longitude and latitude in degrees. A MissionError says that the DEM does not
    cover the flight, or that heights above home would not be above it.
    """
    terrain = params.terrain
    if terrain is None:
        return GroundPath(track, constant_height(track, params))
    if terrain.dem is None:
        return GroundPath(track, constant_height(track, params, mav.FRAME_TERRAIN), notes=(ONBOARD_TERRAIN,))
    lon, lat = track.xy.T
    path_lon, path_lat = np.round([np.append(home.lon, lon), np.append(home.lat, lat)], mav.DEGREE_DECIMALS)
    speeds = speeds_of(track, params)
    flight = fly_over(terrain.dem, path_lon, path_lat, params, speeds)
    tolerance_m = terrain.tolerance_for(params.altitude_m)
    gap_m = altitude_profile.GAP * tolerance_m
    back = profile_along(terrain.dem, path_lon[[-1, 0]], path_lat[[-1, 0]], gap_m)
    over_back = flight.target_m[-1] - np.concatenate([back.lower_m, back.upper_m])
    leads_home = bool(np.abs(over_back - params.altitude_m).max() > tolerance_m)
    if leads_home:
        path_lon, path_lat = np.append(path_lon, path_lon[0]), np.append(path_lat, path_lat[0])
        flight = fly_over(terrain.dem, path_lon, path_lat, params, np.append(speeds, params.speed_m_s))
        track = Track.joined([track, Track.transit(np.array([track.xy[-1], (home.lon, home.lat)]))])
        over_back = over_back[:0]
    heights, kept = _heights(flight, params, terrain)
    leg = np.searchsorted(flight.ground.corners[1:], kept)  # the first one leads from home to the path
    places = np.round(np.column_stack([flight.ground.lon, flight.ground.lat])[kept], mav.DEGREE_DECIMALS)
    # `places` (n, 2) are those of all corners, in degrees; `added` (n,) says which of them are not corners of
    # the track. `leg` (n,) is the leg to each corner: 0 leads from home, and 1 is the track's first.
    speed, leg = track.speed_m_s[leg], leg[1:]
    whole = Track.joined([Track.transit(track.xy[[0, 0]]), track])
    hold_s, shots = np.zeros(len(places)), np.zeros(len(places), bool)
    hold_s[~heights.added], shots[~heights.added] = track.hold_s, track.shots
    legs = {name: getattr(whole, name)[leg] for name in OF_LEGS}
    track = Track(xy=places, hold_s=hold_s, shots=shots, speed_m_s=speed, **legs)
    added, flown = int(heights.added.sum()), heights.speed_m_s
    notes = terrain_notes(flight, added, flown, speeds_of(track, params), params, leads_home)
    ground = _ground(home, places, flight, over_back, params)
    return GroundPath(track=track, heights=heights, ground=ground, notes=tuple(notes))


def _heights(
    flight: AltitudeProfile, params: PlanParams, terrain: TerrainParams
) -> tuple[WaypointHeights, Integers]:
    """Return heights of the waypoints, and the samples at which they are."""
    kept, speed = flight.chosen[1:], flight.speed_m_s
    is_corner = np.isin(kept, flight.ground.corners)
    home_m = flight.ground.upper_m[0]
    frame, takeoff_m = mav.FRAME_AMSL, float(flight.target_m[0] - home_m)
    if terrain.mode == FRAME:  # the vehicle follows the ground itself: points are where the speed changes
        turns = is_corner | np.append(np.diff(speed) != 0, False)
        kept, is_corner, speed = kept[turns], is_corner[turns], speed[turns]
        frame, takeoff_m = mav.FRAME_TERRAIN, float(params.altitude_m)
        height = np.full(len(kept), takeoff_m)
    else:
        height = flight.target_m[kept]
        if terrain.mode == RELATIVE:
            frame, height = mav.FRAME_RELATIVE, height - home_m
            _check_above_home(flight.ground, kept, height)
        height = np.round(height, 3)
    heights = WaypointHeights(
        frame=frame, height_m=height, takeoff_m=takeoff_m, added=~is_corner, speed_m_s=speed
    )
    return heights, kept


def _check_above_home(ground: GroundProfile, kept: Integers, height_m: Floats) -> None:
    lowest = int(np.argmin(height_m))
    if height_m[lowest] < 1.0:
        k = kept[lowest]
        raise MissionError(
            f"the flight would be {-height_m[lowest]:.0f} m below home at lat {ground.lat[k]:.6f}, lon "
            f"{ground.lon[k]:.6f}, and heights above home are above 0: give --terrain absolute, or a home "
            "that is lower"
        )


def _ground(
    home: HomePosition, places: Floats, flight: AltitudeProfile, over_back: Floats, params: PlanParams
) -> Ground:
    assert params.terrain is not None and params.terrain.dem is not None
    heights = params.terrain.dem.heights_m(*places.T).tolist()
    below = dict(zip(map(tuple, places[:, ::-1].tolist()), heights, strict=True))
    below[home.lat, home.lon] = float(flight.ground.upper_m[0])
    if params.terrain.mode == FRAME:
        return Ground(below, params.altitude_m, params.altitude_m)
    lowest = np.append(flight.height_m - flight.ground.upper_m, over_back).min()
    highest = np.append(flight.height_m - flight.ground.lower_m, over_back).max()
    return Ground(below, float(lowest), float(highest))


def home_on_ground(home: tuple[float, ...], params: PlanParams) -> tuple[tuple[float, ...], list[str]]:
    """Return home with the height of its ground above the sea, from the DEM where none is given; and notes.

    `home` is (lat, lon) or (lat, lon, altitude_m). A MissionError says that the DEM has no height there, or
    one that differs by more than 50 m, or by more than half of the height of the flight, from the given one
    (differences below 10 m aside).
    """
    terrain = params.terrain
    if terrain is None or terrain.dem is None:
        return home, []
    [height_m] = altitude_profile.known_heights_m(terrain.dem, np.array([home[1]]), np.array([home[0]]))
    ground_m = round(float(height_m), 2)
    if not terrain.dem.is_above_sea:
        return home, []
    if len(home) < 3:
        return (*home, ground_m), [
            f"the altitude of home is that of the ground in {terrain.dem.name}: {ground_m:.1f} m"
        ]
    differs_m = abs(home[2] - ground_m)
    heights = (
        f"home is given at {home[2]:g} m above the sea, and its ground in {terrain.dem.name} is at "
        f"{ground_m:g} m"
    )
    if differs_m > max(min(REFUSED_M, params.altitude_m / 2), NOTED_M):
        raise MissionError(
            f"{heights}: one of the two is wrong, in feet, or above the ellipsoid; leave the altitude of "
            "home out to take that of the elevation model"
        )
    return home, [f"{heights}: {differs_m:.0f} m apart"] if differs_m > NOTED_M else []


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
    vehicle = params.flown_by
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
