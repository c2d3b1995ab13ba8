"""Find a path: the shortest over the free cells of a map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsProcessing,
    QgsProcessingOutputNumber,
    QgsProcessingParameterVectorDestination,
    QgsProcessingUtils,
    QgsRasterLayer,
    QgsVectorLayer,
)

from ..options import Option, Values, interval, listed, words_of
from ..places import place
from ..reading import DIVISION, MAP
from ..styles import style_on_load
from ..targets import VECTOR_EXTENSIONS, checked_target, write_layer
from .base import ProgramAlgorithm
from .classify import FREE_IS, GROUP, MAP_FILE, map_file


def _end(name: str, label: str) -> Option:
    """A place in the coordinates of the map."""

    flag = f"--{name.lower()}"

    def words(values: Values) -> list[str]:
        layer = values.algorithm.parameterAsRasterLayer(values.parameters, "INPUT", values.context)
        crs = layer.crs() if layer is not None else QgsCoordinateReferenceSystem()
        point = values.algorithm.parameterAsPoint(values.parameters, name, values.context, crs)
        return [f"{flag}={point.x()!r},{point.y()!r}"]

    return place(name, label, "In the coordinates of the map, or with its CRS behind.", False, words, flag)


class FindPath(ProgramAlgorithm):
    """`uavseg path`."""

    NAME = "path"
    TITLE = "Find a path"
    GROUP = GROUP
    SUMMARY = (
        "Finds the shortest path between two places over the cells of a region. The path never enters a "
        "cell whose own "
        "value is outside of the range, and cuts no corner."
    )
    TAGS = ("route", "shortest path", "a*", "robot")

    def options(self) -> Sequence[Option]:
        return (
            *MAP_FILE,
            *interval("0,0.45", "What is passable."),
            _end("START", "Start"),
            _end("GOAL", "Goal"),
            *listed("path", "CLEARANCE", "SMOOTH"),
            *MAP,
            FREE_IS,
            *DIVISION,
            *listed("path", "REFINE", "THREADS"),
        )

    def add_outputs(self) -> None:
        self.addParameter(
            QgsProcessingParameterVectorDestination("OUTPUT", "Path", QgsProcessing.TypeVectorLine)
        )
        self.addOutput(QgsProcessingOutputNumber("LENGTH", "Length in metres, or units of the map"))

    def answer(self, values: Values) -> dict[str, Any]:
        source = map_file(values)
        target = self.parameterAsOutputLayer(values.parameters, "OUTPUT", values.context)
        checked_target(target, VECTOR_EXTENSIONS, values.label("OUTPUT"))
        is_geojson = Path(target).suffix.lower() == ".geojson"
        written = target if is_geojson else QgsProcessingUtils.generateTempFilename("path.geojson")
        words = ["path", *words_of(self.options(), values), f"--output={written}"]
        self.succeed(values, [*words, "--overwrite", "--progress=plain", "--", source])
        if not is_geojson:
            layer = QgsVectorLayer(written, "path", "ogr")
            if not QgsRasterLayer(source, "map", "gdal").crs().isValid():
                layer.setCrs(QgsCoordinateReferenceSystem())  # local coordinates, which GeoJSON cannot say
            write_layer(layer, target, values.context)
        style_on_load(target, self.styles.legs, values.context)
        found = json.loads(Path(written).read_text(encoding="utf-8"))["features"][0]["properties"]
        return {"OUTPUT": target, "LENGTH": found.get("length_m")}
