"""DJI's waypoint markup language (WPML): the two documents of a .kmz, by DJI's published format.

`template.kml` is what DJI Pilot 2 and FlightHub 2 show and edit, `waylines.wpml` what the aircraft flies.
Elements, their order and values are those of the Cloud API documentation (developer.dji.com, DJI WPML:
template.kml, waylines.wpml, common elements; namespace http://www.dji.com/wpmz/1.0.2).

DJI Fly, of consumer aircraft, has a dialect of its own, which DJI does not publish: another namespace, a
template without waypoints, no payload, and no photographs between waypoints. It is written as in files that
the app saved on its controllers.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count

from uavseg.errors import MissionError
from uavseg.flight.formats import wayline as waylines
from uavseg.flight.formats.kml import KML_NAMESPACE, child, parse_xml, xml_text
from uavseg.flight.formats.options import TURN_THROUGH, DjiModel, FileOptions
from uavseg.flight.formats.wayline import Wayline, WaylinePoint, legs_m
from uavseg.flight.formats.waypoints import decimal
from uavseg.flight.mission.items import FRAME_RELATIVE, FRAME_TERRAIN
from uavseg.plain_text import shown

NAMESPACE = "http://www.dji.com/wpmz/1.0.2"
FLY_NAMESPACE = "http://www.uav.com/wpmz/1.0.2"
MAX_SPEED_M_S = 15.0
MAX_WAYPOINTS = 65535  # of items of a mission there are fewer, and so of action groups
MIN_LEG_M = 0.5
MIN_TAKEOFF_M, MAX_HEIGHT_M = 2.0, 1500.0
HEIGHT_MODE = "relativeToStartPoint"
TURN_MODE = "toPointAndStopWithDiscontinuityCurvature"  # straight legs: no corner is cut
PASS_MODE = "toPointAndPassWithContinuityCurvature"  # with straight legs: turns before the waypoint
TURN_M = 2.0
"""How far before a waypoint the aircraft turns where it does not stop, as far as ArduPilot does."""
TURN_SHARE = 0.45  # of a leg at most, as the turns at both of its ends must be shorter than it
FINISH_ACTIONS = {
    waylines.FINISH_RETURN: "goHome",
    waylines.FINISH_LAND: "autoLand",
    waylines.FINISH_NONE: "noAction",
}
SPELLING = {"visible": "visable"}  # as DJI writes and documents it
CREATED_MS = "315532800000"  # 1980, as in the archive: the same mission gives the same bytes
NOWHERE = "0.000000,0.000000,0.000000"
_FRAMES = {HEIGHT_MODE: FRAME_RELATIVE, "realTimeFollowSurface": FRAME_TERRAIN}
_SERIES = {"multipleDistance": "trigger_m", "multipleTiming": "interval_s"}


def template_kml(wayline: Wayline, options: FileOptions) -> bytes:
    """Write the document `wpmz/template.kml`: a template of waypoint flight, for DJI Fly without them."""
    root, document = _document(options.model)
    if options.model.is_for_fly:
        _add(document, author="fly", createTime=CREATED_MS, updateTime=CREATED_MS)
        _mission_config(document, wayline, options.model)
        return xml_text(root)
    child(document, "wpml:author", "uavseg")
    _mission_config(document, wayline, options.model)
    folder = child(document, "Folder")
    _add(folder, templateType="waypoint", templateId="0")
    _add(child(folder, "wpml:waylineCoordinateSysParam"), coordinateMode="WGS84", heightMode=HEIGHT_MODE)
    first = wayline.points[0]
    _add(folder, autoFlightSpeed=first.flown_m_s, globalHeight=first.altitude_m, gimbalPitchMode="manual")
    heading = child(folder, "wpml:globalWaypointHeadingParam")
    _add(heading, waypointHeadingMode="followWayline", waypointHeadingPathMode="followBadArc")
    turn_mode = PASS_MODE if options.turn == TURN_THROUGH else TURN_MODE
    _add(folder, globalWaypointTurnMode=turn_mode, globalUseStraightLine="1")
    turns_m, numbers = _turns_m(wayline, options), count()
    for index, placemark in _placemarks(folder, wayline):
        point = wayline.points[index]
        # DJI writes the same as ellipsoidHeight in this height mode
        _add(placemark, ellipsoidHeight=point.altitude_m, height=point.altitude_m)
        for name in ("Height", "Speed", "HeadingParam", "TurnParam"):
            child(placemark, f"wpml:useGlobal{name}", "0")
        _flight(placemark, point, turns_m[index], options.model)
        _action_groups(placemark, wayline, index, options, numbers)
    _add(child(folder, "wpml:payloadParam"), payloadPositionIndex="0", imageFormat=_lens_text(options))
    return xml_text(root)


def waylines_wpml(wayline: Wayline, options: FileOptions) -> bytes:
    """Write the document `wpmz/waylines.wpml`: one wayline, as it is flown."""
    root, document = _document(options.model)
    _mission_config(document, wayline, options.model)
    folder = child(document, "Folder")
    _add(folder, templateId="0", executeHeightMode=HEIGHT_MODE, waylineId="0")
    if options.model.is_for_fly:
        _add(folder, distance="0", duration="0")  # as the app leaves them
    child(folder, "wpml:autoFlightSpeed", wayline.points[0].flown_m_s)
    turns_m, numbers = _turns_m(wayline, options), count()
    for index, placemark in _placemarks(folder, wayline):
        child(placemark, "wpml:executeHeight", wayline.points[index].altitude_m)
        _flight(placemark, wayline.points[index], turns_m[index], options.model)
        _action_groups(placemark, wayline, index, options, numbers)
        if options.model.is_for_fly:
            gimbal = child(placemark, "wpml:waypointGimbalHeadingParam")  # the actions turn it
            _add(gimbal, waypointGimbalPitchAngle="0", waypointGimbalYawAngle="0")
    return xml_text(root)


def check_wayline(wayline: Wayline, name: str) -> None:
    """Raise MissionError if DJI's format or aircraft do not take a wayline; `name` is that of the format."""
    if not 2 <= len(wayline.points) <= MAX_WAYPOINTS:
        raise MissionError(
            f"{name} holds 2 to {MAX_WAYPOINTS} waypoints, and the mission has {len(wayline.points)}"
        )
    for speed in (_approach_speed(wayline), *(point.flown_m_s for point in wayline.points)):
        if not 0 < speed <= MAX_SPEED_M_S:
            raise MissionError(
                f"DJI's aircraft fly waypoints at up to {MAX_SPEED_M_S:g} m/s, and the mission asks for "
                f"{speed:g} m/s (--speed)"
            )
    if any(point.frame != FRAME_RELATIVE for point in wayline.points):
        raise MissionError(
            f"{name} cannot hold heights above the terrain; plan with heights above home, or with --terrain "
            "absolute"
        )
    for number, leg_m in enumerate(legs_m(wayline.points), start=1):
        if leg_m < MIN_LEG_M:
            raise MissionError(
                f"DJI's aircraft fly legs of {MIN_LEG_M:g} m at least, and the one from waypoint {number} to "
                f"{number + 1} is {leg_m:.2f} m long; plan with a larger --tolerance or --min-leg"
            )


