"""Regions like a sample: compared by texture and intensity."""

from __future__ import annotations

from collections.abc import Sequence

from qgis.core import (
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingParameterDistance,
    QgsProcessingParameterFeatureSource,
    QgsUnitTypes,
)

from ..options import Option, Values, choice, metres, number, plain, text
from ..places import place
from ..reading import DETAIL, FILL_HOLES, MIN_AREA, MIN_CONFIDENCE, RASTER, THREADS
from ..targets import refuse_unsaved
from .regions import RegionAlgorithm, with_input


def _sample() -> Option:
    return Option(
        lambda: QgsProcessingParameterFeatureSource(
            "SAMPLE", "Sample (polygons)", [QgsProcessing.TypeVectorPolygon], None, True
        ),
        lambda _: [],
        "Polygons around what is looked for; those that are selected, if you tick that.",
        advanced=False,
    )


def _radius() -> QgsProcessingParameterDistance:
    definition = QgsProcessingParameterDistance("RADIUS", "Radius around the place", 10, "", True, 0)
    definition.setDefaultUnit(QgsUnitTypes.DistanceMeters)
    return definition


class RegionsLikeSample(RegionAlgorithm):
    """`uavseg match`."""

    NAME = "match"
    TITLE = "Regions like a sample"
    COMMAND = "match"
    SUMMARY = (
        "Finds the regions of a raster that look like a sample of it, by color and by texture (G statistic "
        "of LBP and contrast). The sample is polygons, or a disc around a place. Each region "
        "has its similarity."
    )
    TAGS = ("segmentation", "texture", "similarity", "classification")

    def options(self) -> Sequence[Option]:
        return with_input(
            (
                _sample(),
                place("PLACE", "Or a place in it", "The middle of a disc in the sample.", True, lambda _: []),
                Option(
                    _radius,
                    lambda _: [],
                    "Of the disc, in metres; in units of the raster where it has no CRS.",
                    False,
                ),
                choice(
                    "BY",
                    "Compare by",
                    "--by",
                    "Color, for which a disc of 8 pixels is enough; texture; or what parts the sample from "
                    "the raster. Empty: auto.",
                    ("auto", "color", "texture"),
                ),
                number(
                    "SIMILARITY",
                    "Similarity",
                    "--similarity",
                    "How like the sample, up to 1; less finds more. Empty: 0.9.",
                    0,
                ),
                text(
                    "INTENSITY",
                    "Deviations of intensity",
                    "--intensity",
                    "By how many deviations of the sample the mean may differ; inf: texture alone. Empty: 1.",
                ),
                choice(
                    "WINDOW",
                    "Window",
                    "--window",
                    "Side in pixels of the window of texture. Empty: 32, or less for small samples.",
                    ("16", "24", "32", "48", "64", "96", "128"),
                ),
                text(
                    "BANDS",
                    "Bands to compare",
                    "--bands",
                    "Each of these bands by itself, such as 1,2,3; beside texture too.",
                ),
                choice(
                    "REFINE",
                    "Refinement",
                    "--refine",
                    "To the pixel, or none: cells of 8 pixels.",
                    ("pixel", "none"),
                ),
                MIN_AREA,
            ),
            RASTER,
            (
                FILL_HOLES,
                DETAIL,
                MIN_CONFIDENCE,
                metres("SIMPLIFY", "Simplify outlines within", "--simplify", "Shared borders stay shared."),
                THREADS,
            ),
        )

    def more_words(self, values: Values) -> list[str]:
        if values.given("SAMPLE") == values.given("PLACE"):
            raise QgsProcessingException("give a sample either as polygons or as a place, and not both")
        return [f"--like={self._polygons(values) if values.given('SAMPLE') else self._disc(values)}"]

    def _polygons(self, values: Values) -> str:
        layer = self.parameterAsVectorLayer(values.parameters, "SAMPLE", values.context)
        if layer is not None:
            refuse_unsaved(layer, values.label("SAMPLE"))
        return self.parameterAsCompatibleSourceLayerPath(
            values.parameters,
            "SAMPLE",
            values.context,
            ["gpkg", "geojson", "fgb", "shp"],
            "gpkg",
            values.feedback,
        )

    def _disc(self, values: Values) -> str:
        crs = self.parameterAsRasterLayer(values.parameters, "INPUT", values.context).crs()
        point = self.parameterAsPoint(values.parameters, "PLACE", values.context, crs)
        radius = values.number("RADIUS")
        if crs.isValid() and not crs.isGeographic():
            radius /= QgsUnitTypes.fromUnitToUnitFactor(crs.mapUnits(), QgsUnitTypes.DistanceMeters)
        return f"{point.x()!r},{point.y()!r},{plain(radius)}"
