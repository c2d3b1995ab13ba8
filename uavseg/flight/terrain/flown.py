"""Flight over a profile of the ground: heights, the points between which it is straight, speeds on slopes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.estimate.vehicle import default_vehicle
from uavseg.flight.params import PlanParams
from uavseg.flight.terrain.params import TerrainParams
from uavseg.flight.terrain.profile import Profile, profile_along
from uavseg.flight.terrain.selection import limit_slopes, points_within
from uavseg.raster.elevation.dem import Dem

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SLOWEST_M_S = 1.0  # a vehicle is not slowed down further: it is raised before ground that is steeper
SPEED_STEP_M_S = 0.5  # speeds of slow legs are multiples of it, so that those of neighbours often agree
GAP = 0.1  # share of the tolerance that the bounds of the ground may be apart


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """A profile from home along a path, and the flight over it.

    Parameters
    ----------
    profile : Profile
        With n samples.
    target_m : (n,) float64 array
        Height of the flight at each sample, above the zero of the DEM, before it is simplified.
    chosen : (m,) int64 array
        The samples between which the flight is straight; home is the first.
    speed_m_s : (m - 1,) float64 array
        Between them.
    """

    profile: Profile
    target_m: Floats
    chosen: Ints
    speed_m_s: Floats

    @property
    def height_m(self) -> Floats:
        """Height of the flight at each sample, above the zero of the DEM."""
        at = self.profile.along_m
        return np.interp(at, at[self.chosen], self.target_m[self.chosen])


def fly_over(dem: Dem, lon: Floats, lat: Floats, params: PlanParams, terrain: TerrainParams) -> Flown:
    """The flight over the ground from the first of these corners to the last.

    Parameters
    ----------
    dem : Dem
    lon, lat : (k,) float64 arrays
        Corners of the path in degrees, home first.
    params : PlanParams
        Height above the ground and speed.
    terrain : TerrainParams
        Tolerance, and how fast the vehicle climbs and descends.

    Raises
    ------
    MissionError
        If the DEM does not cover the path.
    """
    tolerance_m = terrain.tolerance_for(params.altitude_m)
    profile = profile_along(dem, lon, lat, GAP * tolerance_m)
    slowest = min(SLOWEST_M_S, params.speed_m_s)
    climb, descent = rates_m_s(params, terrain)
    limited = limit_slopes(profile.along_m, profile.upper_m, climb / slowest, descent / slowest)
    target = limited + params.altitude_m
    chosen = [np.zeros(1, np.int64)]
    for start, end in zip(profile.corners[:-1].tolist(), profile.corners[1:].tolist(), strict=True):
        part = slice(start, end + 1)
        points = points_within(profile.along_m[part], target[part], (1 - GAP) * tolerance_m)
        chosen.append(start + np.array(points[1:], np.int64))
    found = np.concatenate(chosen)
    length, rise = np.diff(profile.along_m[found]), np.diff(target[found])
    return Flown(profile, target, found, _speeds(length, rise, params, terrain))


def rates_m_s(params: PlanParams, terrain: TerrainParams) -> tuple[float, float]:
    """How fast the vehicle climbs and descends on a leg."""
    return terrain.rates_m_s(params.vehicle or default_vehicle(params.autopilot))


def _speeds(length: Floats, rise: Floats, params: PlanParams, terrain: TerrainParams) -> Floats:
    """The speed on each leg: that of the mission, or a lower one where the vehicle could not follow."""
    rate = np.where(rise > 0, *rates_m_s(params, terrain))
    with np.errstate(divide="ignore", invalid="ignore"):
        most = np.where(np.abs(rise) > 1e-6, length * rate / np.abs(rise), np.inf)
    stepped = np.floor(most / SPEED_STEP_M_S + 1e-6) * SPEED_STEP_M_S
    slowest = min(SLOWEST_M_S, params.speed_m_s)
    return np.where(most >= params.speed_m_s, params.speed_m_s, np.maximum(stepped, slowest))
