"""Missions in notebooks: a table of map features, an interactive map, and a drawing with facts."""

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from uavseg.errors import MissingLibraryError
from uavseg.flight.mission.features import (
    FENCE,
    FLIGHT,
    HOME,
    ITEM,
    PHOTOS,
    RALLY,
    Feature,
    as_geojson,
    features_of,
)
from uavseg.flight.mission.mission import Mission

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

_WIDTH, _HEIGHT = 360, 240  # pixels of the drawing, at most
_COLORS = {FENCE: "#c0392b", FLIGHT: "#1f6fb2", PHOTOS: "#e08a00", ITEM: "#1f6fb2", RALLY: "#2e8b57"}
_HOME_COLOR = "#111111"
_POINTS = {ITEM, RALLY, HOME}  # lines and areas are drawn by their outline
_DRAWN = (FENCE, FLIGHT, PHOTOS, RALLY, HOME)  # the last one on top


def to_geodataframe(mission: Mission) -> "GeoDataFrame":
    """The features of a mission, as its .geojson file has them: see `Mission.to_geodataframe`."""
    import geopandas

    features = [as_geojson(feature) for feature in features_of(mission)]
    return geopandas.GeoDataFrame.from_features(features, crs="EPSG:4326")


def explore(*missions: Mission, **words: Any) -> Any:
    """An interactive map of missions: see `Mission.explore`."""
    for mission in missions:
        words["m"] = _explore(mission, words)
    return words["m"]


def _explore(mission: Mission, words: dict[str, Any]) -> Any:
    words, frame = dict(words), to_geodataframe(mission)
    frame = frame[~frame.geometry.isna()].dropna(axis="columns", how="all")
    try:
        for kind in (FENCE, FLIGHT, PHOTOS, RALLY, ITEM, HOME):
            shown = frame[frame["kind"] == kind].dropna(axis="columns", how="all")
            if len(shown):
                style = {"fill": kind in _POINTS, "weight": 4 if kind == PHOTOS else 2}
                color = _COLORS.get(kind, _HOME_COLOR)
                words["m"] = shown.explore(color=color, name=kind, style_kwds=style, **words)
    except ImportError as error:
        raise MissingLibraryError(
            f'interactive maps need folium and mapclassify: pip install "uavseg[explore]" ({error})'
        ) from error
    return words["m"]


def as_html(mission: Mission) -> str:
    """Facts of a mission, its warnings and a drawing, north up."""
    facts = [
        f"{len(mission.items):,} items for {mission.autopilot}",
        f"{mission.distance_m:,.0f} m",
        f"about {mission.duration_s / 60:.1f} min",
    ]
    title = f"{mission.name}: " if mission.name else ""
    warnings = "".join(f"<li>{escape(text)}</li>" for text in mission.warnings)
    warned = f"<ul>{warnings}</ul>" if warnings else ""
    return f"<div><p>{escape(title + ', '.join(facts))}</p>{_drawing(mission)}{warned}</div>"


def _drawing(mission: Mission) -> str:
    """Fence, flight, legs with photographs and home as SVG, in local metres."""
    features = [feature for feature in features_of(mission) if feature.kind in _DRAWN]
    features.sort(key=lambda feature: _DRAWN.index(feature.kind))
    home = np.array([mission.home.lat, mission.home.lon])
    degree = np.array([1.0, np.cos(np.radians(mission.home.lat))])  # lengths, against one of latitude
    lines = [_from_home(feature, home) * degree for feature in features]
    low, high = np.vstack(lines).min(axis=0), np.vstack(lines).max(axis=0)
    extent = np.maximum(high - low, 1e-9)
    scale = min(_HEIGHT / extent[0], _WIDTH / extent[1])
    shapes = "".join(
        _shape(feature, np.column_stack([line[:, 1] - low[1], high[0] - line[:, 0]]) * scale + 4)
        for feature, line in zip(features, lines, strict=True)
    )
    legend = "".join(
        f'<span style="color: {_COLORS.get(kind, _HOME_COLOR)}">■</span> {kind} · '
        for kind in dict.fromkeys(feature.kind for feature in features)
    )
    size = f'width="{extent[1] * scale + 8:.0f}" height="{extent[0] * scale + 8:.0f}"'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><g fill="none">{shapes}</g></svg>'
    return f"{svg}<p><small>{legend}</small></p>"


def _from_home(feature: Feature, home: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Degrees from home, over the antimeridian where that is shorter."""
    degrees: np.ndarray[Any, Any] = np.array([place[:2] for place in feature.places]) - home
    degrees[:, 1] = (degrees[:, 1] + 180) % 360 - 180
    return degrees


def _shape(feature: Feature, points: np.ndarray[Any, Any]) -> str:
    color = _COLORS.get(feature.kind, _HOME_COLOR)
    if feature.shape == "Point":
        (x, y), radius = points[0], 1.5 if feature.kind == PHOTOS else 4
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{color}"/>'
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    width = 2.5 if feature.kind == PHOTOS else 1
    fill = f' fill="{color}" fill-opacity="0.3"' if _keeps_out(feature) else ""
    return f'<polyline points="{path}" stroke="{color}" stroke-width="{width}"{fill}/>'


def _keeps_out(feature: Feature) -> bool:
    return feature.kind == FENCE and not feature.values.get("inclusion", True)
