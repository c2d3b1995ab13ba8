"""Mission files: writers and readers by extension, GeoJSON for display, and rules of ground stations."""

import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.formats.kml import kml_losses, read_kml, write_kml
from uavseg.flight.formats.kmz import kmz_losses, read_kmz, write_kmz
from uavseg.flight.formats.litchi import litchi_losses, read_litchi, write_litchi
from uavseg.flight.formats.options import TURN_STOP, FileOptions
from uavseg.flight.formats.plan import plan_losses, read_plan, simple_items, write_plan
from uavseg.flight.formats.waypoints import read_waypoints, waypoints_losses, write_waypoints
from uavseg.flight.mission.features import MissionFeature, Place, as_geojson, features_of, mission_of_features
from uavseg.flight.mission.items import TAKEOFFS, HomePosition
from uavseg.flight.mission.mission import Mission
from uavseg.inputs import parse_json, read_bytes
from uavseg.output.atomic import atomic_file
from uavseg.plain_text import cause_of, shown

MAX_BYTES = 64 << 20  # of a mission file; 65 534 items take 20 MB
_MISFITS = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)
QGC, MISSION_PLANNER, MAVSDK = "QGroundControl", "Mission Planner", "MAVSDK"
WPL_FIELDS = 12
_SURVEY_INTEGERS = ("angle", "entryLocation")
_CAMERA_INTEGERS = ("AdjustedFootprintFrontal", "AdjustedFootprintSide", "DistanceToSurface")

Rule = Callable[[Any], Iterator[str]]


