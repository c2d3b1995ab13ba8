"""Missions along a line: takeoff at home, a waypoint for each position, return."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.actions import corner_actions, gimbal_items
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
from uavseg.flight.track import Track

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
    notes = tuple(home_notes(home))
    return Mission(start, items, params.autopilot, params.name, notes, vehicle=params.vehicle)


def items_along(
    lon: Any, lat: Any, home: HomePosition, params: PlanParams, track: Track | None = None
) -> tuple[MissionItem, ...]:
    """Items of a flight along a line in degrees: takeoff, speed, waypoints, return.

    Parameters
    ----------
    lon, lat : (n,) arrays
    home : HomePosition
    params : PlanParams
    track : Track, optional
        What is done on the n - 1 legs and at the n corners; places as longitude and latitude.
    """
    track = Track.of_path(np.column_stack([lon, lat])) if track is None else track
    positions = zip(np.round(lat, _DECIMALS).tolist(), np.round(lon, _DECIMALS).tolist(), strict=True)
    height = float(params.altitude_m)
    actions = corner_actions(track, params)
    flight = []
    for position, hold, then in zip(positions, track.hold_s.tolist(), actions, strict=True):
        flight.append(MissionItem(WAYPOINT, FRAME_RELATIVE, (hold, 0.0, 0.0, None), *position, height))
        flight += then
    return (
        MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), home.lat, home.lon, height),
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, float(params.speed_m_s), -1.0, 0.0)),
        *gimbal_items(track, params),
        *flight,
        MissionItem(RETURN, FRAME_MISSION),
    )


def home_notes(home: tuple[float, ...]) -> list[str]:
    """Note that the altitude of home is missing, if it is."""
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]
