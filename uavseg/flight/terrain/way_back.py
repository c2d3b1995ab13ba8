"""The ground below straight ways back to home from anywhere on a flight."""

from dataclasses import dataclass

import numpy as np

from uavseg.flight.terrain.profile import Profile
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import geod_wgs84

STARTS = 250  # places of the flight from which ways back are looked at
PLACES = 250  # places that are looked at on each of them


@dataclass(frozen=True, slots=True)
class Rise:
    """The highest ground that was found.

    Parameters
    ----------
    height_m : float
        Above the zero of the DEM.
    lat, lon : float
        Where it is, in degrees.
    is_incomplete : bool
        Whether the DEM has no height somewhere between.
    """

    height_m: float
    lat: float
    lon: float
    is_incomplete: bool


def highest_between(dem: Dem, profile: Profile) -> Rise:
    """The highest ground on straight ways from a flight to its start.

    The ground on the flight itself is known exactly, that on the ways back at evenly spaced samples.

    Parameters
    ----------
    dem : Dem
    profile : Profile
        Of the flight; its first sample is home.
    """
    chosen = np.unique(np.linspace(0, len(profile.lon) - 1, STARTS).astype(np.int64))
    lon, lat = profile.lon[chosen], profile.lat[chosen]
    geod = geod_wgs84()
    azimuth, _, length = geod.inv(
        np.full_like(lon, profile.lon[0]), np.full_like(lat, profile.lat[0]), lon, lat
    )
    share = np.linspace(0, 1, PLACES)[:, None]
    shape = (PLACES, len(chosen))
    away = [np.broadcast_to(part, shape).ravel() for part in (profile.lon[0], profile.lat[0], azimuth)]
    way_lon, way_lat, _ = geod.fwd(*away, (share * length).ravel())
    height = dem.heights_m(way_lon, way_lat)
    is_incomplete = bool(np.isnan(height).any())
    k, top = int(np.argmax(np.where(np.isnan(height), -np.inf, height))), int(profile.upper_m.argmax())
    if height[k] > profile.upper_m[top]:
        return Rise(float(height[k]), float(way_lat[k]), float(way_lon[k]), is_incomplete)
    return Rise(float(profile.upper_m[top]), float(profile.lat[top]), float(profile.lon[top]), is_incomplete)
