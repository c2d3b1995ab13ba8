"""Terrain following: heights of waypoints above the ground of a DEM, added points, speeds, the path home."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_RELATIVE, FRAME_TERRAIN, HomePosition
from uavseg.flight.mission.mission import Ground
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.params.terrain import FRAME, RELATIVE, TerrainParams
from uavseg.flight.terrain.altitude_profile import GAP, AltitudeProfile, fly_over
from uavseg.flight.terrain.leg_speeds import speeds_of
from uavseg.flight.terrain.notes import ONBOARD_TERRAIN, terrain_notes
from uavseg.flight.terrain.profile import GroundProfile, check_known, profile_along
from uavseg.raster.elevation.dem import Dem

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DECIMALS = 8  # of degrees: a millimetre
NOTED_M = 10.0  # a larger difference is reported: satellite heights and most models are better than that
REFUSED_M = 50.0  # a larger one is refused: as large as the distance of geoid and ellipsoid in many places


@dataclass(frozen=True, slots=True, eq=False)
class WaypointHeights:
    """Heights and speeds of n waypoints."""

    frame: int  # MAV_FRAME: 0 above the sea, 3 above home, 10 above the terrain
    height_m: Floats  # above what `frame` says, (n,)
    takeoff_m: float  # height above home to which the vehicle climbs first
    added: NDArray[np.bool_]  # on a leg, for its height alone: photographs continue there, (n,)
    speed_m_s: Floats  # on the leg to each waypoint, (n,)


def constant_height(track: Track, params: PlanParams, frame: int = FRAME_RELATIVE) -> WaypointHeights:
    """Return one height for the waypoints of a track, (n, 2), above what `frame` (MAV_FRAME) says."""
    count, height = len(track.xy), float(params.altitude_m)
    return WaypointHeights(
        frame=frame,
        height_m=np.full(count, height),
        takeoff_m=height,
        added=np.zeros(count, np.bool_),
        speed_m_s=speeds_of(track, params),
    )


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

    Parameters
    ----------
    track : Track
        Places as longitude and latitude in degrees.
    home : HomePosition
    params : PlanParams

    Raises
    ------
    MissionError
        If the DEM does not cover the flight, or heights above home would not be above it.
    """
    terrain = params.terrain
    if terrain is None:
        return GroundPath(track, constant_height(track, params))
    if terrain.dem is None:
        heights = constant_height(track, params, FRAME_TERRAIN)
        return GroundPath(track, heights, notes=(ONBOARD_TERRAIN,))
    lon, lat = track.xy.T
    path_lon, path_lat = (np.round(np.append(*both), DECIMALS) for both in ((home.lon, lon), (home.lat, lat)))
    speeds = speeds_of(track, params)
    flight = fly_over(terrain.dem, path_lon, path_lat, params, speeds)
    tolerance_m = terrain.tolerance_for(params.altitude_m)
    back = profile_along(terrain.dem, path_lon[[-1, 0]], path_lat[[-1, 0]], GAP * tolerance_m)
    over_back = flight.target_m[-1] - np.concatenate([back.lower_m, back.upper_m])
    leads_home = bool(np.abs(over_back - params.altitude_m).max() > tolerance_m)
    if leads_home:
        path_lon, path_lat = np.append(path_lon, path_lon[0]), np.append(path_lat, path_lat[0])
        flight = fly_over(terrain.dem, path_lon, path_lat, params, np.append(speeds, params.speed_m_s))
        track = Track.joined([track, Track.transit(np.array([track.xy[-1], (home.lon, home.lat)]))])
        over_back = over_back[:0]
    heights, kept = _heights(flight, params, terrain)
    leg = np.searchsorted(flight.ground.corners[1:], kept)  # the first one leads from home to the path
    places = np.column_stack(
        [np.round(flight.ground.lon[kept], DECIMALS), np.round(flight.ground.lat[kept], DECIMALS)]
    )
    track = _with_added(track, places, heights.added, leg)
    notes = terrain_notes(
        flight, int(heights.added.sum()), heights.speed_m_s, speeds_of(track, params), params, leads_home
    )
    ground = _ground(terrain.dem, home, places, flight, over_back, params)
    return GroundPath(track=track, heights=heights, ground=ground, notes=tuple(notes))


