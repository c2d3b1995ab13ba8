"""Ground clearance: heights of a mission above the ground of a DEM, checked leg by leg."""

from collections.abc import Iterator

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.mission.items import FRAME_AMSL, FRAME_TERRAIN, RETURN, TAKEOFFS
from uavseg.flight.mission.mission import CRUISE_M_S, Mission
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.altitude_profile import (
    check_known,
    climbs_early,
    heights_climbed_early,
    profile_along,
    rates_m_s,
)
from uavseg.raster.elevation.dem import Dem

GAP_M = 0.2  # between the bounds of the ground
RALLY_M = 5.0  # minimum height of a rally point above its ground, where flights are not lower
SLACK_M = 0.3  # for the decimals of a file on steep ground


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Minimum height of flights above the ground."""

    dem: Dem
    minimum_m: float  # on any leg, from above home on
    # Rates of climb and descent of a vehicle that approaches the height of the next waypoint at once, as PX4
    # does: the heights between its path and the straight line are checked. By default the straight line.
    early: tuple[float, float] | None = None

    def problems(self, mission: Mission, maximum_m: float) -> Iterator[str]:
        """Yield where a leg or rally point comes nearer to the ground than allowed, or is higher above it.

        The return is at the height of the last item. Heights above the terrain that the vehicle itself knows
        are taken for what they say. `maximum_m` is the maximum height above the ground.
        """
        try:
            yield from self._legs(mission, maximum_m)
            yield from self._rally(mission, maximum_m)
        except MissionError as error:  # the ground is not known
            yield str(error)

    def _legs(self, mission: Mission, maximum_m: float) -> Iterator[str]:
        items = [item for item in mission.items if item.has_position]
        if any(item.frame == FRAME_TERRAIN for item in items):
            yield from self._outside(
                max(item.altitude_m for item in items), self.minimum_m, maximum_m, "an item"
            )
            return
        home_m = self._ground_m(mission.home.lat, mission.home.lon)
        places = [] if items[0].command in TAKEOFFS else [(*_position(mission), home_m, CRUISE_M_S)]
        for item, speed in zip(items, mission.leg_speeds_m_s, strict=True):
            lon, lat = _position(mission) if item.command in TAKEOFFS else (item.lon, item.lat)
            zero_m = 0.0 if item.frame == FRAME_AMSL else home_m
            places.append((lon, lat, zero_m + item.altitude_m, speed))
        if any(item.command == RETURN for item in mission.items):
            places.append((*_position(mission), *places[-1][2:]))
        lon, lat, height, speeds = np.array(places).T
        profile = profile_along(self.dem, lon, lat, GAP_M)
        flight = np.interp(profile.along_m, profile.along_m[profile.corners], height)
        lower = upper = flight
        if self.early is not None:
            early = heights_climbed_early(profile, height, speeds[1:], self.early)
            lower, upper = np.minimum(flight, early), np.maximum(flight, early)
        for above in (lower - profile.upper_m, upper - profile.lower_m):
            for k in (int(above.argmin()), int(above.argmax())):
                place = f"the position {profile.lat[k]:.6f},{profile.lon[k]:.6f}"
                yield from self._outside(float(above[k]), self.minimum_m, maximum_m, place)

    def _rally(self, mission: Mission, maximum_m: float) -> Iterator[str]:
        minimum_m = min(self.minimum_m, RALLY_M)
        for number, point in enumerate(mission.rally, start=1):
            home_m = self._ground_m(mission.home.lat, mission.home.lon)
            above_m = home_m + point.altitude_m - self._ground_m(point.lat, point.lon)
            place = f"rally point {number} at {point.lat:.6f},{point.lon:.6f}"
            yield from self._outside(above_m, minimum_m, maximum_m, place)

    def _ground_m(self, lat: float, lon: float) -> float:
        lons, lats = np.array([lon]), np.array([lat])
        ground_m = self.dem.heights_m(lons, lats)
        check_known(self.dem, lons, lats, ground_m)
        return float(ground_m[0])

    def _outside(self, above_m: float, minimum_m: float, maximum_m: float, place: str) -> Iterator[str]:
        if above_m < minimum_m - SLACK_M:
            yield (
                f"{place} is {above_m:.1f} m above the ground of {self.dem.name}, and at least "
                f"{minimum_m:.1f} m are kept"
            )
        if above_m > maximum_m:
            yield (
                f"{place} is {above_m:.1f} m above the ground of {self.dem.name}, higher than allowed "
                "(--max-altitude): plan it with a lower --altitude or a smaller --terrain-tolerance"
            )


def clearance_of(params: PlanParams) -> Clearance | None:
    """Return the clearance that missions with these parameters keep; None without a DEM."""
    terrain = params.terrain
    if terrain is None or terrain.dem is None:
        return None
    minimum_m = params.altitude_m - terrain.tolerance_for(params.altitude_m)
    return Clearance(terrain.dem, minimum_m, rates_m_s(params) if climbs_early(params.autopilot) else None)


def _position(mission: Mission) -> tuple[float, float]:
    return mission.home.lon, mission.home.lat
