"""A flight along a line: take off at home, fly from place to place, return."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.items import (
    CHANGE_SPEED,
    NO_PLACE,
    RELATIVE,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    Home,
    Item,
)
from uavseg.flight.mission import Mission
from uavseg.flight.params import PlanParams

DECIMALS = 8  # of degrees: a millimetre


def fly_along(
    lon: NDArray[np.float64], lat: NDArray[np.float64], params: PlanParams, home: tuple[float, ...]
) -> Mission:
    """The mission that flies along a line.

    Parameters
    ----------
    lon, lat : (n,) float64 arrays
        Degrees, WGS 84; a waypoint for each.
    params : PlanParams
        Height, speed and autopilot; its pattern plays no part.
    home : (lat, lon) or (lat, lon, altitude_m)

    Raises
    ------
    MissionError
        If the line is not near home, or the mission would not be safe.
    """
    start = Home(*home)
    items = items_along(lon, lat, start, params)
    return Mission(start, items, params.firmware, params.name, tuple(notes_of_home(home)))


def items_along(lon: Any, lat: Any, home: Home, params: PlanParams) -> tuple[Item, ...]:
    """Takeoff, speed, a waypoint for each place (degrees), return."""
    places = zip(np.round(lat, DECIMALS).tolist(), np.round(lon, DECIMALS).tolist(), strict=True)
    any_heading = (0.0, 0.0, 0.0, None)
    high = float(params.altitude_m)
    return (
        Item(TAKEOFF, RELATIVE, any_heading, home.lat, home.lon, high),
        Item(CHANGE_SPEED, NO_PLACE, (1.0, float(params.speed_m_s), -1.0, 0.0)),
        *(Item(WAYPOINT, RELATIVE, any_heading, *place, high) for place in places),
        Item(RETURN, NO_PLACE),
    )


def notes_of_home(home: tuple[float, ...]) -> list[str]:
    """What to tell whoever did not say how high home lies."""
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]
