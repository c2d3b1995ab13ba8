"""Layers of a mission that is only shown: legs with arrows and order, and what photographs show."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsDistanceArea,
    QgsFeature,
    QgsFillSymbol,
    QgsGeometry,
    QgsPointXY,
    QgsProject,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)

from ..legs import LEG_FIELDS, leg_features
from ..styles import style_legs

_FOOTPRINT = {
    "color": "31,120,180,8",
    "outline_color": "31,120,180,110",
    "outline_width": "0.15",
}


def legs_layer(files: Sequence[Path]) -> QgsVectorLayer:
    """The legs of flights as a layer in memory, styled."""
    layer = QgsVectorLayer("LineString?crs=EPSG:4326", "Legs (not saved)", "memory")
    layer.dataProvider().addAttributes(LEG_FIELDS.toList())
    layer.updateFields()
    layer.dataProvider().addFeatures(list(leg_features(files)))
    style_legs(layer)
    return layer


def footprints_layer(files: Sequence[Path], flights: Sequence[dict[str, Any]]) -> QgsVectorLayer | None:
    """What photographs at equal distances show on flat ground, as a layer in memory; None without any.

    Parameters
    ----------
    files : sequence of path
        One GeoJSON file for each flight.
    flights : sequence of dict
        Their estimates; `footprint_m` is the width across the line of flight, and the length along it.
    """
    layer = QgsVectorLayer("Polygon?crs=EPSG:4326&field=flight:integer", "Footprints (not saved)", "memory")
    made = []
    for number, (path, flight) in enumerate(zip(files, flights), 1):
        for outline in _footprints(path, flight["footprint_m"]) if flight.get("footprint_m") else ():
            feature = QgsFeature(layer.fields())
            feature.setAttributes([number])
            feature.setGeometry(outline)
            made.append(feature)
    if not made:
        return None
    layer.dataProvider().addFeatures(made)
    layer.setRenderer(QgsSingleSymbolRenderer(QgsFillSymbol.createSimple(_FOOTPRINT)))
    return layer


def not_shown(layer: QgsVectorLayer | None, flights: Sequence[dict[str, Any]]) -> str:
    """Says, as HTML, that footprints are not those of all photographs; empty if they are."""
    taken = sum(flight["photographs"] for flight in flights)
    shown = layer.featureCount() if layer is not None else 0
    if shown >= taken:
        return ""
    return f"footprints of {shown} of {taken} photographs are shown: those at equal distances<br>"


def _footprints(path: Path, size_m: Sequence[float]) -> Iterator[QgsGeometry]:
    """One outline for each photograph along the lines of a flight, which are the lines `photographs`."""
    earth = _ellipsoid()
    for feature in json.loads(path.read_text(encoding="utf-8"))["features"]:
        if feature["properties"]["kind"] != "photographs" or not feature["properties"].get("distance_m"):
            continue
        places = [QgsPointXY(*place[:2]) for place in feature["geometry"]["coordinates"]]
        for start, end in zip(places, places[1:]):
            yield from _along(earth, start, end, feature["properties"]["distance_m"], size_m)


def _along(
    earth: QgsDistanceArea, start: QgsPointXY, end: QgsPointXY, step_m: float, size_m: Sequence[float]
) -> Iterator[QgsGeometry]:
    """Outlines at equal distances along a line, the first at its start."""
    length = earth.measureLine(start, end)
    bearing = earth.bearing(start, end)
    across, along = size_m[0] / 2, size_m[1] / 2
    reach = math.hypot(across, along)
    turn = math.atan2(across, along)
    for k in range(math.floor(length / step_m + 1e-6) + 1):
        middle = earth.computeSpheroidProject(start, k * step_m, bearing)
        corners = [
            earth.computeSpheroidProject(middle, reach, bearing + angle)
            for angle in (turn, math.pi - turn, math.pi + turn, -turn)
        ]
        yield QgsGeometry.fromPolygonXY([corners])


def _ellipsoid() -> QgsDistanceArea:
    """Distances on WGS 84."""
    area = QgsDistanceArea()
    area.setSourceCrs(QgsCoordinateReferenceSystem("EPSG:4326"), QgsProject.instance().transformContext())
    area.setEllipsoid("EPSG:7030")
    return area
