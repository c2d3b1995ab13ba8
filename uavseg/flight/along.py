"""Missions along a line: takeoff at home, a waypoint for each position, return."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_MISSION,
    FRAME_RELATIVE,
    MOUNT_CONTROL,
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
    notes = tuple(home_notes(home))
    return Mission(start, items, params.autopilot, params.name, notes, vehicle=params.vehicle)


def items_along(
    lon: Any, lat: Any, home: HomePosition, params: PlanParams, trigger_m: Any = ()
) -> tuple[MissionItem, ...]:
    """Items of a flight along a line in degrees: takeoff, speed, waypoints, return.

    Parameters
    ----------
    lon, lat : (n,) arrays
    home : HomePosition
    params : PlanParams
    trigger_m : (n - 1,) array, optional
        Distance between the photographs on each leg, 0 where none are taken.
    """
    positions = zip(round_degrees(lat), round_degrees(lon), strict=True)
    triggers = np.round(np.append(trigger_m, 0.0), 3).tolist() if len(trigger_m) else [0.0] * len(lon)
    any_heading = (0.0, 0.0, 0.0, None)
    height = float(params.altitude_m)
    flight = []
    before = 0.0
    for position, trigger in zip(positions, triggers, strict=True):
        flight.append(MissionItem(WAYPOINT, FRAME_RELATIVE, any_heading, *position, height))
        if trigger or before:  # each line has its own distance, and begins with a photograph
            flight.append(
                MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (trigger, 0.0, float(trigger > 0), 0.0))
            )
        before = trigger
    return (
        MissionItem(TAKEOFF, FRAME_RELATIVE, any_heading, home.lat, home.lon, height),
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, float(params.speed_m_s), -1.0, 0.0)),
        *_gimbal_items(params),
        *flight,
        MissionItem(RETURN, FRAME_MISSION),
    )


def round_degrees(degrees: Any) -> list[float]:
    """Latitudes or longitudes as they are written to files."""
    rounded: list[float] = np.round(degrees, _DECIMALS).tolist()
    return rounded


def _gimbal_items(params: PlanParams) -> list[MissionItem]:
    """The gimbal is turned to its pitch, and stays there (MAV_MOUNT_MODE_MAVLINK_TARGETING)."""
    if params.photos is None:
        return []
    pitch = float(params.photos.pitch_deg)
    return [MissionItem(MOUNT_CONTROL, FRAME_MISSION, (pitch, 0.0, 0.0, 0.0), altitude_m=2.0)]


def home_notes(home: tuple[float, ...]) -> list[str]:
    """Note that the altitude of home is missing, if it is."""
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]
