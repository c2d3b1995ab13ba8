"""Notes for the pilot of a flight over the ground of an elevation model."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.vehicle import returning_vehicles
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.params.terrain import FRAME, RELATIVE
from uavseg.flight.terrain.altitude_profile import AltitudeProfile, rates_m_s
from uavseg.flight.terrain.profile import GroundProfile
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import geod_wgs84

Floats = NDArray[np.float64]

ONBOARD_TERRAIN = (
    "heights are above the terrain that the vehicle itself knows (ArduPilot: TERRAIN_ENABLE 1, data of the "
    "place on board); give --dem to have slopes and the way home checked"
)
RETURN_SLACK_M = 1.0
RAISED_M = 0.05  # a smaller difference is not reported
STARTS = 250  # samples of the flight from which return paths are examined
SAMPLES = 250  # of each return path


def terrain_notes(
    flight: AltitudeProfile,
    added: int,
    speed_m_s: Floats,
    requested_m_s: Floats,
    params: PlanParams,
    leads_home: bool,
) -> Iterator[str]:
    """Yield what the pilot of a flight over the ground should know.

    Parameters
    ----------
    flight : AltitudeProfile
    added : int
        How many points were added on legs for their height.
    speed_m_s, requested_m_s : (n,) float64 arrays
        The speed on the leg to each waypoint, and the one where it is not too steep.
    params : PlanParams
        With a DEM.
    leads_home : bool
        Whether points were added for the path home.
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
    climb, descent = rates_m_s(params)
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
    """Ground on straight paths to home, from n samples of a flight.

    The ground on the flight itself is known exactly, that on these paths at k evenly spaced samples, from
    home on; NaN where it is not known.
    """

    start: NDArray[np.int64]  # samples of the flight, (n,)
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
    known_m = np.where(is_unknown, -np.inf, paths.ground_m)
    height_m = np.concatenate([ground.upper_m, known_m.ravel()])
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
