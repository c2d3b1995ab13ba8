"""DJI's `waylines.wpml` as a route, as far as a mission holds it."""

import xml.etree.ElementTree as ET
from dataclasses import replace

from uavseg.errors import MissionError
from uavseg.flight.formats.route import FINISH_NONE, Route, RoutePoint
from uavseg.flight.formats.wpml import FINISH_ACTIONS, HEIGHT_MODE
from uavseg.flight.formats.xml_text import parse_xml
from uavseg.flight.mission.items import FRAME_RELATIVE, FRAME_TERRAIN
from uavseg.plain_text import shown

_FRAMES = {HEIGHT_MODE: FRAME_RELATIVE, "realTimeFollowSurface": FRAME_TERRAIN}
_SERIES = {"multipleDistance": "trigger_m", "multipleTiming": "interval_s"}
_KNOWN_TURN = "toPointAndStopWithDiscontinuityCurvature"


def route_of_waylines(document: bytes) -> tuple[Route, list[str]]:
    """The one wayline of a document, and notes of what was not read.

    Raises
    ------
    MissionError
        If it holds none or several, or its heights are above the ellipsoid.
    """
    root = parse_xml(document)
    config = _one(root, "Document/missionConfig")
    folders = root.findall("Document/Folder")
    if len(folders) != 1:
        raise MissionError(f"it holds {len(folders)} waylines; only files with one can be read")
    frame = _frame(_text(folders[0], "executeHeightMode"))
    reader = _Reader(frame)
    placemarks = folders[0].findall("Placemark")
    if not placemarks:
        raise MissionError("it holds no waypoints")
    for index, placemark in enumerate(placemarks):
        reader.add_point(index, placemark, _number(folders[0], "autoFlightSpeed"))
    for placemark in placemarks:
        for group in placemark.findall("actionGroup"):
            reader.add_group(group)
    finish = _finish(_text(config, "finishAction"), reader.notes)
    route = Route(
        tuple(reader.with_pitches()),
        _number(config, "takeOffSecurityHeight"),
        _number(config, "globalTransitionalSpeed"),
        finish,
    )
    return route, list(reader.notes)


class _Reader:
    """Waypoints as they are read, with notes of what is not."""

    def __init__(self, frame: int) -> None:
        self.frame = frame
        self.points: list[RoutePoint] = []
        self.notes: dict[str, None] = {}

    def add_point(self, index: int, placemark: ET.Element, speed_m_s: float) -> None:
        place = _text(placemark, "Point/coordinates").split(",")
        if len(place) not in (2, 3) or int(_number(placemark, "index")) != index:
            raise MissionError(f"placemark {index} is not waypoint {index} with longitude,latitude")
        lon, lat = _float(place[0]), _float(place[1])
        heading = None
        mode = placemark.findtext("waypointHeadingParam/waypointHeadingMode", "followWayline")
        if mode == "smoothTransition":
            heading = _number(placemark, "waypointHeadingParam/waypointHeadingAngle")
        elif mode != "followWayline":
            self.notes[f"the heading mode {shown(mode)} was not read"] = None
        if placemark.findtext("waypointTurnParam/waypointTurnMode", _KNOWN_TURN) != _KNOWN_TURN:
            self.notes["the aircraft does not stop at waypoints and may cut corners: this was not read"] = (
                None
            )
        speed = _number(placemark, "waypointSpeed", speed_m_s)
        height = _number(placemark, "executeHeight")
        self.points.append(RoutePoint(lat, lon, height, self.frame, heading_deg=heading, speed_m_s=speed))

    def add_group(self, group: ET.Element) -> None:
        first = int(_number(group, "actionGroupStartIndex"))
        last = int(_number(group, "actionGroupEndIndex"))
        if not 0 <= first <= last < len(self.points):
            raise MissionError(f"a group of actions is for waypoints {first} to {last}, which are not there")
        kind = _text(group, "actionTrigger/actionTriggerType")
        functions = group.findall("action")
        for action in functions:
            self._add_action(action, kind, first, last, group)

    def _add_action(self, action: ET.Element, kind: str, first: int, last: int, group: ET.Element) -> None:
        function = _text(action, "actionActuatorFunc")
        if function == "takePhoto" and kind in _SERIES:
            step = _number(group, "actionTrigger/actionTriggerParam")
            for index in range(first, last):
                self._change(index, **{_SERIES[kind]: step})
        elif kind != "reachPoint":
            self.notes[f"the action {shown(function)} between waypoints was not read"] = None
        elif function == "takePhoto":
            self._change(first, photo=True)
        elif function == "hover":
            held = self.points[first].hold_s + _number(action, "actionActuatorFuncParam/hoverTime")
            self._change(first, hold_s=held)
        elif function == "gimbalRotate" and _turns_pitch(action):
            pitch = _number(action, "actionActuatorFuncParam/gimbalPitchRotateAngle")
            self._change(first, pitch_deg=pitch)
        else:
            self.notes[f"the action {shown(function)} was not read"] = None

    def _change(self, index: int, **changes: object) -> None:
        self.points[index] = replace(self.points[index], **changes)  # type: ignore[arg-type]

    def with_pitches(self) -> list[RoutePoint]:
        """The waypoints; a pitch holds until the next one."""
        pitch = None
        points = []
        for point in self.points:
            pitch = pitch if point.pitch_deg is None else point.pitch_deg
            points.append(replace(point, pitch_deg=pitch))
        return points


def _turns_pitch(action: ET.Element) -> bool:
    params = action.find("actionActuatorFuncParam")
    return (
        params is not None
        and params.findtext("gimbalPitchRotateEnable") == "1"
        and params.findtext("gimbalRotateMode") == "absoluteAngle"
    )


def _frame(mode: str) -> int:
    if mode == "WGS84":
        raise MissionError(
            "its heights are above the ellipsoid (WGS84), which are not heights above home or the sea; "
            f"save it with heights relative to the takeoff point ({HEIGHT_MODE})"
        )
    if mode not in _FRAMES:
        raise MissionError(f"its executeHeightMode is {shown(mode)}; expected {HEIGHT_MODE}")
    return _FRAMES[mode]


def _finish(action: str, notes: dict[str, None]) -> str:
    found = {name: finish for finish, name in FINISH_ACTIONS.items()}.get(action)
    if found is None:
        notes[f"the end {shown(action)} was not read"] = None
    return FINISH_NONE if found is None else found


def _one(parent: ET.Element, path: str) -> ET.Element:
    found = parent.find(path)
    if found is None:
        raise MissionError(f"it has no element {path}: it is not a mission of DJI")
    return found


def _text(parent: ET.Element, path: str) -> str:
    return (_one(parent, path).text or "").strip()


def _number(parent: ET.Element, path: str, default: float | None = None) -> float:
    if default is not None and parent.find(path) is None:
        return default
    return _float(_text(parent, path), path)


def _float(text: str, path: str = "coordinates") -> float:
    try:
        return float(text)
    except ValueError as error:
        raise MissionError(f"{path} is {shown(text)}; expected a number") from error
