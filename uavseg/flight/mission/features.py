"""Missions as map features: for .kml and .geojson files, tables, interactive maps and drawings.

Home, items, fence and rally points are separate features, from which the mission is read back; the line
of flight and the legs on which photographs are taken are only drawn.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import field
from html import escape
from typing import Any

import numpy as np

from uavseg.arrays import GeoDataFrame
from uavseg.dataclass import dataclass
from uavseg.errors import MissingLibraryError, MissionError, named_errors
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import FenceCircle, FencePolygon, HomePosition, MissionItem, RallyPoint
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import shown
from uavseg.raster.geodesy.globe import geod_wgs84

Value = str | float | int | bool | None
Place = tuple[float, float, float]  # lat, lon, metres
HOME, ITEM, FENCE, RALLY, FLIGHT, PHOTOS = "home", "item", "fence", "rally", "flight", "photographs"
ABOVE_SEA, ABOVE_HOME, ABOVE_TERRAIN = "sea", "home", "terrain"
CIRCLE_SIDES = 72
SINGLE = "photograph"
_WIDTH, _HEIGHT = 360, 240  # pixels of the drawing, at most
_COLORS = {FENCE: "#c0392b", FLIGHT: "#1f6fb2", PHOTOS: "#e08a00", ITEM: "#1f6fb2", RALLY: "#2e8b57"}
_COLORS[HOME] = "#111111"
_POINTS = {ITEM, RALLY, HOME}  # lines and areas are drawn by their outline
_DRAWN = (FENCE, FLIGHT, PHOTOS, RALLY, HOME)  # the last one on top


@dataclass(frozen=True, slots=True)
class MissionFeature:
    """One feature of a mission."""

    role: str  # "home", "item", "fence", "rally"; "flight" or "photographs" for drawing alone
    shape: str  # "Point", "LineString", "Polygon"; empty for an item without position
    places: tuple[Place, ...]
    heights: str = ABOVE_HOME  # zero of the heights: "home", "sea" or "terrain"
    values: dict[str, Value] = field(default_factory=dict)


def features_of(mission: Mission) -> list[MissionFeature]:
    """Return the features of a mission: those that are only drawn, then those that hold it."""
    home = mission.home
    about: dict[str, Value] = {"autopilot": mission.autopilot, "altitude_m": home.altitude_m}
    rally = [(point.lat, point.lon, point.altitude_m) for point in mission.rally]
    return [
        *_flight(mission),
        MissionFeature(HOME, "Point", ((home.lat, home.lon, home.altitude_m),), ABOVE_SEA, about),
        *(_item(number, item) for number, item in enumerate(mission.items, start=1)),
        *(_fence(shape) for shape in mission.fence),
        *(MissionFeature(RALLY, "Point", (place,), values={"altitude_m": place[2]}) for place in rally),
    ]


def _item(number: int, item: MissionItem) -> MissionFeature:
    values: dict[str, Value] = {"number": number, "command": item.command, "frame": item.frame}
    values |= {f"param{n}": value for n, value in enumerate(item.params, start=1)}
    values |= {"altitude_m": item.altitude_m} | ({} if item.autocontinue else {"autocontinue": False})
    if item.has_position and not item.is_at_vehicle:
        place = (item.lat, item.lon, item.altitude_m)
        return MissionFeature(ITEM, "Point", (place,), _heights(item), values)
    return MissionFeature(ITEM, "", (), values=values | {"lat": item.lat, "lon": item.lon})


def _heights(item: MissionItem) -> str:
    return {mav.FRAME_AMSL: ABOVE_SEA, mav.FRAME_TERRAIN: ABOVE_TERRAIN}.get(item.frame, ABOVE_HOME)


def _fence(shape: mav.Fence) -> MissionFeature:
    if isinstance(shape, FencePolygon):
        ring = tuple((lat, lon, 0.0) for lat, lon in (*shape.vertices, shape.vertices[0]))
        return MissionFeature(FENCE, "Polygon", ring, values={"inclusion": shape.inclusion})
    values: dict[str, Value] = {"inclusion": shape.inclusion, "lat": shape.lat, "lon": shape.lon}
    values["radius_m"] = shape.radius_m
    azimuths = [360 * n / CIRCLE_SIDES for n in range(CIRCLE_SIDES)]
    begin = ([value] * CIRCLE_SIDES for value in (shape.lon, shape.lat))
    lon, lat, _ = geod_wgs84().fwd(*begin, azimuths, [shape.radius_m] * CIRCLE_SIDES)
    corners = [(float(y), float(x), 0.0) for y, x in zip(lat, lon, strict=True)]
    return MissionFeature(FENCE, "Polygon", (*corners, corners[0]), values=values)


def _flight(mission: Mission) -> Iterator[MissionFeature]:
    """Yield the line of flight, in pieces of one zero of heights, and the legs with photographs."""
    home = mission.home
    place, heights = (home.lat, home.lon, 0.0), ABOVE_HOME
    line: list[Place] = []
    photos: dict[str, float] = {}
    for item in mission.items:
        if item.command in {mav.CAMERA_DISTANCE, mav.IMAGE_START, mav.IMAGE_STOP}:
            _set_trigger(photos, item)
            if photos.pop(SINGLE, 0.0):
                yield MissionFeature(PHOTOS, "Point", (place,), heights)
            continue
        if item.command == mav.RETURN:
            target, zero = (home.lat, home.lon, place[2]), heights
        elif item.has_position:
            lat, lon = (place[0], place[1]) if item.is_at_vehicle else (item.lat, item.lon)
            target, zero = (lat, lon, item.altitude_m), _heights(item)
        else:
            continue
        start = place if zero == heights else (*place[:2], target[2])
        if line and zero != heights:
            yield MissionFeature(FLIGHT, "LineString", tuple(line), heights)
            line = []
        line += [target] if line else [start, target]
        if photos:
            yield MissionFeature(PHOTOS, "LineString", (start, target), zero, dict(photos))
        place, heights = target, zero
    if len(line) > 1:
        yield MissionFeature(FLIGHT, "LineString", tuple(line), heights)


def _set_trigger(photos: dict[str, float], item: MissionItem) -> None:
    """Set the distance or time between photographs from here on, or a single one."""
    first, second, third, _ = (value or 0.0 for value in item.params)
    if item.command == mav.CAMERA_DISTANCE:
        name, step = "distance_m", first
    elif item.command == mav.IMAGE_START and third == 1:
        name, step = SINGLE, 1.0
    else:
        name, step = "interval_s", second if item.command == mav.IMAGE_START else 0.0
    photos.pop(name, None)
    if step > 0:
        photos[name] = step


def mission_of_features(features: Iterable[MissionFeature], name: str) -> Mission:
    """Return the mission that `features_of` made features of, with a name.

    A MissionError says that these are not the features of a mission, or that it would not be safe.
    """
    roles: dict[str, list[MissionFeature]] = {}
    for feature in features:
        roles.setdefault(feature.role, []).append(feature)
    if len(roles.get(HOME, [])) != 1 or not roles.get(ITEM):
        raise MissionError("it holds no mission: it is not a file that uavseg wrote of one")
    if unknown := sorted(roles.keys() - {HOME, ITEM, FENCE, RALLY, FLIGHT, PHOTOS}):
        raise MissionError(f"it holds a {shown(unknown[0])}, which no mission has")
    [home] = roles[HOME]
    autopilot = str(home.values["autopilot"])
    if autopilot not in mav.AUTOPILOTS:
        raise MissionError(f"its autopilot is {autopilot!r}; expected one of {', '.join(mav.AUTOPILOTS)}")
    items = sorted(((int(_finite(one, "number")), one) for one in roles[ITEM]), key=lambda pair: pair[0])
    if [number for number, _ in items] != list(range(1, len(items) + 1)):
        raise MissionError("the numbers of its items are not 1, 2, 3 ...")
    return Mission(
        home=HomePosition(*home.places[0][:2], _finite(home, "altitude_m")),
        items=tuple(_read_item(number, item) for number, item in items),
        autopilot=autopilot,
        name=name,
        fence=tuple(map(_read_fence, roles.get(FENCE, []))),
        rally=tuple(
            RallyPoint(*one.places[0][:2], _finite(one, "altitude_m")) for one in roles.get(RALLY, [])
        ),
    )


def _read_item(number: int, feature: MissionFeature) -> MissionItem:
    first, second, third, fourth = (_optional(feature, f"param{n}") for n in range(1, 5))
    params = first, second, third, fourth
    if feature.places:
        lat, lon = feature.places[0][:2]
    else:
        lat, lon = _finite(feature, "lat"), _finite(feature, "lon")
    command, frame = int(_finite(feature, "command")), int(_finite(feature, "frame"))
    altitude_m, autocontinue = _finite(feature, "altitude_m"), _truth(feature, "autocontinue", True)
    with named_errors(f"item {number}", MissionError):
        return MissionItem(
            command=command,
            frame=frame,
            params=params,
            lat=lat,
            lon=lon,
            altitude_m=altitude_m,
            autocontinue=autocontinue,
        )


def _read_fence(feature: MissionFeature) -> mav.Fence:
    inclusion = _truth(feature, "inclusion")
    if feature.values.get("radius_m") is not None:
        lat, lon, radius_m = (_finite(feature, key) for key in ("lat", "lon", "radius_m"))
        return FenceCircle(lat, lon, radius_m, inclusion)
    return FencePolygon(tuple(place[:2] for place in feature.places), inclusion)


def _truth(feature: MissionFeature, key: str, default: bool | None = None) -> bool:
    value = feature.values.get(key, default)
    if not isinstance(value, bool):
        raise MissionError(f"{key} of a {feature.role} is {shown(value)}; expected true or false")
    return value


def _optional(feature: MissionFeature, key: str) -> float | None:
    return None if feature.values.get(key) is None else _finite(feature, key)


def _finite(feature: MissionFeature, key: str) -> float:
    value = feature.values[key]
    if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
        raise MissionError(f"{key} of a {feature.role} is {value!r}; expected a number")
    return float(value)


def as_geojson(feature: MissionFeature) -> dict[str, Any]:
    """Return a feature of a mission as a GeoJSON Feature."""
    properties: dict[str, Any] = {"kind": feature.role, **feature.values}
    coordinates: Any = [[lon, lat] for lat, lon, _ in feature.places]
    if feature.shape == "Polygon":
        coordinates = [coordinates[::-1]]  # counter-clockwise, as RFC 7946 requires
    elif feature.shape:
        properties["height_above"] = feature.heights
    if feature.shape == "Point":
        coordinates = coordinates[0]
    elif feature.shape == "LineString":
        properties["heights_m"] = [place[2] for place in feature.places]
    geometry = {"type": feature.shape, "coordinates": coordinates} if feature.shape else None
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def to_geodataframe(mission: Mission) -> "GeoDataFrame":
    """Return the features of a mission, as its .geojson file has them: see `Mission.to_geodataframe`."""
    import geopandas

    features = [as_geojson(feature) for feature in features_of(mission)]
    return geopandas.GeoDataFrame.from_features(features, crs="EPSG:4326")


def explore(*missions: Mission, **options: Any) -> Any:
    """Draw missions on an interactive map: see `Mission.explore`."""
    for mission in missions:
        frame = to_geodataframe(mission)
        frame = frame[~frame.geometry.isna()].dropna(axis="columns", how="all")
        try:
            for role in (FENCE, FLIGHT, PHOTOS, RALLY, ITEM, HOME):
                rows = frame[frame["kind"] == role].dropna(axis="columns", how="all")
                if len(rows):
                    style = {"fill": role in _POINTS, "weight": 4 if role == PHOTOS else 2}
                    options["m"] = rows.explore(color=_COLORS[role], name=role, style_kwds=style, **options)
        except ImportError as error:
            raise MissingLibraryError(
                f'interactive maps need folium and mapclassify: pip install "uavseg[explore]" ({error})'
            ) from error
    return options["m"]


def as_html(mission: Mission) -> str:
    """Return a summary of a mission, a drawing of it, north up, and its warnings."""
    summary = f"{len(mission.items):,} items for {mission.autopilot}, {mission.distance_m:,.0f} m, about "
    summary = f"{mission.name}: " * bool(mission.name) + f"{summary}{mission.duration_s / 60:.1f} min"
    warnings = "".join(f"<li>{escape(text)}</li>" for text in mission.warnings)
    warned = f"<ul>{warnings}</ul>" if warnings else ""
    return f"<div><p>{escape(summary)}</p>{_drawing(mission)}{warned}</div>"


def _drawing(mission: Mission) -> str:
    """Draw fence, flight, legs with photographs and home as SVG, in local metres."""
    features = [feature for feature in features_of(mission) if feature.role in _DRAWN]
    features.sort(key=lambda feature: _DRAWN.index(feature.role))
    home = np.array([mission.home.lat, mission.home.lon])
    degree = np.array([1.0, np.cos(np.radians(mission.home.lat))])  # lengths, against one of latitude
    lines = [np.array([place[:2] for place in feature.places]) - home for feature in features]
    for line in lines:  # in metres, over the antimeridian where that is shorter
        line[:, 1] = (line[:, 1] + 180) % 360 - 180
        line *= degree
    low, high = np.vstack(lines).min(axis=0), np.vstack(lines).max(axis=0)
    extent = np.maximum(high - low, 1e-9)
    scale = min(_HEIGHT / extent[0], _WIDTH / extent[1])
    shapes = "".join(
        _shape(feature, np.column_stack([line[:, 1] - low[1], high[0] - line[:, 0]]) * scale + 4)
        for feature, line in zip(features, lines, strict=True)
    )
    legend = "".join(
        f'<span style="color: {_COLORS[role]}">■</span> {role} · '
        for role in dict.fromkeys(feature.role for feature in features)
    )
    size = f'width="{extent[1] * scale + 8:.0f}" height="{extent[0] * scale + 8:.0f}"'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><g fill="none">{shapes}</g></svg>'
    return f"{svg}<p><small>{legend}</small></p>"


def _shape(feature: MissionFeature, points: np.ndarray[Any, Any]) -> str:
    color = _COLORS[feature.role]
    if feature.shape == "Point":
        (x, y), radius = points[0], 1.5 if feature.role == PHOTOS else 4
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{color}"/>'
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    width = 2.5 if feature.role == PHOTOS else 1
    is_exclusion = feature.role == FENCE and not feature.values.get("inclusion", True)
    fill = f' fill="{color}" fill-opacity="0.3"' if is_exclusion else ""
    return f'<polyline points="{path}" stroke="{color}" stroke-width="{width}"{fill}/>'
