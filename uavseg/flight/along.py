"""Missions along a line: takeoff at home, a waypoint for each position, return."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.items import (
    CHANGE_SPEED,
    FRAME_MISSION,
    FRAME_RELATIVE,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission import Mission
from uavseg.flight.params import PlanParams

_DECIMALS = 8  # of degrees: a millimetre


def fly_along(
    lon: NDArray[np.float64], lat: NDArray[np.float64], params: PlanParams, home: tuple[float, ...]
) -> Mission:
    """Make the mission that flies along a line.

    Parameters
    ----------
    lon, lat : (n,) float64 arrays
        Degrees, WGS 84; a waypoint for each.
    params : PlanParams
        Height, speed and autopilot; the pattern is not used.
    home : (lat, lon) or (lat, lon, altitude_m)
        Degrees, and metres above the sea.

    Raises
    ------
    MissionError
        If the line is not near home, or the mission would not be safe.
    """
    start = HomePosition(*home)
    items = items_along(lon, lat, start, params)
    return Mission(start, items, params.firmware, params.name, tuple(home_notes(home)))


def items_along(lon: Any, lat: Any, home: HomePosition, params: PlanParams) -> tuple[MissionItem, ...]:
    """Items of a flight along a line in degrees: takeoff, speed, waypoints, return."""
    positions = zip(np.round(lat, _DECIMALS).tolist(), np.round(lon, _DECIMALS).tolist(), strict=True)
    any_heading = (0.0, 0.0, 0.0, None)
    height = float(params.altitude_m)
    return (
        MissionItem(TAKEOFF, FRAME_RELATIVE, any_heading, home.lat, home.lon, height),
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, float(params.speed_m_s), -1.0, 0.0)),
        *(MissionItem(WAYPOINT, FRAME_RELATIVE, any_heading, *position, height) for position in positions),
        MissionItem(RETURN, FRAME_MISSION),
    )


def home_notes(home: tuple[float, ...]) -> list[str]:
    """Note that the altitude of home is missing, if it is."""
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]
