"""DJI's WPML as published: elements, whether they are required, their values and their order.

Written from the tables and the sample files of DJI's Cloud API documentation (DJI WPML: template.kml,
waylines.wpml, common elements, product support), and from nothing of the writer.
"""

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

from pyproj import Geod

KML = "{http://www.opengis.net/kml/2.2}"
WPML = "{http://www.dji.com/wpmz/1.0.2}"


def number(low: float = -math.inf, high: float = math.inf, *, above: bool = False) -> Callable[[str], bool]:
    def check(text: str) -> bool:
        value = float(text)
        return math.isfinite(value) and low <= value <= high and not (above and value == low)

    return check


def whole(low: int, high: int) -> Callable[[str], bool]:
    return lambda text: bool(re.fullmatch(r"-?\d+", text)) and low <= int(text) <= high


def one_of(*words: str) -> Callable[[str], bool]:
    return lambda text: text in words


def some_of(*words: str) -> Callable[[str], bool]:
    return lambda text: set(text.split(",")) <= set(words)


def text(value: str) -> bool:
    return bool(value)


def position(value: str) -> bool:
    lon, lat = map(float, value.split(","))
    return -180 <= lon <= 180 and -90 <= lat <= 90


def is_target(value: str) -> bool:
    lat, lon, height = map(float, value.split(","))
    return -90 <= lat <= 90 and -180 <= lon <= 180 and math.isfinite(height)


def turn_m(placemark: ET.Element) -> str:
    return placemark.findtext(f"{WPML}waypointTurnParam/{WPML}waypointTurnDampingDist") or "0"


def leg_m(before: ET.Element, after: ET.Element) -> float:
    """Length over the globe, with climb."""
    places = [(one.findtext(f"{KML}Point/{KML}coordinates") or "").split(",") for one in (before, after)]
    (lon, lat), (other_lon, other_lat) = (tuple(map(float, place)) for place in places)
    heights = [
        float(one.findtext(f"{WPML}executeHeight") or one.findtext(f"{WPML}height") or 0)
        for one in (before, after)
    ]
    along = Geod(ellps="WGS84").inv(lon, lat, other_lon, other_lat)[2]
    return math.hypot(along, heights[1] - heights[0])


PASSES = "toPointAndPassWithContinuityCurvature"
FLAG = one_of("0", "1")
INDEX = whole(0, 65535)


@dataclass
class Element:
    """What an element may hold: a value, or others in this order; * many, ? optional."""

    value: Callable[[str], bool] | None = None
    children: dict[str, "Element"] = field(default_factory=dict)


def of(**children: Element) -> Element:
    return Element(children={key.replace("__", "?").replace("_s", "*"): one for key, one in children.items()})


def leaf(check: Callable[[str], bool]) -> Element:
    return Element(check)


