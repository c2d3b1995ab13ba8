"""Clearance: the heights of a complete mission above the ground of a DEM, checked leg by leg."""

from dataclasses import dataclass

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.items import FRAME_AMSL, FRAME_TERRAIN, RETURN, TAKEOFFS
from uavseg.flight.mission import Mission
from uavseg.flight.params import PlanParams
from uavseg.flight.terrain.profile import check_known, profile_along
from uavseg.raster.elevation.dem import Dem

GAP_M = 0.2  # bounds of the ground may be so far apart
SLACK_M = 0.3  # what the decimals of a file may take on steep ground


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """The ground, and how far flights keep above it.

    Parameters
    ----------
    dem : Dem
    least_m : float
        Least height above the ground on any leg, from above home on.
    """

    dem: Dem
    least_m: float

    def check(self, mission: Mission, most_m: float) -> None:
        """Check the height of every leg above the ground, the return at the height of the last item included.

        Heights above the terrain that the vehicle itself knows are taken for what they say.

        Raises
        ------
        MissionError
            If a leg comes nearer to the ground than `least_m`, or is higher above it than `most_m`, or the
            ground is not known.
        """
        items = [item for item in mission.items if item.has_position]
        if any(item.frame == FRAME_TERRAIN for item in items):
            self._check(max(item.altitude_m for item in items), most_m, "an item")
            return
        home_lon, home_lat = np.array([mission.home.lon]), np.array([mission.home.lat])
        ground_m = self.dem.heights_m(home_lon, home_lat)
        check_known(self.dem, home_lon, home_lat, ground_m)
        places = [] if items[0].command in TAKEOFFS else [(*_position(mission), float(ground_m[0]))]
        for item in items:
            lon, lat = _position(mission) if item.command in TAKEOFFS else (item.lon, item.lat)
            zero_m = 0.0 if item.frame == FRAME_AMSL else float(ground_m[0])
            places.append((lon, lat, zero_m + item.altitude_m))
        if any(item.command == RETURN for item in mission.items):
            places.append((*_position(mission), places[-1][2]))
        lon, lat, height = np.array(places).T
        profile = profile_along(self.dem, lon, lat, GAP_M)
        flight = np.interp(profile.along_m, profile.along_m[profile.corners], height)
        for above in (flight - profile.upper_m, flight - profile.lower_m):
            for k in (int(above.argmin()), int(above.argmax())):
                place = f"the position {profile.lat[k]:.6f},{profile.lon[k]:.6f}"
                self._check(float(above[k]), most_m, place)

    def _check(self, above_m: float, most_m: float, place: str) -> None:
        if above_m < self.least_m - SLACK_M:
            raise MissionError(
                f"{place} is {above_m:.1f} m above the ground of {self.dem.name}, and at least "
                f"{self.least_m:.1f} m are kept"
            )
        if above_m > most_m:
            raise MissionError(
                f"{place} is {above_m:.1f} m above the ground of {self.dem.name}, higher than allowed "
                "(--max-altitude): give a lower --altitude or a smaller --terrain-tolerance"
            )


def clearance_of(params: PlanParams) -> Clearance | None:
    """What missions with these parameters are checked against; None without a DEM."""
    terrain = params.terrain
    if terrain is None or terrain.dem is None:
        return None
    return Clearance(terrain.dem, params.altitude_m - terrain.tolerance_for(params.altitude_m))


def _position(mission: Mission) -> tuple[float, float]:
    return mission.home.lon, mission.home.lat
