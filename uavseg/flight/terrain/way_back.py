"""The ground below straight ways back to home from anywhere on a flight."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.vehicle import Vehicle
from uavseg.flight.terrain.profile import Profile
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import geod_wgs84

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

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


@dataclass(frozen=True, slots=True)
class EarlyReturns:
    """Heights above the ground of level returns that start anywhere on a flight.

    Parameters
    ----------
    lowest_m, highest_m : float
        The least and the greatest one.
    lowest_from, highest_from : (lat, lon)
        Where these returns start, in degrees.
    """

    lowest_m: float
    highest_m: float
    lowest_from: tuple[float, float]
    highest_from: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class WaysBack:
    """The ground on straight ways from places of a flight to its start.

    The ground on the flight itself is known exactly, that on the ways back at evenly spaced samples.

    Parameters
    ----------
    profile : Profile
        Of the flight; its first sample is home.
    chosen : (n,) int64 array
        The samples at which the ways start.
    length_m : (n,) float64 array
    lon, lat, height_m : (k, n) float64 arrays
        Places on the ways, from home on, and the height of the ground there; NaN where it is not known.
    """

    profile: Profile
    chosen: Ints
    length_m: Floats
    lon: Floats
    lat: Floats
    height_m: Floats

    @property
    def highest(self) -> Rise:
        """The highest ground."""
        height, profile = self.height_m.ravel(), self.profile
        is_incomplete = bool(np.isnan(height).any())
        k, top = int(np.argmax(np.where(np.isnan(height), -np.inf, height))), int(profile.upper_m.argmax())
        if height[k] > profile.upper_m[top]:
            return Rise(float(height[k]), float(self.lat.flat[k]), float(self.lon.flat[k]), is_incomplete)
        place = float(profile.lat[top]), float(profile.lon[top])
        return Rise(float(profile.upper_m[top]), *place, is_incomplete)

    def returns(self, flight_m: Floats, vehicle: Vehicle) -> EarlyReturns:
        """Level returns, after a climb to the height of returns where that is higher.

        Parameters
        ----------
        flight_m : float64 array
            Height of the flight at each sample of the profile.
        vehicle : Vehicle
        """
        home_m = float(self.profile.upper_m[0])
        climbed = np.minimum(vehicle.return_height_m, vehicle.return_slope * self.length_m)
        level = np.maximum(flight_m[self.chosen], home_m + climbed)
        above = level - self.height_m
        low, high = int(np.nanargmin(np.nanmin(above, axis=0))), int(np.nanargmax(np.nanmax(above, axis=0)))
        lowest_from, highest_from = (
            (float(self.profile.lat[self.chosen[k]]), float(self.profile.lon[self.chosen[k]]))
            for k in (low, high)
        )
        return EarlyReturns(float(np.nanmin(above)), float(np.nanmax(above)), lowest_from, highest_from)


def ways_back(dem: Dem, profile: Profile) -> WaysBack:
    """The ground on straight ways from a flight to its start.

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
    lons, lats, heights = (part.reshape(shape) for part in (way_lon, way_lat, height))
    return WaysBack(profile, chosen, length, lons, lats, heights)