def _approach_speed(wayline: Wayline) -> float:
    """Return the speed on the leg to the first waypoint."""
    return wayline.points[0].flown_m_s if wayline.approach_m_s is None else wayline.approach_m_s


def _add(parent: ET.Element, **texts: str | float) -> None:
    """Append child elements of DJI's namespace, in this order."""
    for tag, text in texts.items():
        child(parent, f"wpml:{tag}", text)


def _document(model: DjiModel) -> tuple[ET.Element, ET.Element]:
    namespace = FLY_NAMESPACE if model.is_for_fly else NAMESPACE
    root = ET.Element("kml", {"xmlns": KML_NAMESPACE, "xmlns:wpml": namespace})
    return root, child(root, "Document")


def _lens_text(options: FileOptions) -> str:
    return ",".join(SPELLING.get(lens, lens) for lens in options.lenses)


def _turns_m(wayline: Wayline, options: FileOptions) -> list[float]:
    """Return how far before each waypoint the aircraft turns; 0 where it stops."""
    # It stops at the first and last one, where it waits, and for a photograph in hover.
    turns = [0.0] * len(wayline.points)
    if options.turn == TURN_THROUGH:
        legs = legs_m(wayline.points)
        for index, point in enumerate(wayline.points[1:-1], start=1):
            if not (point.hold_s or point.photo):
                turns[index] = round(min(TURN_M, TURN_SHARE * min(legs[index - 1 : index + 1])), 3)
    return turns


