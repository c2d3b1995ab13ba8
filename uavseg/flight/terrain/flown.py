"""Flight over a profile of the ground: heights, the points between which it is straight, speeds on slopes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.params.terrain import FRAME, TerrainParams
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


def fly_over(dem: Dem, lon: Floats, lat: Floats, params: PlanParams, speeds: Floats) -> Flown:
    """The flight over the ground from the first of these corners to the last.

    Parameters
    ----------
    dem : Dem
    lon, lat : (k,) float64 arrays
        Corners of the path in degrees, home first.
    params : PlanParams
        Height above the ground, tolerance, and how fast the vehicle climbs and descends.
    speeds : (k - 1,) float64 array
        Of each leg, where it is not too steep.

    Raises
    ------
    MissionError
        If the DEM does not cover the path.
    """
    terrain = params.terrain
    assert terrain is not None
    tolerance_m = terrain.tolerance_for(params.altitude_m)
    profile = profile_along(dem, lon, lat, GAP * tolerance_m)
    slowest = min(SLOWEST_M_S, float(speeds.min()))
    climb, descent = rates_m_s(params, terrain)
    early = terrain.mode != FRAME and climbs_early(params.autopilot)
    limited = limit_slopes(profile.along_m, profile.upper_m, climb / slowest, descent / slowest)
    target = limited + params.altitude_m
    chosen, flown_m_s = [np.zeros(1, np.int64)], []
    corners = profile.corners.tolist()
    for start, end, speed in zip(corners[:-1], corners[1:], speeds.tolist(), strict=True):
        rates = Rates(climb, descent, speed)
        part = slice(start, end + 1)
        at, height = profile.along_m[part], target[part]
        points = (
            points_climbed_early(at, height, (1 - GAP) * tolerance_m, rates)
            if early
            else points_within(at, height, (1 - GAP) * tolerance_m)
        )
        chosen.append(start + np.array(points[1:], np.int64))
        flown_m_s.append(rates.speeds(np.diff(at[points]), np.diff(height[points])))
    return Flown(profile, target, np.concatenate(chosen), np.concatenate(flown_m_s))


@dataclass(frozen=True, slots=True, eq=False)
class LegPoints:
    """The points of one leg, the last of which is its end.

    Parameters
    ----------
    share : (n,) float64 array
        Of the leg, from its start to each point.
    height_m : (n + 1,) float64 array
        At its start and at each point.
    speed_m_s : (n,) float64 array
        On the way to each point.
    """

    share: Floats
    height_m: Floats
    speed_m_s: Floats


def points_of_leg(dem: Dem, leg: tuple[float, ...], params: PlanParams) -> LegPoints:
    """The points of one leg over the ground: from lon, lat to lon, lat, at a speed.

    Raises
    ------
    MissionError
        If the DEM does not cover the leg.
    """
    ends = np.array(leg[:4]).reshape(2, 2)
    flown = fly_over(dem, ends[:, 0], ends[:, 1], params, np.array(leg[4:]))
    chosen, speed = flown.chosen, flown.speed_m_s
    assert params.terrain is not None
    if params.terrain.mode == FRAME:  # the vehicle follows the ground itself
        kept = np.append(np.diff(speed) != 0, True)
        chosen, speed = np.append(chosen[0], chosen[1:][kept]), speed[kept]
    along = flown.profile.along_m[chosen]
    share = along[1:] / along[-1] if along[-1] > 0 else np.linspace(0, 1, len(along))[1:]
    return LegPoints(share, flown.target_m[chosen], speed)


def climbs_early(autopilot: str) -> bool:
    """Whether the vehicle approaches the height of the next waypoint at once, and not along the leg.

    PX4 computes the velocities over ground and in height independently of each other (PositionSmoothing.cpp,
    since 2025); ArduCopter follows the straight line.
    """
    return autopilot != "ardupilot"


@dataclass(frozen=True, slots=True)
class Rates:
    """How fast a vehicle climbs, descends, and flies where it is not slowed down."""

    climb_m_s: float
    descent_m_s: float
    speed_m_s: float

    def speeds(self, length_m: Floats, rise_m: Floats) -> Floats:
        """The speed on each leg: that of the mission, or a lower one where the vehicle could not follow."""
        rate = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            most = np.where(np.abs(rise_m) > 1e-6, length_m * rate / np.abs(rise_m), np.inf)
        stepped = np.floor(most / SPEED_STEP_M_S + 1e-6) * SPEED_STEP_M_S
        slowest = min(SLOWEST_M_S, self.speed_m_s)
        return np.where(most >= self.speed_m_s, self.speed_m_s, np.maximum(stepped, slowest))


def points_climbed_early(along_m: Floats, height_m: Floats, tolerance_m: float, rates: Rates) -> list[int]:
    """Samples between which a vehicle stays within a tolerance, on the straight line and climbing early.

    It climbs or descends at the beginning of each leg until the height of its end is reached. Each leg is as
    long as possible; one between neighbouring samples is always flown.

    Parameters
    ----------
    along_m, height_m : (n,) float64 arrays
        Distance along the way and height of all samples, before they are simplified.
    tolerance_m : float
    rates : Rates

    Examples
    --------
    >>> at = np.arange(0.0, 101, 10)
    >>> points_climbed_early(at, 0.1 * at, 4.0, Rates(3, 1.5, 5))
    [0, 5, 10]
    """
    last, found = len(along_m) - 1, [0]
    while found[-1] < last:
        first = end = found[-1]
        while end < last:
            leg = slice(first, end + 2)
            if not _is_within(
                along_m[leg] - along_m[first], height_m[leg] - height_m[first], tolerance_m, rates
            ):
                break
            end += 1
        found.append(max(end, first + 1))
    return found


def heights_climbed_early(
    profile: Profile, height_m: Floats, speeds: Floats, rates_m_s: tuple[float, float]
) -> Floats:
    """Heights at the samples of a profile of a vehicle that changes its height at the start of each leg.

    Parameters
    ----------
    profile : Profile
    height_m : (k,) float64 array
        At its corners.
    speeds : (k - 1,) float64 array
        Over ground, of the legs between them.
    rates_m_s : (climb, descent)
    """
    corners = profile.corners
    leg = np.clip(np.searchsorted(corners, np.arange(len(profile.along_m))) - 1, 0, len(corners) - 2)
    rise = np.diff(height_m)[leg]
    slope = np.where(rise > 0, *rates_m_s) / speeds[leg]
    way_m = profile.along_m - profile.along_m[corners[leg]]
    heights: Floats = height_m[leg] + np.sign(rise) * np.minimum(way_m * slope, np.abs(rise))
    return np.where(np.isin(np.arange(len(heights)), corners[1:]), height_m[leg + 1], heights)


def _is_within(way_m: Floats, climbed_m: Floats, tolerance_m: float, rates: Rates) -> bool:
    """Whether a leg from the first of these samples to the last is within the tolerance of all."""
    rise, length = float(climbed_m[-1]), float(way_m[-1])
    speed = rates.speeds(way_m[-1:], climbed_m[-1:])
    slope = (rates.climb_m_s if rise > 0 else rates.descent_m_s) / speed
    early = np.minimum(way_m * slope, abs(rise)) * np.sign(rise)
    straight = way_m / length * rise if length > 0 else early
    return bool(max(np.abs(early - climbed_m).max(), np.abs(straight - climbed_m).max()) <= tolerance_m)


def rates_m_s(params: PlanParams, terrain: TerrainParams) -> tuple[float, float]:
    """How fast the vehicle climbs and descends on a leg."""
    return terrain.rates_m_s(params.vehicle or default_vehicle(params.autopilot))
