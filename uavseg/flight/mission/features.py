"""A mission as map features: what .kml and .geojson files show, with all that a mission holds as attributes.

Home, items, fence and rally points are features of their own, from which the mission is read back; the line
of flight and the legs on which photographs are taken are only drawn.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from uavseg.errors import MissionError
from uavseg.flight.mission.fence import Fence, FenceCircle, FencePolygon, RallyPoint
from uavseg.flight.mission.items import (
    AUTOPILOTS,
    CAMERA_DISTANCE,
    FRAME_AMSL,
    FRAME_TERRAIN,
    IMAGE_START,
    IMAGE_STOP,
    RETURN,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import shown
from uavseg.raster.geodesy.globe import geod_wgs84

Value = str | float | int | bool | None
Place = tuple[float, float, float]  # lat, lon, metres
HOME, ITEM, FENCE, RALLY, FLIGHT, PHOTOS = "home", "item", "fence", "rally", "flight", "photographs"
ABOVE_SEA, ABOVE_HOME, ABOVE_TERRAIN = "sea", "home", "terrain"
CIRCLE_SIDES = 72
SINGLE, INTERVAL = "photograph", "interval"


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature of a mission.

    Parameters
    ----------
    kind : str
        "home", "item", "fence", "rally", or for drawing alone "flight" or "photographs".
    shape : "Point", "LineString", "Polygon" or ""
        Nothing for an item without position.
    places : tuple of (lat, lon, metres)
    heights : "home", "sea" or "terrain"
        What the heights of the places are above.
    values : dict
        Attributes.
    """

    kind: str
    shape: str
    places: tuple[Place, ...]
    heights: str = ABOVE_HOME
    values: dict[str, Value] = field(default_factory=dict)


def features_of(mission: Mission) -> list[Feature]:
    """The features of a mission: what is drawn, then what it holds."""
    home = mission.home
    about: dict[str, Value] = {"autopilot": mission.autopilot, "altitude_m": home.altitude_m}
    return [
        *_flight(mission),
        Feature(HOME, "Point", ((home.lat, home.lon, home.altitude_m),), ABOVE_SEA, about),
        *(_item(number, item) for number, item in enumerate(mission.items, start=1)),
        *(_fence(shape) for shape in mission.fence),
        *(
            Feature(RALLY, "Point", ((p.lat, p.lon, p.altitude_m),), values={"altitude_m": p.altitude_m})
            for p in mission.rally
        ),
    ]


def _item(number: int, item: MissionItem) -> Feature:
    values: dict[str, Value] = {"number": number, "command": item.command, "frame": item.frame}
    values |= {f"param{n}": value for n, value in enumerate(item.params, start=1)}
    values |= {"altitude_m": item.altitude_m} | ({} if item.autocontinue else {"autocontinue": False})
    if item.has_position and not item.is_at_vehicle:
        place = (item.lat, item.lon, item.altitude_m)
        return Feature(ITEM, "Point", (place,), _heights(item), values)
    return Feature(ITEM, "", (), values=values | {"lat": item.lat, "lon": item.lon})


def _heights(item: MissionItem) -> str:
    return {FRAME_AMSL: ABOVE_SEA, FRAME_TERRAIN: ABOVE_TERRAIN}.get(item.frame, ABOVE_HOME)


def _fence(shape: Fence) -> Feature:
    if isinstance(shape, FencePolygon):
        ring = tuple((lat, lon, 0.0) for lat, lon in (*shape.vertices, shape.vertices[0]))
        return Feature(FENCE, "Polygon", ring, values={"inclusion": shape.inclusion})
    values: dict[str, Value] = {
        "inclusion": shape.inclusion,
        "lat": shape.lat,
        "lon": shape.lon,
        "radius_m": shape.radius_m,
    }
    return Feature(FENCE, "Polygon", _circle(shape), values=values)


def _circle(circle: FenceCircle) -> tuple[Place, ...]:
    azimuths = [360 * n / CIRCLE_SIDES for n in range(CIRCLE_SIDES)]
    lon, lat, _ = geod_wgs84().fwd(
        [circle.lon] * CIRCLE_SIDES, [circle.lat] * CIRCLE_SIDES, azimuths, [circle.radius_m] * CIRCLE_SIDES
    )
    ring = [(float(y), float(x), 0.0) for y, x in zip(lat, lon, strict=True)]
    return (*ring, ring[0])


def _flight(mission: Mission) -> Iterator[Feature]:
    """The line of flight, in pieces of equal meaning of heights, and the legs with photographs."""
    home = mission.home
    place, heights = (home.lat, home.lon, 0.0), ABOVE_HOME
    line: list[Place] = []
    photos: dict[str, float] = {}
    for item in mission.items:
        if item.command in {CAMERA_DISTANCE, IMAGE_START, IMAGE_STOP}:
            _set_trigger(photos, item)
            if photos.pop(SINGLE, 0.0):
                yield Feature(PHOTOS, "Point", (place,), heights)
            continue
        if item.command == RETURN:
            target, meaning = (home.lat, home.lon, place[2]), heights
        elif item.has_position:
            lat, lon = (place[0], place[1]) if item.is_at_vehicle else (item.lat, item.lon)
            target, meaning = (lat, lon, item.altitude_m), _heights(item)
        else:
            continue
        start = place if meaning == heights else (*place[:2], target[2])
        if line and meaning != heights:
            yield Feature(FLIGHT, "LineString", tuple(line), heights)
            line = []
        line += [target] if line else [start, target]
        if photos:
            yield Feature(PHOTOS, "LineString", (start, target), meaning, dict(photos))
        place, heights = target, meaning
    if len(line) > 1:
        yield Feature(FLIGHT, "LineString", tuple(line), heights)


