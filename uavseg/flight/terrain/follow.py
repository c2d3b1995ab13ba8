"""Flight at a constant height above the ground: heights of waypoints, added points, speeds, the way home."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_RELATIVE, FRAME_TERRAIN, HomePosition
from uavseg.flight.mission.mission import Ground
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.params.terrain import FRAME, RELATIVE, TerrainParams
from uavseg.flight.terrain.flown import GAP, Flown, fly_over
from uavseg.flight.terrain.heights import Heights, constant_height
from uavseg.flight.terrain.leg_speeds import speeds_of
from uavseg.flight.terrain.notes import OWN_TERRAIN, terrain_notes
from uavseg.flight.terrain.profile import Profile, profile_along
from uavseg.raster.elevation.dem import Dem

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DECIMALS = 8  # of degrees: a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class GroundPath:
    """A path with heights.

    Parameters
    ----------
    track : Track
        Places as longitude and latitude in degrees, with the points that were added.
    heights : Heights
    ground : Ground, optional
        None where no DEM is known.
    notes : tuple of str
        For the pilot.
    """

    track: Track
    heights: Heights
    ground: Ground | None = None
    notes: tuple[str, ...] = ()


def follow_ground(track: Track, home: HomePosition, params: PlanParams) -> GroundPath:
    """A path flown at a constant height: above home, or above the ground as `params.terrain` says.

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
        return GroundPath(track, heights, notes=(OWN_TERRAIN,))
    lon, lat = track.xy.T
    way_lon, way_lat = (np.round(np.append(*both), DECIMALS) for both in ((home.lon, lon), (home.lat, lat)))
    speeds = speeds_of(track, params)
    flown = fly_over(terrain.dem, way_lon, way_lat, params, speeds)
    tolerance_m = terrain.tolerance_for(params.altitude_m)
    back = profile_along(terrain.dem, way_lon[[-1, 0]], way_lat[[-1, 0]], GAP * tolerance_m)
    over_back = flown.target_m[-1] - np.concatenate([back.lower_m, back.upper_m])
    leads_home = bool(np.abs(over_back - params.altitude_m).max() > tolerance_m)
    if leads_home:
        way_lon, way_lat = np.append(way_lon, way_lon[0]), np.append(way_lat, way_lat[0])
        flown = fly_over(terrain.dem, way_lon, way_lat, params, np.append(speeds, params.speed_m_s))
        track = Track.joined([track, Track.transit(np.array([track.xy[-1], (home.lon, home.lat)]))])
        over_back = over_back[:0]
    heights, kept = _heights(flown, params, terrain)
    leg = np.searchsorted(flown.profile.corners[1:], kept)  # the first one leads from home to the path
    places = np.round(flown.profile.lon[kept], DECIMALS), np.round(flown.profile.lat[kept], DECIMALS)
    added = _with_added(track, np.column_stack(places), heights.added, leg)
    return GroundPath(
        added,
        heights,
        _ground(terrain.dem, home, places, flown, over_back, params),
        tuple(terrain_notes(flown, heights, speeds_of(added, params), params, leads_home)),
    )


def _with_added(track: Track, places: Floats, added: NDArray[np.bool_], leg: Ints) -> Track:
    """A track with points added on its legs: what is done on a leg goes on there.

    Parameters
    ----------
    track : Track
    places : (n, 2) float64 array
        Of all corners, in degrees.
    added : (n,) bool array
        Which of them are none of the track's.
    leg : (n,) int64 array
        The leg to each corner: 0 leads from home, and 1 is the track's first.
    """
    speed, leg = track.speed_m_s[leg], leg[1:]
    way = Track.joined([Track.transit(track.xy[[0, 0]]), track])
    hold_s, shots = np.zeros(len(places)), np.zeros(len(places), bool)
    hold_s[~added], shots[~added] = track.hold_s, track.shots
    return Track(places, way.trigger_m[leg], way.is_line[leg], hold_s, shots, way.look_at[leg], speed)


def _heights(flown: Flown, params: PlanParams, terrain: TerrainParams) -> tuple[Heights, Ints]:
    """Heights of the waypoints, and the samples that they are."""
    corner, takeoff_m = np.isin(flown.chosen, flown.profile.corners), float(params.altitude_m)
    speed = flown.speed_m_s
    if terrain.mode == FRAME:  # the vehicle follows the ground itself: points are where the speed changes
        turns = np.flatnonzero(corner[1:] | np.append(np.diff(speed) != 0, False))
        height = np.full(len(turns), takeoff_m)
        added = ~corner[1:][turns]
        return Heights(FRAME_TERRAIN, height, takeoff_m, added, speed[turns]), flown.chosen[1:][turns]
    kept = flown.chosen[1:]
    height, takeoff_m = flown.target_m[kept], float(flown.target_m[0] - flown.profile.upper_m[0])
    if terrain.mode == RELATIVE:
        height = height - flown.profile.upper_m[0]
        _check_above_home(flown.profile, kept, height)
    frame = FRAME_RELATIVE if terrain.mode == RELATIVE else FRAME_AMSL
    return Heights(frame, np.round(height, 3), takeoff_m, ~corner[1:], speed), kept


def _check_above_home(profile: Profile, kept: Ints, height_m: Floats) -> None:
    lowest = int(np.argmin(height_m))
    if height_m[lowest] < 1.0:
        k = kept[lowest]
        raise MissionError(
            f"the flight would be {-height_m[lowest]:.0f} m below home at lat {profile.lat[k]:.6f}, lon "
            f"{profile.lon[k]:.6f}, and heights above home are above 0: give --terrain absolute, or a home "
            "that is lower"
        )


def _ground(
    dem: Dem,
    home: HomePosition,
    places: tuple[Floats, Floats],
    flown: Flown,
    over_back: Floats,
    params: PlanParams,
) -> Ground:
    lon, lat = places
    heights = dem.heights_m(lon, lat).tolist()
    below = dict(zip(zip(lat.tolist(), lon.tolist(), strict=True), heights, strict=True))
    below[home.lat, home.lon] = float(flown.profile.upper_m[0])
    assert params.terrain is not None
    if params.terrain.mode == FRAME:
        return Ground(below, params.altitude_m, params.altitude_m)
    flight = flown.height_m
    lowest = np.append(flight - flown.profile.upper_m, over_back).min()
    highest = np.append(flight - flown.profile.lower_m, over_back).max()
    return Ground(below, float(lowest), float(highest))