def _mission_config(document: ET.Element, wayline: Wayline, model: DjiModel) -> None:
    """Write global parameters; if the link is lost, the aircraft leaves the wayline and returns."""
    takeoff = wayline.points[0].altitude_m if wayline.takeoff_m is None else wayline.takeoff_m
    config = child(document, "wpml:missionConfig")
    _add(config, flyToWaylineMode="safely", finishAction=FINISH_ACTIONS[wayline.finish])
    _add(config, exitOnRCLost="executeLostAction", executeRCLostAction="goBack")
    if not model.is_for_fly:
        child(config, "wpml:takeOffSecurityHeight", min(max(takeoff, MIN_TAKEOFF_M), MAX_HEIGHT_M))
    child(config, "wpml:globalTransitionalSpeed", _approach_speed(wayline))
    if not model.is_for_fly:
        child(config, "wpml:globalRTHHeight", return_height_m(wayline))
    drone = child(config, "wpml:droneInfo")
    _add(drone, droneEnumValue=str(model.drone), droneSubEnumValue=str(model.drone_sub))
    if not model.is_for_fly:
        payload = child(config, "wpml:payloadInfo")
        _add(payload, payloadEnumValue=str(model.payload), payloadPositionIndex="0")


def return_height_m(wayline: Wayline) -> float:
    """Return the height above home at which the aircraft returns: that of the highest waypoint."""
    return max(MIN_TAKEOFF_M, wayline.takeoff_m or 0.0, *(point.altitude_m for point in wayline.points))


def _placemarks(folder: ET.Element, wayline: Wayline) -> Iterator[tuple[int, ET.Element]]:
    for index, point in enumerate(wayline.points):
        placemark = child(folder, "Placemark")
        child(child(placemark, "Point"), "coordinates", f"{decimal(point.lon, 1)},{decimal(point.lat, 1)}")
        child(placemark, "wpml:index", str(index))
        yield index, placemark


def _flight(placemark: ET.Element, point: WaylinePoint, turn_m: float, model: DjiModel) -> None:
    """Write speed, heading and turn at a waypoint."""
    child(placemark, "wpml:waypointSpeed", point.flown_m_s)
    _heading(child(placemark, "wpml:waypointHeadingParam"), point, model)
    turn = child(placemark, "wpml:waypointTurnParam")
    _add(turn, waypointTurnMode=PASS_MODE if turn_m else TURN_MODE, waypointTurnDampingDist=turn_m)
    child(placemark, "wpml:useStraightLine", "1")


def _heading(parent: ET.Element, point: WaylinePoint, model: DjiModel) -> None:
    """Write where the nose points at a waypoint and on the leg from there; DJI Fly has all elements."""
    mode, angle, place = "followWayline", None, None
    if point.looks_at is not None:
        lat, lon, height_m = point.looks_at
        mode, place = "towardPOI", f"{decimal(lat, 6)},{decimal(lon, 6)},{decimal(height_m, 6)}"
    elif point.heading_deg is not None:
        mode, angle = "smoothTransition", str(round((point.heading_deg + 180) % 360 - 180))
    child(parent, "wpml:waypointHeadingMode", mode)
    if angle or model.is_for_fly:
        child(parent, "wpml:waypointHeadingAngle", angle or "0")
    if place or model.is_for_fly:
        child(parent, "wpml:waypointPoiPoint", place or NOWHERE)
    if model.is_for_fly:
        child(parent, "wpml:waypointHeadingAngleEnable", str(int(angle is not None)))
    child(parent, "wpml:waypointHeadingPathMode", "followBadArc")
    if model.is_for_fly:
        child(parent, "wpml:waypointHeadingPoiIndex", "0")


def _action_groups(
    placemark: ET.Element, wayline: Wayline, index: int, options: FileOptions, numbers: Iterator[int]
) -> None:
    """Write the actions at a waypoint, then those that begin there; DJI Fly knows the first alone."""
    point, before = wayline.points[index], wayline.points[index - 1] if index else None
    turned = before is None or (point.gimbal_deg, point.looks_at) != (before.gimbal_deg, before.looks_at)
    asked = {"gimbalRotate": turned and point.gimbal_deg is not None, "hover": point.hold_s}
    asked["takePhoto"] = point.photo
    at_point = [function for function, is_asked in asked.items() if is_asked]
    if at_point:
        group = _group(placemark, next(numbers), (index, index), "reachPoint", None)
        for number, function in enumerate(at_point):
            _action(group, number, function, point, options)
    if options.model.is_for_fly:
        return
    for last, trigger, step in _triggers_at(wayline.points, index):
        group = _group(placemark, next(numbers), (index, last), trigger, step)
        _action(group, 0, "takePhoto", point, options)


