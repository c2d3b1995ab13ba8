"""Mission items as MISSION_ITEM_INT carries them, and back: whole units, frames, home row, jump targets."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.mission.fence import Fence, FenceCircle, FencePolygon, RallyPoint
from uavseg.flight.mission.items import (
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    HEADING_COMMANDS,
    JUMP,
    POSITION_COMMANDS,
    WAYPOINT,
    HomePosition,
    ItemParams,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

# MAV_CMD
FENCE_RETURN, POLYGON_INCLUSION, POLYGON_EXCLUSION = 5000, 5001, 5002
CIRCLE_INCLUSION, CIRCLE_EXCLUSION, RALLY_POINT = 5003, 5004, 5100
SET_HOME, LAND_START, ROI_LOCATION, ROI = 179, 189, 195, 201
# MAV_FRAME, with an equal frame that is not deprecated
FRAME_AMSL_INT, FRAME_RELATIVE_INT, FRAME_TERRAIN_INT = 5, 6, 11
EQUAL_FRAMES = {
    FRAME_AMSL_INT: FRAME_AMSL,
    FRAME_RELATIVE_INT: FRAME_RELATIVE,
    FRAME_TERRAIN_INT: FRAME_TERRAIN,
}

LOCATED = POSITION_COMMANDS | {SET_HOME, LAND_START, ROI_LOCATION, ROI}  # x and y may be a position
_DEGREES = 1e7  # units of x and y in a degree


@dataclass(frozen=True, slots=True)
class LinkItem:
    """One item of a mission, a fence or a list of rally points, in the units of the link.

    Parameters
    ----------
    command, frame : int
        MAV_CMD and MAV_FRAME.
    params : four floats or None
        None is NaN on the link.
    x, y : int
        Latitude and longitude in 1e-7 degrees; as they are in frame 2.
    z : float
        Altitude in metres.
    autocontinue : int
        1 if the next item of the mission follows by itself.
    """

    command: int
    frame: int
    params: ItemParams = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: int = 1

    def fields(self, number: int, is_current: bool) -> tuple[Any, ...]:
        """The fields of MISSION_ITEM_INT after its target, for the item with this number."""
        params = (math.nan if value is None else value for value in self.params)
        start = (number, self.frame, self.command, int(is_current), self.autocontinue)
        return (*start, *params, self.x, self.y, self.z)

    @classmethod
    def of_message(cls, message: Any) -> "LinkItem":
        """The item that MISSION_ITEM_INT carries."""
        first, second, third, fourth = (
            None if math.isnan(value) else _decimal(value)
            for value in (message.param1, message.param2, message.param3, message.param4)
        )
        frame = EQUAL_FRAMES.get(message.frame, message.frame)
        params = (first, second, third, fourth)
        place = message.x, message.y, _decimal(message.z)
        return cls(message.command, frame, params, *place, message.autocontinue)


def items_of_mission(mission: Mission, has_home_row: bool) -> list[LinkItem]:
    """A mission as it is sent: with home as item 0 (ArduPilot), or without."""
    home = mission.home
    rows = [LinkItem(WAYPOINT, FRAME_AMSL, (0.0,) * 4, *_units(home.lat, home.lon), home.altitude_m)]
    for item in mission.items:
        x, y = (
            (round(item.lat), round(item.lon)) if item.frame == FRAME_MISSION else _units(item.lat, item.lon)
        )
        params = item.params if has_home_row else _shifted(item, -1)
        place = x, y, item.altitude_m
        rows.append(LinkItem(item.command, item.frame, params, *place, int(item.autocontinue)))
    return rows if has_home_row else rows[1:]


def mission_items(items: Iterable[LinkItem], has_home_row: bool) -> tuple[MissionItem, ...]:
    """Items of a mission, without home, from what a vehicle sent.

    ArduPilot keeps no headings and no frames of items without position: a heading of 0 is read as not set,
    and such items get frame 2.
    """
    return tuple(_mission_item(item, has_home_row) for item in items)


def _mission_item(item: LinkItem, has_home_row: bool) -> MissionItem:
    frame, params = item.frame, item.params
    if has_home_row and item.command not in LOCATED:
        frame = FRAME_MISSION
    if has_home_row and item.command in HEADING_COMMANDS and params[3] == 0:
        params = (*params[:3], None)
    lat, lon = (item.x, item.y) if frame == FRAME_MISSION else (item.x / _DEGREES, item.y / _DEGREES)
    place = float(lat), float(lon), item.z
    found = MissionItem(item.command, frame, params, *place, bool(item.autocontinue))
    return found if has_home_row else replace(found, params=_shifted(found, 1))


def _shifted(item: MissionItem, by: int) -> ItemParams:
    """Parameters with the target of a jump in another count: files count from 1, or from home as 0."""
    first = item.params[0]
    return (first + by, *item.params[1:]) if item.command == JUMP and first is not None else item.params


def home_of_row(item: LinkItem) -> HomePosition | None:
    """Home from item 0 of ArduPilot; None if it has none yet."""
    if item.x == 0 and item.y == 0:
        return None
    return HomePosition(item.x / _DEGREES, item.y / _DEGREES, item.z)


def items_of_fence(fence: Iterable[Fence]) -> list[LinkItem]:
    """A fence as it is sent: an item for each vertex, with their number, or for each circle."""
    items = []
    for shape in fence:
        if isinstance(shape, FencePolygon):
            command = POLYGON_INCLUSION if shape.inclusion else POLYGON_EXCLUSION
            size = float(len(shape.vertices))
        else:
            command = CIRCLE_INCLUSION if shape.inclusion else CIRCLE_EXCLUSION
            size = shape.radius_m
        items += [
            LinkItem(command, FRAME_AMSL, (size, 0.0, 0.0, 0.0), *_units(*position))
            for position in shape.positions
        ]
    return items


def fence_of_items(items: Sequence[LinkItem]) -> tuple[Fence, ...]:
    """The fence that a vehicle sent, without its return point.

    Raises
    ------
    MissionError
        If an item is none of a fence, or a polygon has fewer vertices than it says.
    """
    rest = iter(item for item in items if item.command != FENCE_RETURN)
    return tuple(_fence_shape(item, rest) for item in rest)


def _fence_shape(item: LinkItem, rest: Iterator[LinkItem]) -> Fence:
    size = item.params[0] or 0.0
    if item.command in (CIRCLE_INCLUSION, CIRCLE_EXCLUSION):
        return FenceCircle(item.x / _DEGREES, item.y / _DEGREES, size, item.command == CIRCLE_INCLUSION)
    if item.command not in (POLYGON_INCLUSION, POLYGON_EXCLUSION):
        raise MissionError(f"the fence of the vehicle has an item of command {item.command}")
    vertices = [item]
    while len(vertices) < size:
        following = next(rest, None)
        if following is None or following.command != item.command:
            raise MissionError(f"a fence polygon of the vehicle has {len(vertices)} of {size:g} vertices")
        vertices.append(following)
    positions = tuple((vertex.x / _DEGREES, vertex.y / _DEGREES) for vertex in vertices)
    return FencePolygon(positions, item.command == POLYGON_INCLUSION)


def items_of_rally(rally: Iterable[RallyPoint]) -> list[LinkItem]:
    """Rally points as they are sent."""
    return [
        LinkItem(RALLY_POINT, FRAME_RELATIVE, (0.0,) * 4, *_units(point.lat, point.lon), point.altitude_m)
        for point in rally
    ]


def rally_of_items(items: Iterable[LinkItem]) -> tuple[RallyPoint, ...]:
    """The rally points that a vehicle sent."""
    return tuple(RallyPoint(item.x / _DEGREES, item.y / _DEGREES, item.z) for item in items)


def _units(lat: float, lon: float) -> tuple[int, int]:
    return round(lat * _DEGREES), round(lon * _DEGREES)


def _decimal(value: float) -> float:
    """A 32-bit float as the shortest number that it stands for: 45.1, not 45.099998474."""
    return float(str(np.float32(value)))