LENSES = some_of("wide", "zoom", "ir", "narrow_band", "visable")  # as DJI spells it, since 2024
DRONES = {(60, 0), (67, 0), (67, 1), (77, 0), (77, 1), (77, 2), (89, 0), (91, 0), (91, 1), (99, 0), (99, 1)}
PAYLOADS = ("42", "43", "61", "82", "83", "52", "53", "66", "67", "68", "80", "81", "88", "89")
TURNS = one_of(
    "coordinateTurn",
    "toPointAndStopWithDiscontinuityCurvature",
    "toPointAndStopWithContinuityCurvature",
    "toPointAndPassWithContinuityCurvature",
)
HEADING = of(
    waypointHeadingMode=leaf(one_of("followWayline", "manually", "fixed", "smoothTransition", "towardPOI")),
    waypointHeadingAngle__=leaf(whole(-180, 180)),
    waypointPoiPoint__=leaf(text),
    waypointHeadingPathMode=leaf(one_of("clockwise", "counterClockwise", "followBadArc")),
)
TURN = of(waypointTurnMode=leaf(TURNS), waypointTurnDampingDist__=leaf(number(0)))
FUNCTIONS = {
    "takePhoto": of(
        fileSuffix=leaf(text),
        payloadLensIndex=leaf(LENSES),
        useGlobalPayloadLensIndex=leaf(FLAG),
        payloadPositionIndex=leaf(whole(0, 2)),
    ),
    "hover": of(hoverTime=leaf(number(0, above=True))),
    "gimbalRotate": of(
        gimbalHeadingYawBase=leaf(one_of("north")),
        gimbalRotateMode=leaf(one_of("relativeAngle", "absoluteAngle")),
        gimbalPitchRotateEnable=leaf(FLAG),
        gimbalPitchRotateAngle=leaf(number(-120, 45)),
        gimbalRollRotateEnable=leaf(FLAG),
        gimbalRollRotateAngle=leaf(number(-180, 180)),
        gimbalYawRotateEnable=leaf(FLAG),
        gimbalYawRotateAngle=leaf(number(-180, 180)),
        gimbalRotateTimeEnable=leaf(FLAG),
        gimbalRotateTime=leaf(number(0)),
        payloadPositionIndex=leaf(whole(0, 2)),
    ),
}
ACTION = of(
    actionId=leaf(INDEX), actionActuatorFunc=leaf(one_of(*FUNCTIONS)), actionActuatorFuncParam=Element()
)
GROUP = of(
    actionGroupId=leaf(INDEX),
    actionGroupStartIndex=leaf(INDEX),
    actionGroupEndIndex=leaf(INDEX),
    actionGroupMode=leaf(one_of("sequence")),
    actionTrigger=of(
        actionTriggerType=leaf(
            one_of("reachPoint", "betweenAdjacentPoints", "multipleTiming", "multipleDistance")
        ),
        actionTriggerParam__=leaf(number(0, above=True)),
    ),
    action_s=ACTION,
)
CONFIG = of(
    flyToWaylineMode=leaf(one_of("safely", "pointToPoint")),
    finishAction=leaf(one_of("goHome", "noAction", "autoLand", "gotoFirstWaypoint")),
    exitOnRCLost=leaf(one_of("goContinue", "executeLostAction")),
    executeRCLostAction__=leaf(one_of("goBack", "landing", "hover")),
    takeOffSecurityHeight=leaf(number(2, 1500)),
    takeOffRefPoint__=leaf(text),
    takeOffRefPointAGLHeight__=leaf(number()),
    globalTransitionalSpeed=leaf(number(0, 15, above=True)),
    globalRTHHeight=leaf(number(2, 1500)),
    droneInfo=of(droneEnumValue=leaf(whole(0, 999)), droneSubEnumValue=leaf(whole(0, 9))),
    payloadInfo=of(payloadEnumValue=leaf(one_of(*PAYLOADS)), payloadPositionIndex=leaf(whole(0, 2))),
)
POINT = of(coordinates=leaf(position))
SPEED = leaf(number(0, 15, above=True))
TEMPLATE = of(
    author__=leaf(text),
    createTime__=leaf(whole(0, 10**14)),
    updateTime__=leaf(whole(0, 10**14)),
    missionConfig=CONFIG,
    Folder=of(
        templateType=leaf(one_of("waypoint", "mapping2d", "mapping3d", "mappingStrip")),
        templateId=leaf(INDEX),
        waylineCoordinateSysParam=of(
            coordinateMode=leaf(one_of("WGS84")),
            heightMode=leaf(one_of("EGM96", "relativeToStartPoint", "aboveGroundLevel")),
            positioningType__=leaf(one_of("GPS", "RTKBaseStation", "QianXun", "Custom")),
        ),
        autoFlightSpeed=SPEED,
        globalHeight=leaf(number()),
        gimbalPitchMode=leaf(one_of("manual", "usePointSetting")),
        globalWaypointHeadingParam=HEADING,
        globalWaypointTurnMode=leaf(TURNS),
        globalUseStraightLine__=leaf(FLAG),
        Placemark_s=of(
            Point=POINT,
            index=leaf(INDEX),
            ellipsoidHeight__=leaf(number()),
            height__=leaf(number()),
            useGlobalHeight=leaf(FLAG),
            useGlobalSpeed=leaf(FLAG),
            useGlobalHeadingParam=leaf(FLAG),
            useGlobalTurnParam=leaf(FLAG),
            waypointSpeed__=SPEED,
            waypointHeadingParam__=HEADING,
            waypointTurnParam__=TURN,
            useStraightLine__=leaf(FLAG),
            gimbalPitchAngle__=leaf(number(-120, 45)),
            actionGroup_s=GROUP,
        ),
        payloadParam__=of(payloadPositionIndex=leaf(whole(0, 2)), imageFormat=leaf(LENSES)),
    ),
)
WAYLINES = of(
    missionConfig=CONFIG,
    Folder=of(
        templateId=leaf(INDEX),
        executeHeightMode=leaf(one_of("WGS84", "relativeToStartPoint", "realTimeFollowSurface")),
        waylineId=leaf(INDEX),
        autoFlightSpeed=SPEED,
        Placemark_s=of(
            Point=POINT,
            index=leaf(INDEX),
            executeHeight=leaf(number()),
            waypointSpeed=SPEED,
            waypointHeadingParam=HEADING,
            waypointTurnParam=TURN,
            useStraightLine__=leaf(FLAG),
            actionGroup_s=GROUP,
        ),
    ),
)
OF_KML = {"Document", "Folder", "Placemark", "Point", "coordinates"}


def faults(document: bytes, schema: Element) -> list[str]:
    """What a document has that the format does not allow, and what it lacks."""
    root = ET.fromstring(document)
    if root.tag != f"{KML}kml" or [child.tag for child in root] != [f"{KML}Document"]:
        return ["the root is a kml element of KML 2.2 with one Document"]
    found = _faults(root[0], schema, "Document")
    return found or _relations(root[0])


