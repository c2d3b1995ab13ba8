"""Height of home from an elevation model, and how well one that is given agrees with it."""

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.terrain.profile import check_known

NOTED_M = 10.0  # a larger difference is reported: satellite heights and most models are better than that
REFUSED_M = 50.0  # a larger one is refused: as large as the distance of geoid and ellipsoid in many places


def home_on_ground(home: tuple[float, ...], params: PlanParams) -> tuple[tuple[float, ...], list[str]]:
    """Home with the height of its ground above the sea, from the DEM where none is given; and notes.

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
    found = terrain.dem.heights_m(lon, lat)
    check_known(terrain.dem, lon, lat, found)
    ground_m = round(float(found[0]), 2)
    if not terrain.dem.is_above_sea:
        return home, []
    if len(home) < 3:
        return (*home, ground_m), [
            f"the altitude of home is that of the ground in {terrain.dem.name}: {ground_m:.1f} m"
        ]
    differs_m = abs(home[2] - ground_m)
    given = f"home is given at {home[2]:g} m above the sea"
    words = f"{given}, and its ground in {terrain.dem.name} is at {ground_m:g} m"
    if differs_m > max(min(REFUSED_M, params.altitude_m / 2), NOTED_M):
        raise MissionError(
            f"{words}: one of the two is wrong, in feet, or above the ellipsoid; leave the altitude of home "
            "out to take that of the elevation model"
        )
    return home, [f"{words}: {differs_m:.0f} m apart"] if differs_m > NOTED_M else []
