"""Missions along a line: takeoff at home, a waypoint for each position, return."""

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.items import (
    CHANGE_SPEED,
    DEGREE_DECIMALS,
    FRAME_MISSION,
    FRAME_RELATIVE,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.actions import corner_actions, gimbal_items
from uavseg.flight.terrain.heights import Heights, constant_height
from uavseg.flight.terrain.leg_speeds import speeds_of


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
    items = items_along(Track.of_path(np.column_stack([lon, lat])), start, params)
    notes = tuple(home_notes(home))
    return Mission(start, items, params.autopilot, params.name, notes, vehicle=params.vehicle)


def items_along(
    track: Track, home: HomePosition, params: PlanParams, heights: Heights | None = None
) -> tuple[MissionItem, ...]:
    """Items of a flight along a track: takeoff, speed, waypoints and what is done there, return.

    Parameters
    ----------
    track : Track
        With places as longitude and latitude in degrees.
    home : HomePosition
    params : PlanParams
    heights : Heights, optional
        Of the waypoints; by default that of `params`, above home.
    """
    heights = constant_height(track, params) if heights is None else heights
    places = np.round(track.xy, DEGREE_DECIMALS).tolist()
    flown = zip(heights.height_m.tolist(), heights.speed_m_s.tolist(), track.hold_s.tolist(), strict=True)
    flight = []
    speed = begin = float(speeds_of(track, params)[0])
    for (lon, lat), (height, leg_speed, hold), then in zip(
        places, flown, corner_actions(track, params), strict=True
    ):
        if leg_speed != speed:
            flight.append(_speed_item(leg_speed))
        flight.append(MissionItem(WAYPOINT, heights.frame, (hold, 0.0, 0.0, None), lat, lon, height))
        flight += then
        speed = leg_speed
    if speed != begin:
        flight.append(_speed_item(begin))
    up = round(heights.takeoff_m, 3)
    return (
        MissionItem(TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), home.lat, home.lon, up),
        _speed_item(begin),
        *gimbal_items(track, params),
        *flight,
        MissionItem(RETURN, FRAME_MISSION),
    )


def _speed_item(speed_m_s: float) -> MissionItem:
    """The speed over ground from here on."""
    return MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, speed_m_s, -1.0, 0.0))


def home_notes(home: tuple[float, ...]) -> list[str]:
    """Note that the altitude of home is missing, if it is."""
    if len(home) > 2:
        return []
    return ["the altitude of home above the sea is not given and written as 0; all heights are above home"]