def write_geojson(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .geojson file, a feature on each line.

    Heights of GeoJSON count from the ellipsoid (RFC 7946), which heights of missions do not: they are
    attributes, above home, the sea or the terrain, as `height_above` says.
    """
    lines = ",\n".join(json.dumps(as_geojson(one), allow_nan=False) for one in features_of(mission))
    return f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'.encode()


def read_geojson(content: bytes, name: str) -> Mission:
    """Read a .geojson file that `write_geojson` wrote."""
    document = parse_json(content.decode())
    if not isinstance(document, dict) or document.get("type") != "FeatureCollection":
        raise MissionError('it is not GeoJSON: "type" is not "FeatureCollection"')
    return mission_of_features(map(_read_feature, document["features"]), name)


def _read_feature(feature: Mapping[str, Any]) -> MissionFeature:
    properties = feature.get("properties") or {}
    geometry = feature.get("geometry")
    if geometry is None:
        return MissionFeature(str(properties.get("kind")), "", (), values=properties)
    shape, coordinates = geometry["type"], geometry["coordinates"]
    if shape == "Point":
        coordinates = [coordinates]
    elif shape == "Polygon":
        coordinates = coordinates[0][::-1]
    elif shape != "LineString":
        raise MissionError(f"it holds a {shown(shape, quoted=False)}, which no mission has")
    places: tuple[Place, ...] = tuple((float(lat), float(lon), 0.0) for lon, lat, *_ in coordinates)
    return MissionFeature(str(properties.get("kind")), shape, places, values=properties)


@dataclass(frozen=True, slots=True)
class Format:
    """Format of mission files."""

    write: Callable[[Mission, FileOptions], bytes]
    read: Callable[[bytes, str], Mission]  # from the content of a file and the name of the mission
    # what it cannot hold, one sentence each
    losses: Callable[[Mission, FileOptions], list[str]] = lambda mission, options: []
    holds_home: bool = True


FORMATS = {
    ".plan": Format(write_plan, read_plan, plan_losses),
    ".waypoints": Format(write_waypoints, read_waypoints, waypoints_losses),
    ".kml": Format(write_kml, read_kml, kml_losses),
    ".geojson": Format(write_geojson, read_geojson),
    ".kmz": Format(write_kmz, read_kmz, kmz_losses, holds_home=False),
    ".csv": Format(write_litchi, read_litchi, litchi_losses, holds_home=False),
}


def write_mission(
    mission: Mission,
    path: Path_,
    overwrite: bool = False,
    check: Callable[[Mission], None] | None = None,
    *,
    editable: bool = False,
    dji_model: str = FileOptions().dji_model,
    lens: str | None = None,
    turn: str = TURN_STOP,
) -> None:
    """Write a mission to a file, whole or not at all; what its format cannot hold gives warnings.

    The extension selects the format: .plan (QGroundControl, MAVSDK), .waypoints (Mission Planner, mavwp,
    QGroundControl), .kmz (DJI), .csv (Litchi), and for display .kml and .geojson. A .waypoints file does not
    store the autopilot; parameters that are not set are written as 0. `check` is called with the mission as
    it is read back, from home where its format does not hold that; where it raises, nothing is written. If
    `editable`, a .plan holds the survey lines of convex parts as survey items, which QGroundControl can edit.
    `dji_model` is the aircraft of a .kmz, see `uavseg.flight.formats.options.DJI_MODELS`, `lens` which of its
    lenses photograph, such as "wide,ir" (by default all that serve for maps), and `turn` whether it makes a
    "stop" at waypoints or flies "through" them. A MissionError says that there is no format of this
    extension, that it cannot hold how the mission is flown, or that the aircraft does not carry the camera, a
    ParameterError that the aircraft is not known or has no such lens, or that the format has no such option,
    an OutputError that the file exists or cannot be written.
    """
    options = file_options(path, editable=editable, dji_model=dji_model, lens=lens, turn=turn)
    mission_format = FORMATS[check_mission_format(path)]
    content, losses = mission_format.write(mission, options), mission_format.losses(mission, options)
    with atomic_file(path, overwrite) as temporary:
        temporary.write_bytes(content)
        if check is not None:
            written = read_mission(temporary)
            check(written if mission_format.holds_home else _from_home(written, mission.home))
    for loss in losses:
        warnings.warn(loss, stacklevel=2)


def file_options(path: Path_, **given: Any) -> FileOptions:
    """Return the options of a file that is to be written, by their names; errors as of `write_mission`."""
    suffix, options = check_mission_format(path), FileOptions(**given)
    if options.editable and suffix != ".plan":
        raise ParameterError(f"only a .plan can hold what QGroundControl edits (--editable), not a {suffix}")
    if suffix != ".kmz" and (options.lens is not None or options.turn != TURN_STOP):
        name = "--turn" if options.lens is None else "--lens"
        raise ParameterError(f"{name} is for a .kmz, not for a {suffix}; leave it out")
    return options


def _from_home(mission: Mission, home: HomePosition) -> Mission:
    """Move home and takeoff of a mission whose file does not hold them."""
    items = tuple(
        replace(item, lat=home.lat, lon=home.lon) if item.command in TAKEOFFS else item
        for item in mission.items
    )
    return replace(mission, home=home, items=items)


def read_mission(path: Path_) -> Mission:
    """Read a mission from a file in any of the formats of `write_mission`.

    A mission from `write_mission` is read back equal from a .plan, .kml or .geojson file. A .waypoints file
    is read as one for ArduPilot, and a heading (param4) of 0 in it as not set. The items of surveys in a
    .plan are read as they are flown. A .kmz and a .csv do not hold home; notes name what was not read. A
    MissionError says that the file cannot be read, is not what its extension says, holds other complex items
    than surveys, or a mission that would not be safe.
    """
    mission_format = FORMATS[check_mission_format(path)]
    content = read_bytes(path, MissionError, MAX_BYTES)
    try:
        return mission_format.read(content, Path(path).stem)
    except UnicodeDecodeError as error:
        raise MissionError(f"{path} cannot be read as a mission: {cause_of(error)}") from error
    except MissionError as error:
        raise MissionError(f"{path}: {error}") from error
    except _MISFITS as error:
        raise MissionError(f"{path} is not a mission that can be read: {cause_of(error)}") from error


def check_mission_format(path: Path_) -> str:
    """Return the extension of a mission file, such as ".plan"; MissionError if it is not in `FORMATS`."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        *names, last = FORMATS
        raise MissionError(
            f"a mission is written as {', '.join(names)} or {last}, not as {Path(path).name!r}"
        )
    return suffix


def station_refusals(content: bytes, suffix: str) -> dict[str, str]:
    """Return why each program refuses a .plan or .waypoints file, empty where it loads it.

    Transcribed from the loaders of QGroundControl, Mission Planner and MAVSDK. `content` is that of a file
    that `read_mission` reads. Nothing is returned for other formats.
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
    for number, item in enumerate(simple_items(mission["items"]), start=1):
        for key in ("command", "frame", "params", "autoContinue"):
            if key not in item:
                yield f"item {number} has no {key}"
        if len(item["params"]) != 7:
            yield f"item {number} has {len(item['params'])} params instead of 7"
    for polygon in plan["geoFence"].get("polygons") or []:
        for key in ("version", "inclusion", "polygon"):
            if key not in polygon:
                yield f"a polygon of the fence has no {key}"


def _planner_plan(plan: Mapping[str, Any]) -> Iterator[str]:
    """Yield what Mission Planner refuses: it reads some numbers as integers, and nothing of the fence."""
    mission = plan["mission"]
    for key in ("cruiseSpeed", "hoverSpeed"):
        if not _is_whole(mission.get(key, 0)):
            yield f"{key} is not a whole number"
    for item in mission["items"]:
        if item["type"] == "SimpleItem":
            continue
        camera = (item.get("TransectStyleComplexItem") or {}).get("CameraCalc") or {}
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
    for number, item in enumerate(simple_items(plan["mission"]["items"]), start=1):
        if "autoContinue" not in item:
            yield f"item {number} has no autoContinue"


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
