"""Legs of missions as features: from the GeoJSON that `uavseg plan` writes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsFeature,
    QgsField,
    QgsFields,
    QgsGeometry,
    QgsPoint,
    QgsWkbTypes,
)
from qgis.PyQt.QtCore import QMetaType, QVariant

_TYPES = QVariant if hasattr(QVariant, "Int") else QMetaType.Type  # of Qt 5, Qt 6
LEG_FIELDS = QgsFields()
for _name, _type in (
    ("flight", _TYPES.Int),
    ("leg", _TYPES.Int),
    ("from_m", _TYPES.Double),
    ("to_m", _TYPES.Double),
):
    LEG_FIELDS.append(QgsField(_name, _type))
WGS84 = (QgsWkbTypes.LineString, QgsCoordinateReferenceSystem("EPSG:4326"))
"""Type and CRS of the legs."""


def leg_features(files: Sequence[Path]) -> Iterator[QgsFeature]:
    """Legs of flights, counted from 1 in each, with the heights of their ends.

    Parameters
    ----------
    files : sequence of path
        One GeoJSON file for each flight.

    Yields
    ------
    feature : QgsFeature
        A vertical leg (take-off, landing) has no length on the map, and is left out.
    """
    for number, path in enumerate(files, 1):
        leg = 0
        for places, heights in _lines(path):
            for k in range(len(places) - 1):
                if places[k][:2] == places[k + 1][:2]:
                    continue
                leg += 1
                feature = QgsFeature(LEG_FIELDS)
                feature.setAttributes([number, leg, heights[k], heights[k + 1]])
                feature.setGeometry(
                    QgsGeometry.fromPolyline([QgsPoint(*places[k][:2]), QgsPoint(*places[k + 1][:2])])
                )
                yield feature


def _lines(path: Path) -> Iterator[tuple[list[list[float]], list[float]]]:
    """The line of a flight with its heights: a piece for each meaning of heights (home, terrain, sea)."""
    for feature in json.loads(Path(path).read_text(encoding="utf-8"))["features"]:
        if feature["properties"]["kind"] == "flight":
            yield feature["geometry"]["coordinates"], feature["properties"]["heights_m"]
