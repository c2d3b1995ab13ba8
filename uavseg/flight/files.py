"""Mission files: read and write QGroundControl's .plan and Mission Planner's .waypoints."""

import json
import os
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from uavseg.atomic import atomic_file
from uavseg.errors import MissionError
from uavseg.flight.fence_json import fence_from_json, fence_to_json, rally_from_json, rally_to_json
from uavseg.flight.items import (
    AUTOPILOTS,
    FRAME_AMSL,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    HEADING_COMMANDS,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission import Mission
from uavseg.inputs import parse_json, read_bytes
from uavseg.plain_text import cause_of, shown

MissionPath = str | os.PathLike[str]

ALTITUDE_MODES = {
    FRAME_RELATIVE: 1,
    FRAME_AMSL: 2,
    FRAME_TERRAIN: 4,
}  # QGroundControl's own enum, by MAV_FRAME
_MIXED = 0  # of the same enum: items differ
_QUADROTOR = 2  # MAV_TYPE
_PLANE_SPEED_M_S = 15  # .plan requires a fixed-wing speed; a multirotor does not use it
_MISFITS = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)
WAYPOINTS_HEADER = "QGC WPL 110"


def write_mission(
    mission: Mission,
    path: MissionPath,
    overwrite: bool = False,
    check: Callable[[Mission], None] | None = None,
) -> None:
    """Write a mission to a file, whole or not at all.

    Parameters
    ----------
    mission : Mission
    path : path
        Its extension selects the format: .plan (QGroundControl, MAVSDK) or .waypoints (Mission Planner,
        mavwp, QGroundControl). A .waypoints file does not store the autopilot; parameters that are not set
        are written as 0, and a fence and rally points are left out with a warning.
    overwrite : bool
        Whether an existing file may be replaced.
    check : function, optional
        Called with the mission as it is read back; where it raises, nothing is written.

    Raises
    ------
    MissionError
        If the extension is not one of these.
    OutputError
        If the file exists, or cannot be written.
    """
    suffix = check_mission_format(path)
    text = _WRITERS[suffix](mission)
    with atomic_file(path, overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        if check is not None:
            check(read_mission(temporary))
    if suffix == ".waypoints" and (mission.fence or mission.rally):
        warnings.warn(
            "a .waypoints file cannot hold a fence or rally points: they were not written; use a .plan",
            stacklevel=2,
        )


def read_mission(path: MissionPath) -> Mission:
    """Read a mission of simple items from a .plan or .waypoints file.

    A mission from `write_mission` is read back equal. A .waypoints file is read as one for ArduPilot,
    and a heading (param4) of 0 in it as not set.

    Raises
    ------
    MissionError
        If the file cannot be read, is not what its extension says, holds survey or other complex items,
        or holds a mission that would not be safe.
    """
    reader = _READERS[check_mission_format(path)]
    try:
        text = read_bytes(path, MissionError).decode()
    except UnicodeDecodeError as error:
        raise MissionError(f"{path} cannot be read as a mission: {cause_of(error)}") from error
    try:
        return reader(text, Path(path).stem)
    except MissionError as error:
        raise MissionError(f"{path}: {error}") from error
    except _MISFITS as error:
        raise MissionError(f"{path} is not a mission that can be read: {cause_of(error)}") from error


def check_mission_format(path: MissionPath) -> str:
    """Check the extension of a mission file and return it: ".plan" or ".waypoints".

    Raises
    ------
    MissionError
        If it is neither.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise MissionError(f"a mission is written as .plan or .waypoints, not as {Path(path).name!r}")
    return suffix


def plan_text(mission: Mission) -> str:
    """A mission as the text of a .plan file, with every key that any reader requires."""
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
            "items": [_simple_item(number, item) for number, item in enumerate(mission.items, start=1)],
        },
        "geoFence": fence_to_json(mission.fence),
        "rallyPoints": rally_to_json(mission.rally),
    }
    return json.dumps(plan, indent=1, allow_nan=False) + "\n"


def _altitude_mode(mission: Mission) -> int:
    """QGroundControl's mode of all heights; mixed where items differ, so that each keeps its own."""
    modes = {ALTITUDE_MODES[item.frame] for item in mission.items if item.has_position}
    return modes.pop() if len(modes) == 1 else _MIXED


def _simple_item(number: int, item: MissionItem) -> dict[str, Any]:
    written: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": True,
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
    """3.0 as 3: shorter to read, and the same number."""
    return int(value) if value is not None and value.is_integer() and abs(value) < 2**53 else value


def waypoints_text(mission: Mission) -> str:
    """A mission as the text of a .waypoints file (QGC WPL 110), home in row 0."""
    home = mission.home
    start = MissionItem(
        WAYPOINT, FRAME_RELATIVE, (0.0,) * 4, home.lat, home.lon, 1.0
    )  # altitude 1: only the position is checked
    rows = [_row(0, 1, FRAME_AMSL, start, home.altitude_m)]
    rows += [_row(n, 0, item.frame, item, item.altitude_m) for n, item in enumerate(mission.items, start=1)]
    return "\n".join([WAYPOINTS_HEADER, *rows]) + "\n"


def _row(number: int, current: int, frame: int, item: MissionItem, altitude_m: float) -> str:
    floats = [*(value or 0.0 for value in item.params), item.lat, item.lon]
    fields = [number, current, frame, item.command, *(_decimal(value, 8) for value in floats)]
    return "\t".join(map(str, [*fields, _decimal(altitude_m, 6), 1]))


def _decimal(value: float, min_decimals: int) -> str:
    """A number without exponent that is read back equal, with at least `min_decimals` decimals."""
    return np.format_float_positional(value, unique=True, min_digits=min_decimals, trim="k")


def _mission_of_plan(text: str, name: str) -> Mission:
    plan = parse_json(text)
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
    geofence = plan.get("geoFence") or {}
    return Mission(
        home,
        tuple(map(_item_of_plan, mission["items"])),
        autopilot,
        name,
        ("the breach return point of the fence was not read",) if geofence.get("breachReturn") else (),
        fence_from_json(geofence),
        rally_from_json(plan.get("rallyPoints")),
    )


def _item_of_plan(item: Mapping[str, Any]) -> MissionItem:
    if item["type"] != "SimpleItem":
        kind = shown(item.get("complexItemType", item["type"]), quoted=False)
        raise MissionError(f"it holds a {kind} item; only simple items can be read")
    first, second, third, fourth, *place = (None if p is None else float(p) for p in item["params"])
    lat, lon, altitude_m = (value or 0.0 for value in place)
    return MissionItem(
        int(item["command"]), int(item["frame"]), (first, second, third, fourth), lat, lon, altitude_m
    )


def _mission_of_waypoints(text: str, name: str) -> Mission:
    header, *rows = text.splitlines()
    if header.split() != WAYPOINTS_HEADER.split():
        raise MissionError(f"its first line is {header[:40]!r}; expected {WAYPOINTS_HEADER!r}")
    home, *items = (_item_of_row(number, row) for number, row in enumerate(rows))
    assert isinstance(home, HomePosition)
    return Mission(home, tuple(item for item in items if isinstance(item, MissionItem)), name=name)


def _item_of_row(number: int, row: str) -> HomePosition | MissionItem:
    fields = row.split("\t")
    if len(fields) != 12 or int(fields[0]) != number:
        raise MissionError(f"line {number + 2} is not item {number} with 12 fields separated by TAB")
    frame, command = int(fields[2]), int(fields[3])
    first, second, third, fourth, lat, lon, altitude_m = map(float, fields[4:11])
    if number == 0:
        return HomePosition(lat, lon, altitude_m)
    heading = None if command in HEADING_COMMANDS and fourth == 0 else fourth
    return MissionItem(command, frame, (first, second, third, heading), lat, lon, altitude_m)


_WRITERS: dict[str, Callable[[Mission], str]] = {".plan": plan_text, ".waypoints": waypoints_text}
_READERS: dict[str, Callable[[str, str], Mission]] = {
    ".plan": _mission_of_plan,
    ".waypoints": _mission_of_waypoints,
}
