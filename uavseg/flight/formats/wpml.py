"""DJI's waypoint markup language (WPML): the two documents of a .kmz, by DJI's published format.

`template.kml` is what DJI Pilot 2 and FlightHub 2 show and edit, `waylines.wpml` what the aircraft flies.
Elements, their order and values are those of the Cloud API documentation (developer.dji.com, DJI WPML:
template.kml, waylines.wpml, common elements; namespace http://www.dji.com/wpmz/1.0.2).
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from uavseg.errors import MissionError
from uavseg.flight.formats.options import DjiModel
from uavseg.flight.formats.route import FINISH_LAND, FINISH_NONE, FINISH_RETURN, Route, RoutePoint
from uavseg.flight.formats.xml_text import child, xml_text
from uavseg.flight.mission.items import FRAME_RELATIVE
from uavseg.flight.mission.mission import CRUISE_M_S

NAMESPACE = "http://www.dji.com/wpmz/1.0.2"
KML_NAMESPACE = "http://www.opengis.net/kml/2.2"
MAX_SPEED_M_S = 15.0
GROUPS = 3  # of actions at a waypoint, at most
MAX_WAYPOINTS = 65535 // GROUPS  # numbers of action groups end at 65535
MIN_TAKEOFF_M, MAX_HEIGHT_M = 2.0, 1500.0
HEIGHT_MODE = "relativeToStartPoint"
TURN_MODE = "toPointAndStopWithDiscontinuityCurvature"  # straight legs: no corner is cut
FINISH_ACTIONS = {FINISH_RETURN: "goHome", FINISH_LAND: "autoLand", FINISH_NONE: "noAction"}
LENS = "wide"


@dataclass(frozen=True, slots=True)
class Trigger:
    """Photographs from waypoint `first` to waypoint `last`, at equal times or distances."""

    first: int
    last: int
    kind: str
    step: float


def template_kml(route: Route, model: DjiModel) -> bytes:
    """The document `wpmz/template.kml`: a template of waypoint flight."""
    root, document = _document()
    child(document, "wpml:author", "uavseg")
    _mission_config(document, route, model)
    folder = child(document, "Folder")
    child(folder, "wpml:templateType", "waypoint")
    child(folder, "wpml:templateId", "0")
    system = child(folder, "wpml:waylineCoordinateSysParam")
    child(system, "wpml:coordinateMode", "WGS84")
    child(system, "wpml:heightMode", HEIGHT_MODE)
    child(folder, "wpml:autoFlightSpeed", speed_of(route.points[0]))
    child(folder, "wpml:globalHeight", route.points[0].altitude_m)
    child(folder, "wpml:gimbalPitchMode", "manual")
    heading = child(folder, "wpml:globalWaypointHeadingParam")
    _heading(heading, None)
    child(folder, "wpml:globalWaypointTurnMode", TURN_MODE)
    child(folder, "wpml:globalUseStraightLine", "1")
    for index, placemark in _placemarks(folder, route):
        point = route.points[index]
        child(placemark, "wpml:ellipsoidHeight", point.altitude_m)  # as DJI writes it in this height mode
        child(placemark, "wpml:height", point.altitude_m)
        for name in ("Height", "Speed", "HeadingParam", "TurnParam"):
            child(placemark, f"wpml:useGlobal{name}", "0")
        _flight(placemark, point)
        _action_groups(placemark, route, index)
    payload = child(folder, "wpml:payloadParam")
    child(payload, "wpml:payloadPositionIndex", "0")
    child(payload, "wpml:imageFormat", LENS)
    return xml_text(root)


def waylines_wpml(route: Route, model: DjiModel) -> bytes:
    """The document `wpmz/waylines.wpml`: one wayline, as it is flown."""
    root, document = _document()
    _mission_config(document, route, model)
    folder = child(document, "Folder")
    child(folder, "wpml:templateId", "0")
    child(folder, "wpml:executeHeightMode", HEIGHT_MODE)
    child(folder, "wpml:waylineId", "0")
    child(folder, "wpml:autoFlightSpeed", speed_of(route.points[0]))
    for index, placemark in _placemarks(folder, route):
        child(placemark, "wpml:executeHeight", route.points[index].altitude_m)
        _flight(placemark, route.points[index])
        _action_groups(placemark, route, index)
    return xml_text(root)


def check_route(route: Route, name: str) -> None:
    """Raise MissionError if DJI's format or aircraft do not take a route."""
    if not 2 <= len(route.points) <= MAX_WAYPOINTS:
        raise MissionError(
            f"{name} holds 2 to {MAX_WAYPOINTS} waypoints, and the mission has {len(route.points)}"
        )
    for speed in (approach_speed(route), *map(speed_of, route.points)):
        if not 0 < speed <= MAX_SPEED_M_S:
            raise MissionError(
                f"DJI's aircraft fly waypoints at up to {MAX_SPEED_M_S:g} m/s, and the mission asks for "
                f"{speed:g} m/s (--speed)"
            )
    if any(point.frame != FRAME_RELATIVE for point in route.points):
        raise MissionError(
            f"{name} cannot hold heights above the terrain; plan with heights above home, or with --terrain "
            "absolute"
        )


