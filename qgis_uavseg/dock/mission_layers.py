"""Layers of a mission that is only shown: legs with arrows and order, and what photographs show."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsFeature,
    QgsFillSymbol,
    QgsGeometry,
    QgsPointXY,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)

from ..legs import LEG_FIELDS, leg_features
from ..styles import style_legs
from .mission import escaped

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


def footprints_layer(flights: Sequence[dict[str, Any]]) -> QgsVectorLayer | None:
    """The ground that each photograph shows, as a layer in memory; None without any.

    Parameters
    ----------
    flights : sequence of dict
        Of `uavseg plan --json --footprints`: `footprints` are corners (lon, lat) in degrees.
    """
    layer = QgsVectorLayer("Polygon?crs=EPSG:4326&field=flight:integer", "Footprints (not saved)", "memory")
    made = []
    for number, flight in enumerate(flights, 1):
        for corners in flight["footprints"]:
            feature = QgsFeature(layer.fields())
            feature.setAttributes([number])
            feature.setGeometry(QgsGeometry.fromPolygonXY([[QgsPointXY(*corner) for corner in corners]]))
            made.append(feature)
    if not made:
        return None
    layer.dataProvider().addFeatures(made)
    layer.setRenderer(QgsSingleSymbolRenderer(QgsFillSymbol.createSimple(_FOOTPRINT)))
    return layer


def not_shown(flights: Sequence[dict[str, Any]]) -> str:
    """Says, as HTML, why photographs have no footprints; empty where all have."""
    notes = {flight["footprints_note"]: None for flight in flights if flight["footprints_note"]}
    return "".join(f"{escaped(note)}<br>" for note in notes)
