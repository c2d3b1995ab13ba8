"""Classify an occupancy map: free, unknown and occupied."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qgis.core import (
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingOutputNumber,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFile,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterVectorDestination,
    QgsVectorLayer,
)

from ..options import Option, Values, listed, words_of
from ..reading import DIVISION, MAP
from ..styles import style_on_load
from ..targets import VECTOR_EXTENSIONS
from .base import ProgramAlgorithm

GROUP = ("occupancy", "Occupancy maps")
MAP_FILE = (
    Option(
        lambda: QgsProcessingParameterRasterLayer("INPUT", "Map", None, True),
        lambda _: [],
        "A raster of probabilities: integers from 0 to the largest of their type, or floats from 0 to 1.",
        advanced=False,
    ),
    Option(
        lambda: QgsProcessingParameterFile(
            "YAML", "Or a ROS map", QgsProcessingParameterFile.File, "", None, True, "ROS map (*.yaml *.yml)"
        ),
        lambda _: [],
        "The YAML file of a ROS map, in place of a layer.",
        advanced=False,
    ),
)


def _free_is(values: Values) -> list[str]:
    if not values.given("FREE_IS"):
        return []
    return [
        f"--free-is-{values.algorithm.parameterAsEnumString(values.parameters, 'FREE_IS', values.context)}"
    ]


FREE_IS = Option(
    lambda: QgsProcessingParameterEnum(
        "FREE_IS", "Free cells are", ["white", "black"], False, None, True, True
    ),
    _free_is,
    "Of a picture without its YAML file.",
    flags={"--free-is-white": " white", "--free-is-black": " black"},
)


def map_file(values: Values) -> str:
    """The file of the map: of a layer, or a YAML file.

    Raises
    ------
    QgsProcessingException
        If there are none or two.
    """
    if values.given("INPUT") == values.given("YAML"):
        raise QgsProcessingException(
            "give a map either as a layer or as the YAML file of a ROS map, and not both"
        )
    return values.raster("INPUT") if values.given("INPUT") else values.text("YAML")


class ClassifyMap(ProgramAlgorithm):
    """`uavseg classify`."""

    NAME = "classify"
    TITLE = "Classify occupancy map"
    GROUP = GROUP
    SUMMARY = (
        "Finds what is free (1), unknown (2) and occupied (3) in a robot's map of probabilities. "
        "It refuses to write states in which obstacles of the map are lost."
    )
    TAGS = ("ros", "robot", "grid", "obstacles", "probability")

    def options(self) -> Sequence[Option]:
        return (
            *MAP_FILE,
            *listed("classify", "FREE_BELOW", "OCCUPIED_ABOVE"),
            *MAP,
            FREE_IS,
            *listed("classify", "REFINE", "MIN_AREA", "SIMPLIFY", "ALLOW_LOST"),
            *DIVISION,
            *listed("classify", "THREADS"),
        )

    def add_outputs(self) -> None:
        polygons = QgsProcessing.TypeVectorPolygon
        self.addParameter(QgsProcessingParameterRasterDestination("OUTPUT", "States"))
        self.addParameter(QgsProcessingParameterVectorDestination("OBJECTS", "Objects", polygons, None, True))
        self.addOutput(QgsProcessingOutputNumber("COUNT", "Number of objects"))

    def answer(self, values: Values) -> dict[str, Any]:
        source = map_file(values)
        states = self.target(values, "OUTPUT", ("tif",))
        objects = self.target(values, "OBJECTS", VECTOR_EXTENSIONS)
        words = ["classify", *words_of(self.options(), values), f"--output={states}"]
        words += [f"--objects={objects}"] if objects else []
        self.succeed(values, [*words, "--overwrite", "--progress=plain", "--", source])
        style_on_load(states, self.styles.states, values.context)
        if not objects:
            return {"OUTPUT": states}
        style_on_load(objects, self.styles.regions, values.context)
        count = QgsVectorLayer(objects, "objects", "ogr").featureCount()
        return {"OUTPUT": states, "OBJECTS": objects, "COUNT": count}
