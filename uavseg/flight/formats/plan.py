"""QGroundControl's .plan files."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.formats.survey_item import (
    ALTITUDE_MODES,
    BlockItems,
    find_blocks,
    items_of_survey,
    survey_item,
)
from uavseg.flight.mission.fence import Fence, FenceCircle, FencePolygon, RallyPoint
from uavseg.flight.mission.items import AUTOPILOTS, WAYPOINT, HomePosition, MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.inputs import parse_json
from uavseg.plain_text import cause_of, shown

_MIXED = 0  # of the same enum: items differ
_QUADROTOR = 2  # MAV_TYPE
_PLANE_SPEED_M_S = 15  # .plan requires a fixed-wing speed; a multirotor does not use it
_MISFITS = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError)
_VERSION, _SHAPE_VERSION = 2, 1


def write_plan(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .plan file."""
    return plan_text(mission, options.editable).encode()


def plan_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return which waypoints are not editable, if `options.editable` is set."""
    if not options.editable:
        return []
    if not mission.blocks:
        return ["nothing of this mission can be edited as a survey in QGroundControl: it has no survey lines"]
    blocks = find_blocks(mission)
    inside = sum(item.command == WAYPOINT for one in blocks for item in mission.items[one.first : one.stop])
    single = sum(item.command == WAYPOINT for item in mission.items) - inside
    if not single:
        return []
    parts = "part" if len(blocks) == 1 else "parts"
    return [
        f"{len(blocks)} {parts} of the survey can be edited in QGroundControl; {single} waypoints of others "
        "(concave, or flown otherwise than in plain lines) are written as single items"
    ]


def plan_text(mission: Mission, editable: bool = False) -> str:
    """Write a mission as the text of a .plan file, with every key that any reader requires.

    Parameters
    ----------
    mission : Mission
    editable : bool
        Whether the survey lines of convex parts are written as survey items, which QGroundControl can edit,
        with the same waypoints and triggers in them.
    """
    home = mission.home
    plan = {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOTS[mission.autopilot],
            "vehicleType": _QUADROTOR,
            "cruiseSpeed": _PLANE_SPEED_M_S,
            "hoverSpeed": max(round(mission.speed_m_s), 1),  # Mission Planner reads integers only
            "globalPlanAltitudeMode": _altitude_mode(mission),
            "plannedHomePosition": [home.lat, home.lon, home.altitude_m],
            "items": list(_written_items(mission, find_blocks(mission) if editable else [])),
        },
        "geoFence": _fence_to_json(mission.fence),
        "rallyPoints": _rally_to_json(mission.rally),
    }
    return json.dumps(plan, indent=1, allow_nan=False) + "\n"


def _altitude_mode(mission: Mission) -> int:
    """Return QGroundControl's mode of all heights; mixed where items differ, so that each keeps its mode."""
    modes = {ALTITUDE_MODES[item.frame] for item in mission.items if item.has_position}
    return modes.pop() if len(modes) == 1 else _MIXED


def _written_items(mission: Mission, blocks: Sequence[BlockItems]) -> Iterator[dict[str, Any]]:
    simple = [_simple_item(number, item) for number, item in enumerate(mission.items, start=1)]
    done = 0
    for one in blocks:
        part = slice(one.first, one.stop)
        yield from simple[done : one.first]
        yield survey_item(one.block, mission.items[part], simple[part])
        done = one.stop
    yield from simple[done:]


def _simple_item(number: int, item: MissionItem) -> dict[str, Any]:
    written: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": item.autocontinue,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [*map(_integral, item.params), item.lat, item.lon, _integral(item.altitude_m)],
    }
    if item.has_position:
        mode = ALTITUDE_MODES[item.frame]
        written |= {"AltitudeMode": mode, "Altitude": _integral(item.altitude_m), "AMSLAltAboveTerrain": None}
    return written


def _integral(value: float | None) -> float | int | None:
    """Return 3.0 as 3: shorter to read, and the same number."""
    return int(value) if value is not None and value.is_integer() and abs(value) < 2**53 else value


