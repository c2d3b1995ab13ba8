"""Messages of the mission protocol: items as MISSION_ITEM_INT carries them, types of lists, and results."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np

from uavseg.dataclass import dataclass
from uavseg.errors import LinkError, MissionError
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import FenceCircle, FencePolygon, HomePosition, MissionItem, RallyPoint
from uavseg.flight.mission.mission import Mission

# MAV_CMD
FENCE_RETURN, POLYGON_INCLUSION, POLYGON_EXCLUSION = 5000, 5001, 5002
CIRCLE_INCLUSION, CIRCLE_EXCLUSION, RALLY_POINT = 5003, 5004, 5100
SET_HOME, LAND_START, ROI_LOCATION, ROI = 179, 189, 195, 201
# MAV_FRAME, with an equal frame that is not deprecated
FRAME_AMSL_INT, FRAME_RELATIVE_INT, FRAME_TERRAIN_INT = _DEPRECATED = 5, 6, 11
EQUAL_FRAMES = dict(zip(_DEPRECATED, (mav.FRAME_AMSL, mav.FRAME_RELATIVE, mav.FRAME_TERRAIN), strict=True))
LOCATED = mav.POSITION_COMMANDS | {SET_HOME, LAND_START, ROI_LOCATION, ROI}  # x and y may be a position
_DEGREES = 1e7  # units of x and y in a degree


class MissionType(IntEnum):
    """Type of a list that is transferred (MAV_MISSION_TYPE)."""

    MISSION, FENCE, RALLY = range(3)

    def __str__(self) -> str:
        return ("mission", "fence", "rally points")[self]


class Result(IntEnum):
    """Answer of a vehicle to a transfer (MAV_MISSION_RESULT)."""

    ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE, INVALID = range(6)
    INVALID_PARAM1, INVALID_PARAM2, INVALID_PARAM3, INVALID_PARAM4 = range(6, 10)
    INVALID_PARAM5_X, INVALID_PARAM6_Y, INVALID_PARAM7 = range(10, 13)
    INVALID_SEQUENCE, DENIED, OPERATION_CANCELLED = range(13, 16)


_RESULT_TEXTS = {
    Result.ACCEPTED: "accepted",
    Result.ERROR: "an error, or busy with another transfer",
    Result.UNSUPPORTED_FRAME: "the frame is not supported",
    Result.UNSUPPORTED: "the command is not supported",
    Result.NO_SPACE: "there is no space for it",
    Result.INVALID: "a parameter is invalid",
    **{Result(5 + n): f"parameter {n} is invalid" for n in range(1, 5)},
    Result.INVALID_PARAM5_X: "the latitude (parameter 5) is invalid",
    Result.INVALID_PARAM6_Y: "the longitude (parameter 6) is invalid",
    Result.INVALID_PARAM7: "the altitude (parameter 7) is invalid",
    Result.INVALID_SEQUENCE: "the item was not expected",
    Result.DENIED: "denied, perhaps because another ground station transfers",
    Result.OPERATION_CANCELLED: "the transfer was cancelled",
}


def result_text(number: int) -> str:
    """Return a result for people, also one that is not known.

    Examples
    --------
    >>> result_text(4)
    'there is no space for it (MAV_MISSION_NO_SPACE)'
    """
    if number not in set(Result):
        return f"result {number}"
    return f"{_RESULT_TEXTS[Result(number)]} (MAV_MISSION_{Result(number).name})"


class TransferLostError(LinkError):
    """Transfer that stopped before its end; it may be tried again."""


class RefusedError(LinkError):
    """Refusal of a vehicle to send a list."""


@dataclass(frozen=True, slots=True)
class LinkItem:
    """One item of a mission, a fence or a list of rally points, in the units of the link."""

    command: int  # MAV_CMD
    frame: int  # MAV_FRAME
    params: mav.ItemParams = (0.0, 0.0, 0.0, 0.0)  # None is NaN on the link
    x: int = 0  # latitude in 1e-7 degrees; as it is in frame 2
    y: int = 0  # longitude likewise
    z: float = 0.0  # altitude in metres
    autocontinue: int = 1  # 1 if the next item of the mission follows by itself

    def fields(self, number: int, is_current: bool) -> tuple[Any, ...]:
        """Return the fields of MISSION_ITEM_INT after its target, for the item with this number."""
        params = (math.nan if value is None else value for value in self.params)
        start = (number, self.frame, self.command, int(is_current), self.autocontinue)
        return (*start, *params, self.x, self.y, self.z)

    @classmethod
    def of_message(cls, message: Any) -> "LinkItem":
        """Return the item that MISSION_ITEM_INT carries."""
        first, second, third, fourth = (
            None if math.isnan(value) else _decimal(value)
            for value in (message.param1, message.param2, message.param3, message.param4)
        )
        frame, params = EQUAL_FRAMES.get(message.frame, message.frame), (first, second, third, fourth)
        item = cls(command=message.command, frame=frame, params=params, autocontinue=message.autocontinue)
        return replace(item, x=message.x, y=message.y, z=_decimal(message.z))


def items_of_mission(mission: Mission, has_home_row: bool) -> list[LinkItem]:
    """Return the items of a mission as they are sent: with home as item 0 (ArduPilot), or without."""
    home = mission.home
    x, y = _units(home.lat, home.lon)
    first = LinkItem(command=mav.WAYPOINT, frame=mav.FRAME_AMSL, x=x, y=y, z=home.altitude_m)
    rows = [first] if has_home_row else []
    for item in mission.items:
        in_degrees = item.frame != mav.FRAME_MISSION
        x, y = _units(item.lat, item.lon) if in_degrees else (round(item.lat), round(item.lon))
        row = LinkItem(command=item.command, frame=item.frame, x=x, y=y, z=item.altitude_m)
        params = item.params if has_home_row else _shifted(item, -1)
        rows.append(replace(row, params=params, autocontinue=int(item.autocontinue)))
    return rows


def mission_items(items: Iterable[LinkItem], has_home_row: bool) -> tuple[MissionItem, ...]:
    """Return the items of a mission, without home, from those that a vehicle sent.

    ArduPilot keeps no headings and no frames of items without position: a heading of 0 is read as not set,
    and such items get frame 2.
    """
    return tuple(_mission_item(item, has_home_row) for item in items)


def _mission_item(item: LinkItem, has_home_row: bool) -> MissionItem:
    frame, params = item.frame, item.params
    if has_home_row and item.command not in LOCATED:
        frame = mav.FRAME_MISSION
    if has_home_row and item.command in mav.HEADING_COMMANDS and params[3] == 0:
        params = (*params[:3], None)
    lat, lon = (item.x, item.y) if frame == mav.FRAME_MISSION else (item.x / _DEGREES, item.y / _DEGREES)
    result = MissionItem(
        command=item.command,
        frame=frame,
        params=params,
        lat=float(lat),
        lon=float(lon),
        altitude_m=item.z,
        autocontinue=bool(item.autocontinue),
    )
    return result if has_home_row else replace(result, params=_shifted(result, 1))


def _shifted(item: MissionItem, by: int) -> mav.ItemParams:
    """Renumber the target of a jump: files count from 1, vehicles without a home row from 0."""
    first = item.params[0]
    return (first + by, *item.params[1:]) if item.command == mav.JUMP and first is not None else item.params


def home_of_row(item: LinkItem) -> HomePosition | None:
    """Return home from item 0 of ArduPilot; None if it has none yet."""
    is_set = item.x != 0 or item.y != 0
    return HomePosition(item.x / _DEGREES, item.y / _DEGREES, item.z) if is_set else None


def items_of_fence(fence: Iterable[mav.Fence]) -> list[LinkItem]:
    """Return a fence as it is sent: an item for each vertex, with their number, and for each circle."""
    items = []
    for shape in fence:
        if isinstance(shape, FencePolygon):
            command = POLYGON_INCLUSION if shape.inclusion else POLYGON_EXCLUSION
            size = float(len(shape.vertices))
        else:
            command = CIRCLE_INCLUSION if shape.inclusion else CIRCLE_EXCLUSION
            size = shape.radius_m
        items += [
            LinkItem(command, mav.FRAME_AMSL, (size, 0.0, 0.0, 0.0), *_units(*position))
            for position in shape.positions
        ]
    return items


def fence_of_items(items: Sequence[LinkItem]) -> tuple[mav.Fence, ...]:
    """Return the fence that a vehicle sent, without its return point.

    A MissionError says that an item is not one of a fence, or that a polygon has fewer vertices than it says.
    """
    rest = iter(item for item in items if item.command != FENCE_RETURN)
    return tuple(_fence_shape(item, rest) for item in rest)


def _fence_shape(item: LinkItem, rest: Iterator[LinkItem]) -> mav.Fence:
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
    """Return rally points as they are sent."""
    return [
        LinkItem(RALLY_POINT, mav.FRAME_RELATIVE, (0.0,) * 4, *_units(point.lat, point.lon), point.altitude_m)
        for point in rally
    ]


def rally_of_items(items: Iterable[LinkItem]) -> tuple[RallyPoint, ...]:
    """Return the rally points that a vehicle sent."""
    return tuple(RallyPoint(item.x / _DEGREES, item.y / _DEGREES, item.z) for item in items)


def _units(lat: float, lon: float) -> tuple[int, int]:
    return round(lat * _DEGREES), round(lon * _DEGREES)


def _decimal(value: float) -> float:
    """Return the shortest number that rounds to a 32-bit float: 45.1, not 45.099998474."""
    return float(str(np.float32(value)))