def _with_added(track: Track, places: Floats, added: NDArray[np.bool_], leg: Ints) -> Track:
    """Add points to the legs of a track; what is done on a leg continues there.

    Parameters
    ----------
    track : Track
    places : (n, 2) float64 array
        Of all corners, in degrees.
    added : (n,) bool array
        Which of them are not corners of the track.
    leg : (n,) int64 array
        The leg to each corner: 0 leads from home, and 1 is the track's first.
    """
    speed, leg = track.speed_m_s[leg], leg[1:]
    whole = Track.joined([Track.transit(track.xy[[0, 0]]), track])
    hold_s, shots = np.zeros(len(places)), np.zeros(len(places), bool)
    hold_s[~added], shots[~added] = track.hold_s, track.shots
    return Track(places, whole.trigger_m[leg], whole.is_line[leg], hold_s, shots, whole.look_at[leg], speed)


def _heights(
    flight: AltitudeProfile, params: PlanParams, terrain: TerrainParams
) -> tuple[WaypointHeights, Ints]:
    """Return heights of the waypoints, and the samples at which they are."""
    kept, speed = flight.chosen[1:], flight.speed_m_s
    is_corner = np.isin(kept, flight.ground.corners)
    home_m = flight.ground.upper_m[0]
    frame, takeoff_m = FRAME_AMSL, float(flight.target_m[0] - home_m)
    if terrain.mode == FRAME:  # the vehicle follows the ground itself: points are where the speed changes
        turns = is_corner | np.append(np.diff(speed) != 0, False)
        kept, is_corner, speed = kept[turns], is_corner[turns], speed[turns]
        frame, takeoff_m = FRAME_TERRAIN, float(params.altitude_m)
        height = np.full(len(kept), takeoff_m)
    else:
        height = flight.target_m[kept]
        if terrain.mode == RELATIVE:
            frame, height = FRAME_RELATIVE, height - home_m
            _check_above_home(flight.ground, kept, height)
        height = np.round(height, 3)
    heights = WaypointHeights(
        frame=frame, height_m=height, takeoff_m=takeoff_m, added=~is_corner, speed_m_s=speed
    )
    return heights, kept


def _check_above_home(ground: GroundProfile, kept: Ints, height_m: Floats) -> None:
    lowest = int(np.argmin(height_m))
    if height_m[lowest] < 1.0:
        k = kept[lowest]
        raise MissionError(
            f"the flight would be {-height_m[lowest]:.0f} m below home at lat {ground.lat[k]:.6f}, lon "
            f"{ground.lon[k]:.6f}, and heights above home are above 0: give --terrain absolute, or a home "
            "that is lower"
        )


def _ground(
    dem: Dem,
    home: HomePosition,
    places: Floats,
    flight: AltitudeProfile,
    over_back: Floats,
    params: PlanParams,
) -> Ground:
    lon, lat = places.T
    heights = dem.heights_m(lon, lat).tolist()
    below = dict(zip(zip(lat.tolist(), lon.tolist(), strict=True), heights, strict=True))
    below[home.lat, home.lon] = float(flight.ground.upper_m[0])
    assert params.terrain is not None
    if params.terrain.mode == FRAME:
        return Ground(below, params.altitude_m, params.altitude_m)
    height_m = flight.height_m
    lowest = np.append(height_m - flight.ground.upper_m, over_back).min()
    highest = np.append(height_m - flight.ground.lower_m, over_back).max()
    return Ground(below, float(lowest), float(highest))


def home_on_ground(home: tuple[float, ...], params: PlanParams) -> tuple[tuple[float, ...], list[str]]:
    """Return home with the height of its ground above the sea, from the DEM where none is given; and notes.

    Parameters
    ----------
    home : (lat, lon) or (lat, lon, altitude_m)
    params : PlanParams

    Raises
    ------
    MissionError
        If the DEM has no height at home, or one that differs by more than 50 m, or by more than half of the
        height of the flight, from the given one (differences below 10 m aside).
    """
    terrain = params.terrain
    if terrain is None or terrain.dem is None:
        return home, []
    lon, lat = np.array([home[1]]), np.array([home[0]])
    height_m = terrain.dem.heights_m(lon, lat)
    check_known(terrain.dem, lon, lat, height_m)
    ground_m = round(float(height_m[0]), 2)
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
