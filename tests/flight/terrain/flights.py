"""Flights over drawn ground: paths in metres around home, and their height above the ground on paper."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pyproj import Geod

from tests.flight.terrain.dems import HOME
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.track import Plane, Track
from uavseg.flight.params.plan import PlanParams, TerrainParams
from uavseg.flight.terrain.follow import GroundPath, follow_ground
from uavseg.raster.elevation.dem import Dem

Floats = NDArray[np.float64]

GEOD = Geod(ellps="WGS84")
PLANE = Plane(*HOME)
ZIGZAG = [(-400, -300), (400, -300), (400, -200), (-400, -200), (-400, 300), (400, 300)]
TRIGGERS = (20.0, 0.0, 20.0, 0.0, 25.0)


def follow(
    dem: Dem | None,
    path: ArrayLike = ZIGZAG,
    triggers: Any = (),
    altitude_m: float = 60.0,
    speed_m_s: float = 5.0,
    home: tuple[float, float] = HOME,
    **terrain: Any,
) -> GroundPath:
    lon, lat = PLANE.lonlat_from_xy(*np.array(path, float).T)
    params = PlanParams(altitude_m, speed_m_s=speed_m_s, terrain=TerrainParams(dem, **terrain))
    ground_m = 0.0 if dem is None else float(dem.heights_m([home[1]], [home[0]])[0])
    start = HomePosition(*home, ground_m if np.isfinite(ground_m) else 0.0)
    return follow_ground(track(lon, lat, triggers), start, params)


def track(lon: Floats, lat: Floats, triggers: Any = ()) -> Track:
    flown = Track.of_path(np.column_stack([lon, lat]))
    return replace(flown, trigger_m=np.array(triggers, float)) if len(triggers) else flown


def flown(dem: Dem, path: GroundPath, home: tuple[float, float] = HOME, step_m: float = 0.37) -> Floats:
    """Height above the ground along a path of heights above the sea, from above home on."""
    ground_m = dem.heights_m([home[1]], [home[0]])[0]
    lon, lat = np.vstack([home[::-1], path.track.xy]).T
    height = np.append(ground_m + path.heights.takeoff_m, path.heights.height_m)
    above = []
    for k in range(len(lat) - 1):
        azimuth, _, length = GEOD.inv(lon[k], lat[k], lon[k + 1], lat[k + 1])
        share = np.linspace(0, 1, int(length / step_m) + 2)
        ones = np.ones(len(share))
        place = GEOD.fwd(lon[k] * ones, lat[k] * ones, azimuth * ones, share * length)[:2]
        above.append(height[k] + (height[k + 1] - height[k]) * share - dem.heights_m(*place))
    return np.concatenate(above)


def slopes(dem: Dem, path: GroundPath, home: tuple[float, float] = HOME) -> tuple[Floats, Floats]:
    """Length and rise of the legs of a path of heights above the sea, from above home on."""
    lon, lat = np.vstack([home[::-1], path.track.xy]).T
    ground_m = dem.heights_m([home[1]], [home[0]])[0]
    length = GEOD.inv(lon[:-1], lat[:-1], lon[1:], lat[1:])[2]
    return length, np.diff(np.append(ground_m + path.heights.takeoff_m, path.heights.height_m))
