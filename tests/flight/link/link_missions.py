"""Missions that are sent over a link."""

from dataclasses import replace

from uavseg.flight.mission.items import (
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    JUMP,
    LAND,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
    RallyPoint,
)
from uavseg.flight.mission.mission import Mission

HOME = HomePosition(47.0, 8.0, 412.5)
ANY = (0.0, 0.0, 0.0, None)
FENCE = (
    FencePolygon(((46.99, 7.99), (47.06, 7.99), (47.06, 8.06), (46.99, 8.06)), True),
    FencePolygon(((47.02, 8.03), (47.03, 8.03), (47.025, 8.04)), False),
    FenceCircle(47.01, 8.05, 40.5, False),
)
RALLY = (RallyPoint(47.001, 8.001, 30.0), RallyPoint(47.002, 8.002, 45.0))


def survey(items: int = 12, autopilot: str = "ardupilot") -> Mission:
    """A mission with so many items: takeoff, speed, waypoints with a camera that triggers, return."""
    rows = [
        MissionItem(TAKEOFF, FRAME_RELATIVE, ANY, HOME.lat, HOME.lon, 40.0),
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 7.1, -1.0, 0.0)),
    ]
    for n in range(items - 3):
        if n % 5 == 4:
            rows.append(MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (12.5, 0.0, 1.0, 0.0)))
        else:
            place = round(47.0 + 0.0001 * n, 8), round(8.0 + 1.23456789e-5 * n, 8)
            rows.append(MissionItem(WAYPOINT, FRAME_RELATIVE, ANY, *place, 40.0 + 0.01 * (n % 7)))
    return Mission(HOME, (*rows, MissionItem(RETURN, FRAME_MISSION)), autopilot)


def fenced(mission: Mission) -> Mission:
    """The mission with a fence and rally points."""
    return replace(mission, fence=FENCE, rally=RALLY)


def looped(autopilot: str) -> Mission:
    """A mission that jumps back to its second item, and lands."""
    points = [MissionItem(WAYPOINT, FRAME_AMSL, ANY, 47.0 + n / 1000, 8.0, 450.0) for n in range(3)]
    jump = MissionItem(JUMP, FRAME_MISSION, (2.0, 3.0, 0.0, 0.0))
    land = MissionItem(LAND, FRAME_RELATIVE, ANY, 47.0, 8.0, 0.0)
    return Mission(HOME, (*points, jump, land), autopilot)