def speed_of(point: RoutePoint) -> float:
    """The speed from a waypoint on; the usual one where the mission sets none."""
    return CRUISE_M_S if point.speed_m_s is None else point.speed_m_s


def approach_speed(route: Route) -> float:
    """The speed on the way to the first waypoint."""
    return speed_of(route.points[0]) if route.approach_m_s is None else route.approach_m_s


def _document() -> tuple[ET.Element, ET.Element]:
    root = ET.Element("kml", {"xmlns": KML_NAMESPACE, "xmlns:wpml": NAMESPACE})
    return root, child(root, "Document")


def _mission_config(document: ET.Element, route: Route, model: DjiModel) -> None:
    """Global parameters; if the link is lost, the aircraft leaves the wayline and returns."""
    highest = max(point.altitude_m for point in route.points)
    takeoff = route.points[0].altitude_m if route.takeoff_m is None else route.takeoff_m
    config = child(document, "wpml:missionConfig")
    child(config, "wpml:flyToWaylineMode", "safely")
    child(config, "wpml:finishAction", FINISH_ACTIONS[route.finish])
    child(config, "wpml:exitOnRCLost", "executeLostAction")
    child(config, "wpml:executeRCLostAction", "goBack")
    child(config, "wpml:takeOffSecurityHeight", min(max(takeoff, MIN_TAKEOFF_M), MAX_HEIGHT_M))
    child(config, "wpml:globalTransitionalSpeed", approach_speed(route))
    child(config, "wpml:globalRTHHeight", max(highest, takeoff, MIN_TAKEOFF_M))
    drone = child(config, "wpml:droneInfo")
    child(drone, "wpml:droneEnumValue", str(model.drone))
    child(drone, "wpml:droneSubEnumValue", str(model.drone_sub))
    payload = child(config, "wpml:payloadInfo")
    child(payload, "wpml:payloadEnumValue", str(model.payload))
    child(payload, "wpml:payloadPositionIndex", "0")


def _placemarks(folder: ET.Element, route: Route) -> Iterator[tuple[int, ET.Element]]:
    for index, point in enumerate(route.points):
        placemark = child(folder, "Placemark")
        place = f"{_degrees(point.lon)},{_degrees(point.lat)}"
        child(child(placemark, "Point"), "coordinates", place)
        child(placemark, "wpml:index", str(index))
        yield index, placemark


def _degrees(value: float) -> str:
    """Degrees without exponent, read back equal."""
    return np.format_float_positional(value, unique=True, trim="0")


def _flight(placemark: ET.Element, point: RoutePoint) -> None:
    """Speed, heading and turn at a waypoint."""
    child(placemark, "wpml:waypointSpeed", speed_of(point))
    _heading(child(placemark, "wpml:waypointHeadingParam"), point.heading_deg)
    turn = child(placemark, "wpml:waypointTurnParam")
    child(turn, "wpml:waypointTurnMode", TURN_MODE)
    child(turn, "wpml:waypointTurnDampingDist", "0")
    child(placemark, "wpml:useStraightLine", "1")