def _faults(element: ET.Element, schema: Element, path: str) -> list[str]:
    if schema.value is not None:
        return [] if not len(element) and schema.value(element.text or "") else [f"{path}: {element.text!r}"]
    if path.endswith("actionActuatorFuncParam"):
        return []  # its children follow from the function, see `_relations`
    names = [_name(child) for child in element]
    order = {key.strip("?*"): place for place, key in enumerate(schema.children)}
    found = [f"{path}: {name} is not an element of it" for name in names if name not in order]
    if found:
        return found
    if [order[name] for name in names] != sorted(order[name] for name in names):
        found.append(f"{path}: the order {names}")
    for key in schema.children:
        count = names.count(key.strip("?*"))
        if (count > 1 and not key.endswith("*")) or (count < 1 and key[-1] not in "?*"):
            found.append(f"{path}: {count} {key}")
    for child in element:
        key = next(key for key in schema.children if key.strip("?*") == _name(child))
        found += _faults(child, schema.children[key], f"{path}/{_name(child)}")
    return found


def _name(element: ET.Element) -> str:
    """The local name; elements of another namespace than DJI documents are marked."""
    space, _, name = element.tag.rpartition("}")
    expected = KML if name in OF_KML else WPML
    return name if f"{space}}}" == expected else element.tag


def _relations(document: ET.Element) -> list[str]:
    """Rules between elements."""
    found = []

    def text_of(parent: ET.Element, name: str) -> str | None:
        return parent.findtext(f"{WPML}{name}")

    config = document.find(f"{WPML}missionConfig")
    assert config is not None
    info = config.find(f"{WPML}droneInfo")
    assert info is not None
    drone = (int(text_of(info, "droneEnumValue") or -1), int(text_of(info, "droneSubEnumValue") or -1))
    if drone not in DRONES:
        found.append(f"there is no aircraft {drone}")
    if text_of(config, "exitOnRCLost") == "executeLostAction" and not text_of(config, "executeRCLostAction"):
        found.append("executeRCLostAction is required")
    placemarks = document.findall(f".//{KML}Placemark")
    if [text_of(one, "index") for one in placemarks] != [str(n) for n in range(len(placemarks))]:
        found.append("indices of waypoints are 0, 1, 2 ...")
    for one in placemarks:
        for flag, needed in (
            ("useGlobalHeight", ("ellipsoidHeight", "height")),
            ("useGlobalSpeed", ("waypointSpeed",)),
        ):
            if text_of(one, flag) == "0" and not all(text_of(one, name) for name in needed):
                found.append(f"{needed} are required where {flag} is 0")
        for flag, name in (
            ("useGlobalHeadingParam", "waypointHeadingParam"),
            ("useGlobalTurnParam", "waypointTurnParam"),
        ):
            if text_of(one, flag) == "0" and one.find(f"{WPML}{name}") is None:
                found.append(f"{name} is required where {flag} is 0")
    for heading in document.iter(f"{WPML}waypointHeadingParam"):
        smooth = text_of(heading, "waypointHeadingMode") == "smoothTransition"
        if smooth and text_of(heading, "waypointHeadingAngle") is None:
            found.append("smoothTransition needs an angle")
        target = text_of(heading, "waypointPoiPoint")
        if (text_of(heading, "waypointHeadingMode") == "towardPOI") != (target is not None):
            found.append("towardPOI needs a point, and nothing else does")
        if target is not None and not is_target(target):
            found.append(f"a point of interest {target}")
    for one in placemarks:
        turn = one.find(f"{WPML}waypointTurnParam")
        passes = turn is not None and text_of(turn, "waypointTurnMode") == PASSES
        if passes and (text_of(one, "useStraightLine") != "1" or not float(turn_m(one)) > 0):
            found.append("to pass needs straight lines and a distance above 0")
    for before, after in pairwise(placemarks):
        if not float(turn_m(before)) + float(turn_m(after)) < leg_m(before, after):
            found.append("turns are longer than the leg between them")
    groups = list(document.iter(f"{WPML}actionGroup"))
    ids = [text_of(group, "actionGroupId") for group in groups]
    if ids != [str(n) for n in range(len(ids))]:
        found.append("ids of action groups are 0, 1, 2 ...")
    for group in groups:
        first, last = (int(text_of(group, f"actionGroup{end}Index") or -1) for end in ("Start", "End"))
        if not first <= last < len(placemarks):
            found.append(f"an action group from {first} to {last}")
        trigger = group.find(f"{WPML}actionTrigger")
        assert trigger is not None
        kind = text_of(trigger, "actionTriggerType") or ""
        if kind.startswith("multiple") != (text_of(trigger, "actionTriggerParam") is not None):
            found.append(f"the parameter of the trigger {kind}")
        actions = group.findall(f"{WPML}action")
        if not actions or [text_of(a, "actionId") for a in actions] != [str(n) for n in range(len(actions))]:
            found.append("ids of actions are 0, 1, 2 ...")
        for action in actions:
            function = text_of(action, "actionActuatorFunc") or ""
            params = action.find(f"{WPML}actionActuatorFuncParam")
            assert params is not None
            found += _faults(params, FUNCTIONS[function], function)
    return found
