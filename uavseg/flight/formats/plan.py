"""QGroundControl's .plan files.

A survey item holds the items that are flown besides the outline and the camera from which QGroundControl
plans them again after an edit. Its keys are those that QGroundControl requires of version 5.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.formats.waypoints import ItemReader
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import FenceCircle, FencePolygon, HomePosition, MissionItem, RallyPoint
from uavseg.flight.mission.mission import Mission, SurveyBlock
from uavseg.inputs import parse_json
from uavseg.plain_text import shown

# QGroundControl's enum, by MAV_FRAME
ALTITUDE_MODES = {mav.FRAME_RELATIVE: 1, mav.FRAME_AMSL: 2, mav.FRAME_TERRAIN: 4}
SURVEY_VERSION = 5
MANUAL_CAMERA, CUSTOM_CAMERA = "Manual (no camera specs)", "Custom Camera"
_MIXED = 0  # of the same enum: items differ
_QUADROTOR = 2  # MAV_TYPE
_PLANE_SPEED_M_S = 15  # .plan requires a fixed-wing speed; a multirotor does not use it
_VERSION, _SHAPE_VERSION = 2, 1


@dataclass(frozen=True, slots=True)
class BlockItems:
    """Survey block, and the range of the items of a mission that fly it: `first` to before `stop`."""

    block: SurveyBlock
    first: int
    stop: int


def find_blocks(mission: Mission) -> list[BlockItems]:
    """Find the blocks whose waypoints are all in the mission, one after another, with nothing but triggers.

    They are in the order of the items, without overlap; of convex cells alone.
    """
    visits = [number for number, item in enumerate(mission.items) if item.command == mav.WAYPOINT]
    at = [(mission.items[number].lat, mission.items[number].lon) for number in visits]
    result = []
    for block in mission.blocks:
        if not block.is_editable:
            continue
        count = len(block.waypoints)
        for part in (list(block.waypoints), list(block.waypoints[::-1])):
            begins = (k for k, place in enumerate(at) if place == part[0] and at[k : k + count] == part)
            if (begin := next(begins, None)) is not None:
                result += _matching(mission, block, visits[begin], visits[begin + count - 1])
                break
    result.sort(key=lambda one: one.first)
    return [one for k, one in enumerate(result) if not k or one.first >= result[k - 1].stop]


def _matching(mission: Mission, block: SurveyBlock, first: int, last: int) -> list[BlockItems]:
    """Return the range of items with the trigger that ends it, if it holds only waypoints and triggers."""
    stop = last + 1
    if stop < len(mission.items) and mission.items[stop].command == mav.CAMERA_DISTANCE:
        stop += 1
    others = [item for item in mission.items[first:stop] if item.command != mav.CAMERA_DISTANCE]
    plain = all(one.command == mav.WAYPOINT and one.frame == mav.FRAME_RELATIVE for one in others)
    return [BlockItems(block, first, stop)] if plain else []


def survey_item(
    block: SurveyBlock, items: Sequence[MissionItem], written: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """Write a block as a ComplexItem of version 5, from the items that fly it and the same as SimpleItems."""
    flown = [(item.lat, item.lon) for item in items if item.command == mav.WAYPOINT]
    triggers = [item.params for item in items if item.command == mav.CAMERA_DISTANCE]
    lat, lon = (sum(values) / len(block.outline) for values in zip(*block.outline, strict=True))
    return {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "version": SURVEY_VERSION,
        "angle": round((block.angle_deg + 90) % 180 - 90, 6),  # of transects, from -90 to 90
        # where the lines begin: 0 top left, 1 top right, 2 bottom left, 3 bottom right
        "entryLocation": 2 * int(flown[0][0] < lat) + int(flown[0][1] >= lon),
        "flyAlternateTransects": False,
        "splitConcavePolygons": False,
        "polygon": [list(position) for position in block.outline],
        "TransectStyleComplexItem": {
            "version": 2,
            "TurnAroundDistance": 0,
            "CameraTriggerInTurnAround": False,
            "HoverAndCapture": False,
            "Refly90Degrees": False,
            "CameraShots": sum(bool(params[2]) for params in triggers),
            "VisualTransectPoints": [list(position) for position in flown],
            "Items": list(written),
            "CameraCalc": _camera_calc(
                block, max((float(params[0] or 0) for params in triggers), default=0.0)
            ),
        },
    }


def _camera_calc(block: SurveyBlock, trigger_m: float) -> dict[str, Any]:
    """Write spacing, trigger distance and camera as QGroundControl's CameraCalc."""
    calc = {
        "version": 2,
        "CameraName": MANUAL_CAMERA,
        "DistanceMode": ALTITUDE_MODES[mav.FRAME_RELATIVE],
        "DistanceToSurface": block.height_m,
        "AdjustedFootprintSide": block.spacing_m,
        "AdjustedFootprintFrontal": trigger_m,
    }
    if block.photos is None:
        return calc
    photos, camera = block.photos, block.photos.camera
    return calc | {
        "CameraName": CUSTOM_CAMERA,
        "AdjustedFootprintFrontal": photos.trigger_m(block.height_m),
        "ValueSetIsDistance": True,
        "ImageDensity": 100 * camera.gsd_m(block.height_m),
        "FrontalOverlap": photos.overlap.front,
        "SideOverlap": photos.overlap.side,
        "SensorWidth": camera.sensor_mm[0],
        "SensorHeight": camera.sensor_mm[1],
        "ImageWidth": camera.image_px[0],
        "ImageHeight": camera.image_px[1],
        "FocalLength": camera.focal_mm,
        "Landscape": True,
        "FixedOrientation": False,
        "MinTriggerInterval": camera.min_interval_s,
    }