def _triggers_at(points: Sequence[WaylinePoint], index: int) -> Iterator[tuple[int, str, float]]:
    """Yield the series of photographs that begin at a waypoint."""
    for trigger, name in _SERIES.items():
        steps = [getattr(point, name) for point in points[index:]]
        if not steps[0] or (index and getattr(points[index - 1], name) == steps[0]):
            continue
        last = next((k for k, step in enumerate(steps) if step != steps[0]), len(steps) - 1)
        if last:
            yield index + last, trigger, steps[0]


def _group(
    placemark: ET.Element, number: int, waypoints: tuple[int, int], trigger_type: str, step: float | None
) -> ET.Element:
    group = child(placemark, "wpml:actionGroup")
    first, last = map(str, waypoints)
    _add(group, actionGroupId=str(number), actionGroupStartIndex=first, actionGroupEndIndex=last)
    child(group, "wpml:actionGroupMode", "sequence")
    trigger = child(group, "wpml:actionTrigger")
    child(trigger, "wpml:actionTriggerType", trigger_type)
    if step is not None:
        child(trigger, "wpml:actionTriggerParam", step)
    return group


def _action(group: ET.Element, number: int, function: str, point: WaylinePoint, options: FileOptions) -> None:
    action = child(group, "wpml:action")
    _add(action, actionId=str(number), actionActuatorFunc=function)
    params = child(action, "wpml:actionActuatorFuncParam")
    if function == "hover":
        child(params, "wpml:hoverTime", point.hold_s)
        return
    if function == "gimbalRotate":
        yaw_base = "aircraft" if options.model.is_for_fly else "north"
        _add(params, gimbalHeadingYawBase=yaw_base, gimbalRotateMode="absoluteAngle")
        for axis, angle in (("Pitch", point.gimbal_deg or 0.0), ("Roll", 0.0), ("Yaw", 0.0)):
            child(params, f"wpml:gimbal{axis}RotateEnable", str(int(axis == "Pitch")))
            child(params, f"wpml:gimbal{axis}RotateAngle", angle)
        _add(params, gimbalRotateTimeEnable="0", gimbalRotateTime="0")
    elif options.lenses:  # the global ones are those of `imageFormat` in the template
        lenses = _lens_text(options)
        _add(params, fileSuffix="uavseg", payloadLensIndex=lenses, useGlobalPayloadLensIndex="1")
    else:
        child(params, "wpml:useGlobalPayloadLensIndex", "0")
    child(params, "wpml:payloadPositionIndex", "0")


def read_waylines(document: bytes) -> tuple[Wayline, list[str]]:
    """Read the one wayline of `waylines.wpml`, with notes of what was not read.

    A MissionError says that it holds none or several, or that its heights are above the ellipsoid.
    """
    root = parse_xml(document)
    config = _one(root, "Document/missionConfig")
    folders = root.findall("Document/Folder")
    if len(folders) != 1:
        raise MissionError(f"it holds {len(folders)} waylines; only files with one can be read")
    reader = _Reader(_frame(_text(folders[0], "executeHeightMode")))
    placemarks = folders[0].findall("Placemark")
    if not placemarks:
        raise MissionError("it holds no waypoints")
    for index, placemark in enumerate(placemarks):
        reader.add_point(index, placemark, _number_at(folders[0], "autoFlightSpeed"))
    for placemark in placemarks:
        for group in placemark.findall("actionGroup"):
            reader.add_group(group)
    pitch = None
    points = []
    for point in reader.points:  # a pitch holds until the next one, but for those of a place to look at
        pitch = pitch if point.pitch_deg is None or point.looks_at else point.pitch_deg
        points.append(replace(point, pitch_deg=pitch))
    wayline = Wayline(
        points=tuple(points),
        takeoff_m=_number_at(config, "takeOffSecurityHeight", max(reader.points[0].altitude_m, 1.0)),
        approach_m_s=_number_at(config, "globalTransitionalSpeed"),
        finish=_finish(_text(config, "finishAction"), reader.notes),
    )
    return wayline, list(reader.notes)


