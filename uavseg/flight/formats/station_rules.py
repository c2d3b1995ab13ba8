"""Rules of ground stations: what each refuses of a .plan or .waypoints file.

Transcribed from the loaders of QGroundControl, Mission Planner and MAVSDK.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from uavseg.inputs import parse_json
from uavseg.plain_text import cause_of

QGC, MISSION_PLANNER, MAVSDK = "QGroundControl", "Mission Planner", "MAVSDK"
WPL_FIELDS = 12
_SURVEY_INTEGERS = ("angle", "entryLocation")
_CAMERA_INTEGERS = ("AdjustedFootprintFrontal", "AdjustedFootprintSide", "DistanceToSurface")

Rule = Callable[[Any], Iterator[str]]


def station_refusals(content: bytes, suffix: str) -> dict[str, str]:
    """Return why each program refuses a .plan or .waypoints file, empty where it loads it.

    `content` is that of a file that `read_mission` reads. Nothing is returned for other formats.
    """
    if suffix == ".plan":
        plan = parse_json(content.decode())
        rules: dict[str, Rule] = {QGC: _qgc_plan, MISSION_PLANNER: _planner_plan, MAVSDK: _mavsdk_plan}
        return {name: _first_reason(rule, plan) for name, rule in rules.items()}
    if suffix == ".waypoints":
        text = content.decode()
        return {QGC: next(_qgc_rows(text), ""), MISSION_PLANNER: "", MAVSDK: next(_mavsdk_rows(text), "")}
    return {}


def _first_reason(rule: Rule, plan: Any) -> str:
    """Return the first reason of a rule; a member of a wrong type, which the loaders refuse too, is one."""
    try:
        return next(rule(plan), "")
    except (KeyError, TypeError, AttributeError) as error:
        return cause_of(error)


def _qgc_plan(plan: Mapping[str, Any]) -> Iterator[str]:
    for key in ("fileType", "groundStation", "version", "mission", "geoFence", "rallyPoints"):
        if plan.get(key) is None:
            yield f"it has no {key}"
    mission = plan["mission"]
    for key in ("firmwareType", "plannedHomePosition", "items"):
        if mission.get(key) is None:
            yield f"mission has no {key}"
    if len(mission["plannedHomePosition"]) != 3:
        yield "plannedHomePosition has not three numbers"
    yield from _qgc_items(mission["items"])
    for polygon in plan["geoFence"].get("polygons") or []:
        for key in ("version", "inclusion", "polygon"):
            if key not in polygon:
                yield f"a polygon of the fence has no {key}"


def _qgc_items(items: list[Mapping[str, Any]]) -> Iterator[str]:
    for number, item in enumerate(_simple_items(items), start=1):
        for key in ("command", "frame", "params", "autoContinue"):
            if key not in item:
                yield f"item {number} has no {key}"
        if len(item["params"]) != 7:
            yield f"item {number} has {len(item['params'])} params instead of 7"


def _planner_plan(plan: Mapping[str, Any]) -> Iterator[str]:
    """Yield what Mission Planner refuses: it reads some numbers as integers, and nothing of the fence."""
    mission = plan["mission"]
    for key in ("cruiseSpeed", "hoverSpeed"):
        if not _is_whole(mission.get(key, 0)):
            yield f"{key} is not a whole number"
    for item in mission["items"]:
        if item["type"] == "SimpleItem":
            continue
        transect = item.get("TransectStyleComplexItem") or {}
        camera = transect.get("CameraCalc") or {}
        for holder, keys in ((item, _SURVEY_INTEGERS), (camera, _CAMERA_INTEGERS)):
            for key in keys:
                if not _is_whole(holder.get(key, 0)):
                    yield f"{key} of a survey is not a whole number; give it a .waypoints file"


def _mavsdk_plan(plan: Mapping[str, Any]) -> Iterator[str]:
    if type(plan["version"]) is not int or type(plan["mission"]["version"]) is not int:
        yield "a version is not an integer"
    for key in ("geoFence", "rallyPoints"):
        if (plan.get(key) or {}).get("version") != 2:
            yield f"{key} is missing or not of version 2"
    if len(plan["mission"].get("plannedHomePosition") or [0, 0, 0]) != 3:
        yield "plannedHomePosition has not three numbers"
    for number, item in enumerate(_simple_items(plan["mission"]["items"]), start=1):
        if "autoContinue" not in item:
            yield f"item {number} has no autoContinue"


def _simple_items(items: list[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    for item in items:
        if item["type"] == "SimpleItem":
            yield item
        else:
            yield from item["TransectStyleComplexItem"]["Items"]


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) or (isinstance(value, float) and value.is_integer())


def _qgc_rows(text: str) -> Iterator[str]:
    for number, row in enumerate(text.splitlines()[1:], start=2):
        if not row.strip() or row.startswith("#"):
            yield f"line {number} is blank or a comment"
        elif len(row.split("\t")) != WPL_FIELDS:
            yield f"line {number} has not {WPL_FIELDS} fields separated by TAB"


def _mavsdk_rows(text: str) -> Iterator[str]:
    if "\r" in text:
        yield "its lines end with CR LF"
    for number, row in enumerate(text.splitlines()[1:], start=2):
        if row.strip() and not row.startswith("#") and len(row.split("\t")) != WPL_FIELDS:
            yield f"line {number} has not {WPL_FIELDS} fields separated by TAB"