def items_of_survey(item: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the simple items that a survey item holds, which are what is flown.

    A MissionError says that it is another complex item than a survey of version 5, or holds no items.
    """
    item_type = shown(item.get("complexItemType", item["type"]), quoted=False)
    if item_type != "survey" or item.get("version") != SURVEY_VERSION:
        version = f" of version {shown(item.get('version'))}" if item_type == "survey" else ""
        raise MissionError(
            f"it holds a {item_type} item{version}; only simple items and surveys of version 5 can be read"
        )
    items: list[Mapping[str, Any]] = item["TransectStyleComplexItem"]["Items"]
    if not items:
        raise MissionError("it holds a survey item without waypoints; open and save it in QGroundControl")
    return items


def plan_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return which waypoints are not editable, if `options.editable` is set."""
    if not options.editable:
        return []
    if not mission.blocks:
        return ["nothing of this mission can be edited as a survey in QGroundControl: it has no survey lines"]
    blocks = find_blocks(mission)
    is_visit = [item.command == mav.WAYPOINT for item in mission.items]
    single = sum(is_visit) - sum(sum(is_visit[one.first : one.stop]) for one in blocks)
    if not single:
        return []
    parts = "part" if len(blocks) == 1 else "parts"
    return [
        f"{len(blocks)} {parts} of the survey can be edited in QGroundControl; {single} waypoints of others "
        "(concave, or flown otherwise than in plain lines) are written as single items"
    ]


def write_plan(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .plan file, with every key that any reader requires.

    With `options.editable`, the survey lines of convex parts are survey items, which QGroundControl can edit,
    with the same waypoints and triggers in them.
    """
    home = mission.home
    modes = {ALTITUDE_MODES[item.frame] for item in mission.items if item.has_position}
    plan = {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "mission": {
            "version": 2,
            "firmwareType": mav.AUTOPILOTS[mission.autopilot],
            "vehicleType": _QUADROTOR,
            "cruiseSpeed": _PLANE_SPEED_M_S,
            "hoverSpeed": max(round(mission.speed_m_s), 1),  # Mission Planner reads integers only
            "globalPlanAltitudeMode": modes.pop() if len(modes) == 1 else _MIXED,
            "plannedHomePosition": [home.lat, home.lon, home.altitude_m],
            "items": list(_written_items(mission, find_blocks(mission) if options.editable else [])),
        },
        "geoFence": _fence_to_json(mission.fence),
        "rallyPoints": {"version": _VERSION, "points": [[p.lat, p.lon, p.altitude_m] for p in mission.rally]},
    }
    return f"{json.dumps(plan, indent=1, allow_nan=False)}\n".encode()


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
    autopilot = {number: name for name, number in mav.AUTOPILOTS.items()}.get(mission["firmwareType"])
    if autopilot is None:
        raise MissionError(
            f"its firmwareType is {shown(mission['firmwareType'])}; "
            "expected 3 (ArduPilot), 12 (PX4) or 0 (generic)"
        )
    home = HomePosition(*(float(value or 0.0) for value in mission["plannedHomePosition"]))
    geofence = {} if plan.get("geoFence") is None else plan["geoFence"]
    rally = plan.get("rallyPoints") or {}
    reader = ItemReader(home, autopilot)
    items = reader.read(simple_items(mission["items"]), _fields_of)
    breach = ("the breach return point of the fence was not read",) if geofence.get("breachReturn") else ()
    return Mission(
        home=home,
        items=items,
        autopilot=autopilot,
        name=name,
        notes=(*breach, *reader.notes),
        fence=_fence_from_json(geofence),
        rally=tuple(
            RallyPoint(float(lat), float(lon), float(altitude_m))
            for lat, lon, altitude_m in rally.get("points") or []
        ),
    )


def simple_items(items: Sequence[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """Yield simple items, also those of surveys."""
    for item in items:
        if item["type"] == "SimpleItem":
            yield item
        else:
            yield from items_of_survey(item)


def _fields_of(item: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `MissionItem` of a simple item."""
    if item["type"] != "SimpleItem":
        raise MissionError(f"an item of a survey is of type {shown(item['type'])}; expected SimpleItem")
    first, second, third, fourth, *place = (None if p is None else float(p) for p in item["params"])
    lat, lon, altitude_m = (value or 0.0 for value in place)
    autocontinue = item.get("autoContinue", True)
    if not isinstance(autocontinue, bool):
        raise MissionError(f"autoContinue is {shown(autocontinue)}; expected true or false")
    return {
        "command": int(item["command"]),
        "frame": int(item["frame"]),
        "params": (first, second, third, fourth),
        "lat": lat,
        "lon": lon,
        "altitude_m": altitude_m,
        "autocontinue": autocontinue,
    }


def _fence_to_json(fence: Iterable[mav.Fence]) -> dict[str, Any]:
    """Write a fence as a `geoFence` object, with every key that QGroundControl requires."""
    polygons: list[dict[str, Any]] = []
    circles: list[dict[str, Any]] = []
    for shape in fence:
        common = {"version": _SHAPE_VERSION, "inclusion": shape.inclusion}
        if isinstance(shape, FencePolygon):
            polygons.append(common | {"polygon": [list(vertex) for vertex in shape.vertices]})
        else:
            circles.append(common | {"circle": {"center": [shape.lat, shape.lon], "radius": shape.radius_m}})
    return {"version": _VERSION, "circles": circles, "polygons": polygons}


def _fence_from_json(geofence: Mapping[str, Any]) -> tuple[mav.Fence, ...]:
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


def _inclusion(shape: Mapping[str, Any]) -> bool:
    """Return whether a shape keeps the vehicle in; without the key, readers disagree about its meaning."""
    inclusion = shape["inclusion"]
    if not isinstance(inclusion, bool):
        raise MissionError(f"inclusion of a fence is true or false, not {shown(inclusion)}")
    return inclusion