def _set_trigger(photos: dict[str, float], item: MissionItem) -> None:
    """Distance or time between photographs from here on, or a single one."""
    first, second, third, _ = (value or 0.0 for value in item.params)
    if item.command == CAMERA_DISTANCE:
        name, step = "distance_m", first
    elif item.command == IMAGE_START and third == 1:
        name, step = SINGLE, 1.0
    else:
        name, step = "interval_s", second if item.command == IMAGE_START else 0.0
    photos.pop(name, None)
    if step > 0:
        photos[name] = step


def mission_of_features(features: Iterable[Feature], name: str) -> Mission:
    """The mission that `features_of` wrote.

    Raises
    ------
    MissionError
        If these are not the features of a mission, or it would not be safe.
    """
    kinds: dict[str, list[Feature]] = {}
    for feature in features:
        kinds.setdefault(feature.kind, []).append(feature)
    if len(kinds.get(HOME, [])) != 1 or not kinds.get(ITEM):
        raise MissionError("it holds no mission: it is not a file that uavseg wrote of one")
    if unknown := sorted(kinds.keys() - {HOME, ITEM, FENCE, RALLY, FLIGHT, PHOTOS}):
        raise MissionError(f"it holds a {shown(unknown[0])}, which no mission has")
    [home] = kinds[HOME]
    autopilot = str(home.values["autopilot"])
    if autopilot not in AUTOPILOTS:
        raise MissionError(f"its autopilot is {autopilot!r}; expected one of {', '.join(AUTOPILOTS)}")
    numbered = [(int(_number(one, "number")), one) for one in kinds[ITEM]]
    items = sorted(numbered, key=lambda pair: pair[0])
    if [number for number, _ in items] != list(range(1, len(items) + 1)):
        raise MissionError("the numbers of its items are not 1, 2, 3 ...")
    return Mission(
        HomePosition(*home.places[0][:2], _number(home, "altitude_m")),
        tuple(_read_item(number, item) for number, item in items),
        autopilot,
        name,
        fence=tuple(map(_read_fence, kinds.get(FENCE, []))),
        rally=tuple(
            RallyPoint(*one.places[0][:2], _number(one, "altitude_m")) for one in kinds.get(RALLY, [])
        ),
    )


def _read_item(number: int, feature: Feature) -> MissionItem:
    first, second, third, fourth = (_optional(feature, f"param{n}") for n in range(1, 5))
    if feature.places:
        lat, lon = feature.places[0][:2]
    else:
        lat, lon = _number(feature, "lat"), _number(feature, "lon")
    command, frame = int(_number(feature, "command")), int(_number(feature, "frame"))
    params, altitude_m = (first, second, third, fourth), _number(feature, "altitude_m")
    goes_on = _truth(feature, "autocontinue", True)
    try:
        return MissionItem(command, frame, params, lat, lon, altitude_m, goes_on)
    except MissionError as error:
        raise MissionError(f"item {number}: {error}") from error


def _read_fence(feature: Feature) -> Fence:
    inclusion = _truth(feature, "inclusion")
    if feature.values.get("radius_m") is not None:
        lat, lon, radius_m = (_number(feature, key) for key in ("lat", "lon", "radius_m"))
        return FenceCircle(lat, lon, radius_m, inclusion)
    return FencePolygon(tuple(place[:2] for place in feature.places), inclusion)


def _truth(feature: Feature, key: str, default: bool | None = None) -> bool:
    value = feature.values.get(key, default)
    if not isinstance(value, bool):
        raise MissionError(f"{key} of a {feature.kind} is {shown(value)}; expected true or false")
    return value


def _optional(feature: Feature, key: str) -> float | None:
    return None if feature.values.get(key) is None else _number(feature, key)


def _number(feature: Feature, key: str) -> float:
    value = feature.values[key]
    if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
        raise MissionError(f"{key} of a {feature.kind} is {value!r}; expected a number")
    return float(value)


def as_geojson(feature: Feature) -> dict[str, Any]:
    """A feature of a mission as GeoJSON has it."""
    properties: dict[str, Any] = {"kind": feature.kind, **feature.values}
    if feature.shape in {"Point", "LineString"}:
        properties["height_above"] = feature.heights
    if feature.shape == "LineString":
        properties["heights_m"] = [place[2] for place in feature.places]
    return {"type": "Feature", "geometry": _geometry(feature), "properties": properties}


def _geometry(feature: Feature) -> dict[str, Any] | None:
    if not feature.shape:
        return None
    coordinates: Any = [[lon, lat] for lat, lon, _ in feature.places]
    if feature.shape == "Point":
        coordinates = coordinates[0]
    elif feature.shape == "Polygon":
        coordinates = [coordinates[::-1]]  # counter-clockwise, as RFC 7946 asks for
    return {"type": feature.shape, "coordinates": coordinates}