def read_plan(content: bytes, name: str) -> Mission:
    """Read a .plan file: simple items, and the items that surveys of version 5 hold."""
    plan = parse_json(content.decode())
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan":
        raise MissionError('it is not a plan: "fileType" is not "Plan"')
    if plan["version"] != 1 or plan["mission"]["version"] != 2:
        raise MissionError("only version 1 of .plan with version 2 of missions can be read")
    mission = plan["mission"]
    autopilot = {number: name for name, number in AUTOPILOTS.items()}.get(mission["firmwareType"])
    if autopilot is None:
        raise MissionError(
            f"its firmwareType is {shown(mission['firmwareType'])}; "
            "expected 3 (ArduPilot), 12 (PX4) or 0 (generic)"
        )
    home = HomePosition(*(float(value or 0.0) for value in mission["plannedHomePosition"]))
    geofence = {} if plan.get("geoFence") is None else plan["geoFence"]
    items = tuple(_numbered(number, item) for number, item in enumerate(_flat(mission["items"]), start=1))
    breach = ("the breach return point of the fence was not read",) if geofence.get("breachReturn") else ()
    return Mission(
        home=home,
        items=items,
        autopilot=autopilot,
        name=name,
        notes=breach,
        fence=_fence_from_json(geofence),
        rally=_rally_from_json(plan.get("rallyPoints")),
    )


def _flat(items: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield simple items, also those of surveys."""
    for item in items:
        if item["type"] == "SimpleItem":
            yield item
        else:
            yield from items_of_survey(item)


def _numbered(number: int, item: Mapping[str, Any]) -> MissionItem:
    """Read an item; errors name its number."""
    try:
        return _item_of_plan(item)
    except MissionError as error:
        raise MissionError(f"item {number}: {error}") from error
    except _MISFITS as error:
        raise MissionError(f"item {number}: {cause_of(error)}") from error


def _item_of_plan(item: Mapping[str, Any]) -> MissionItem:
    if item["type"] != "SimpleItem":
        raise MissionError(f"an item of a survey is of type {shown(item['type'])}; expected SimpleItem")
    first, second, third, fourth, *place = (None if p is None else float(p) for p in item["params"])
    lat, lon, altitude_m = (value or 0.0 for value in place)
    autocontinue = item.get("autoContinue", True)
    if not isinstance(autocontinue, bool):
        raise MissionError(f"autoContinue is {shown(autocontinue)}; expected true or false")
    return MissionItem(
        command=int(item["command"]),
        frame=int(item["frame"]),
        params=(first, second, third, fourth),
        lat=lat,
        lon=lon,
        altitude_m=altitude_m,
        autocontinue=autocontinue,
    )


def _fence_to_json(fence: Iterable[Fence]) -> dict[str, Any]:
    """Write a fence as a `geoFence` object, with every key that QGroundControl requires."""
    polygons: list[dict[str, Any]] = []
    circles: list[dict[str, Any]] = []
    for shape in fence:
        common = {"version": _SHAPE_VERSION, "inclusion": shape.inclusion}
        if isinstance(shape, FencePolygon):
            polygons.append(common | {"polygon": [list(vertex) for vertex in shape.vertices]})
        else:
            circle = {"center": [shape.lat, shape.lon], "radius": shape.radius_m}
            circles.append(common | {"circle": circle})
    return {"version": _VERSION, "circles": circles, "polygons": polygons}


def _rally_to_json(rally: Iterable[RallyPoint]) -> dict[str, Any]:
    """Write latitude, longitude and height above home of rally points as a `rallyPoints` object."""
    return {"version": _VERSION, "points": [[point.lat, point.lon, point.altitude_m] for point in rally]}


def _fence_from_json(geofence: Mapping[str, Any]) -> tuple[Fence, ...]:
    """Read the polygons, then the circles of a `geoFence` object."""
    polygons = [
        FencePolygon(tuple((float(lat), float(lon)) for lat, lon in shape["polygon"]), _inclusion(shape))
        for shape in geofence.get("polygons") or []
    ]
    circles = []
    for shape in geofence.get("circles") or []:
        lat, lon = shape["circle"]["center"]
        circles.append(
            FenceCircle(float(lat), float(lon), float(shape["circle"]["radius"]), _inclusion(shape))
        )
    return (*polygons, *circles)


def _rally_from_json(rally: Mapping[str, Any] | None) -> tuple[RallyPoint, ...]:
    points = (rally or {}).get("points") or []
    return tuple(RallyPoint(float(lat), float(lon), float(altitude_m)) for lat, lon, altitude_m in points)


def _inclusion(shape: Mapping[str, Any]) -> bool:
    """Return whether a shape keeps the vehicle in; without the key, readers disagree about its meaning."""
    inclusion = shape["inclusion"]
    if not isinstance(inclusion, bool):
        raise MissionError(f"inclusion of a fence is true or false, not {shown(inclusion)}")
    return inclusion