def _heading(parent: ET.Element, heading_deg: float | None) -> None:
    child(parent, "wpml:waypointHeadingMode", "followWayline" if heading_deg is None else "smoothTransition")
    if heading_deg is not None:
        child(parent, "wpml:waypointHeadingAngle", str(round((heading_deg + 180) % 360 - 180)))
    child(parent, "wpml:waypointHeadingPathMode", "followBadArc")


def _action_groups(placemark: ET.Element, route: Route, index: int) -> None:
    """What is done at a waypoint, then what begins there."""
    point, before = route.points[index], route.points[index - 1] if index else None
    at_point = []
    if point.pitch_deg is not None and (before is None or point.pitch_deg != before.pitch_deg):
        at_point.append("gimbalRotate")
    if point.hold_s:
        at_point.append("hover")
    if point.photo:
        at_point.append("takePhoto")
    if at_point:
        group = _group(placemark, GROUPS * index, (index, index), "reachPoint", None)
        for number, function in enumerate(at_point):
            _action(group, number, function, point)
    for offset, trigger in enumerate(_triggers_at(route.points, index), start=1):
        waypoints = (trigger.first, trigger.last)
        group = _group(placemark, GROUPS * index + offset, waypoints, trigger.kind, trigger.step)
        _action(group, 0, "takePhoto", point)


def _triggers_at(points: Sequence[RoutePoint], index: int) -> Iterator[Trigger]:
    """Series of photographs that begin at a waypoint."""
    for kind, name in (("multipleDistance", "trigger_m"), ("multipleTiming", "interval_s")):
        steps = [getattr(point, name) for point in points[index:]]
        if not steps[0] or (index and getattr(points[index - 1], name) == steps[0]):
            continue
        last = next((k for k, step in enumerate(steps) if step != steps[0]), len(steps) - 1)
        if last:
            yield Trigger(index, index + last, kind, steps[0])


def _group(
    placemark: ET.Element, number: int, waypoints: tuple[int, int], kind: str, step: float | None
) -> ET.Element:
    group = child(placemark, "wpml:actionGroup")
    child(group, "wpml:actionGroupId", str(number))
    child(group, "wpml:actionGroupStartIndex", str(waypoints[0]))
    child(group, "wpml:actionGroupEndIndex", str(waypoints[1]))
    child(group, "wpml:actionGroupMode", "sequence")
    trigger = child(group, "wpml:actionTrigger")
    child(trigger, "wpml:actionTriggerType", kind)
    if step is not None:
        child(trigger, "wpml:actionTriggerParam", step)
    return group


def _action(group: ET.Element, number: int, function: str, point: RoutePoint) -> None:
    action = child(group, "wpml:action")
    child(action, "wpml:actionId", str(number))
    child(action, "wpml:actionActuatorFunc", function)
    params = child(action, "wpml:actionActuatorFuncParam")
    if function == "hover":
        child(params, "wpml:hoverTime", point.hold_s)
        return
    if function == "takePhoto":
        child(params, "wpml:fileSuffix", "uavseg")
        child(params, "wpml:payloadLensIndex", LENS)
        child(params, "wpml:useGlobalPayloadLensIndex", "1")
    else:
        _gimbal(params, point.pitch_deg or 0.0)
    child(params, "wpml:payloadPositionIndex", "0")


def _gimbal(params: ET.Element, pitch_deg: float) -> None:
    child(params, "wpml:gimbalHeadingYawBase", "north")
    child(params, "wpml:gimbalRotateMode", "absoluteAngle")
    for axis, angle in (("Pitch", pitch_deg), ("Roll", 0.0), ("Yaw", 0.0)):
        child(params, f"wpml:gimbal{axis}RotateEnable", str(int(axis == "Pitch")))
        child(params, f"wpml:gimbal{axis}RotateAngle", angle)
    child(params, "wpml:gimbalRotateTimeEnable", "0")
    child(params, "wpml:gimbalRotateTime", "0")