class _Reader:
    """Waypoints that are read, with notes of what is not."""

    def __init__(self, frame: int) -> None:
        self.frame = frame
        self.points: list[WaylinePoint] = []
        self.notes: dict[str, None] = {}

    def add_point(self, index: int, placemark: ET.Element, speed_m_s: float) -> None:
        place = _text(placemark, "Point/coordinates").split(",")
        if len(place) not in (2, 3) or int(_number_at(placemark, "index")) != index:
            raise MissionError(f"placemark {index} is not waypoint {index} with longitude,latitude")
        lon, lat = _float(place[0]), _float(place[1])
        heading, looks_at = None, None
        mode = placemark.findtext("waypointHeadingParam/waypointHeadingMode", "followWayline")
        target = placemark.findtext("waypointHeadingParam/waypointPoiPoint")
        if mode == "smoothTransition":
            heading = _number_at(placemark, "waypointHeadingParam/waypointHeadingAngle")
        elif mode == "towardPOI" and target is not None:
            numbers = [_float(part, "waypointPoiPoint") for part in target.split(",")]
            if len(numbers) != 3:
                raise MissionError(f"waypointPoiPoint is {shown(target)}; expected latitude,longitude,height")
            looks_at = numbers[0], numbers[1], numbers[2]
        elif mode != "followWayline":
            self.notes[f"the heading mode {shown(mode)} was not read"] = None
        if placemark.findtext("waypointTurnParam/waypointTurnMode", TURN_MODE) != TURN_MODE:
            note = "the aircraft does not stop at waypoints and may cut corners: this was not read"
            self.notes[note] = None
        speed = _number_at(placemark, "waypointSpeed", speed_m_s)
        height = _number_at(placemark, "executeHeight")
        point = WaylinePoint(lat=lat, lon=lon, altitude_m=height, frame=self.frame, heading_deg=heading)
        self.points.append(replace(point, speed_m_s=speed, looks_at=looks_at))

    def add_group(self, group: ET.Element) -> None:
        first = int(_number_at(group, "actionGroupStartIndex"))
        last = int(_number_at(group, "actionGroupEndIndex"))
        if not 0 <= first <= last < len(self.points):
            raise MissionError(f"a group of actions is for waypoints {first} to {last}, which are not there")
        for action in group.findall("action"):
            self._add_action(action, first, last, group)

    def _add_action(self, action: ET.Element, first: int, last: int, group: ET.Element) -> None:
        trigger = _text(group, "actionTrigger/actionTriggerType")
        function = _text(action, "actionActuatorFunc")
        if function == "takePhoto" and trigger in _SERIES:
            step = _number_at(group, "actionTrigger/actionTriggerParam")
            for index in range(first, last):
                self._change(index, **{_SERIES[trigger]: step})
        elif trigger != "reachPoint":
            self.notes[f"the action {shown(function)} between waypoints was not read"] = None
        elif function == "takePhoto":
            self._change(first, photo=True)
        elif function == "hover":
            held = self.points[first].hold_s + _number_at(action, "actionActuatorFuncParam/hoverTime")
            self._change(first, hold_s=held)
        elif (
            function == "gimbalRotate"
            and action.findtext("actionActuatorFuncParam/gimbalPitchRotateEnable") == "1"
            and action.findtext("actionActuatorFuncParam/gimbalRotateMode") == "absoluteAngle"
        ):
            pitch = _number_at(action, "actionActuatorFuncParam/gimbalPitchRotateAngle")
            self._change(first, pitch_deg=pitch)
        else:
            self.notes[f"the action {shown(function)} was not read"] = None

    def _change(self, index: int, **changes: object) -> None:
        self.points[index] = replace(self.points[index], **changes)  # type: ignore[arg-type]


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
    for finish, name in FINISH_ACTIONS.items():
        if name == action:
            return finish
    notes[f"the end {shown(action)} was not read"] = None
    return waylines.FINISH_NONE


def _one(parent: ET.Element, path: str) -> ET.Element:
    element = parent.find(path)
    if element is None:
        raise MissionError(f"it has no element {path}: it is not a mission of DJI")
    return element


def _text(parent: ET.Element, path: str) -> str:
    return (_one(parent, path).text or "").strip()


def _number_at(parent: ET.Element, path: str, default: float | None = None) -> float:
    if default is not None and parent.find(path) is None:
        return default
    return _float(_text(parent, path), path)


def _float(text: str, path: str = "coordinates") -> float:
    try:
        return float(text)
    except ValueError as error:
        raise MissionError(f"{path} is {shown(text)}; expected a number") from error
