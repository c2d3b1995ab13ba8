"""A sample of what is looked for: polygons, or a disc around a place."""

from __future__ import annotations

from qgis.core import (
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingParameterDistance,
    QgsProcessingParameterFeatureSource,
    QgsUnitTypes,
)

from ..options import Option, Values, plain
from ..places import place
from ..targets import refuse_unsaved


def _radius() -> QgsProcessingParameterDistance:
    definition = QgsProcessingParameterDistance("RADIUS", "Radius around the place", 10, "", True, 0)
    definition.setDefaultUnit(QgsUnitTypes.DistanceMeters)
    return definition


SAMPLE = (
    Option(
        lambda: QgsProcessingParameterFeatureSource(
            "SAMPLE", "Sample (polygons)", [QgsProcessing.TypeVectorPolygon], None, True
        ),
        lambda _: [],
        "Polygons around what is looked for; those that are selected, if you tick that.",
        advanced=False,
        flags={"--like": ""},
    ),
    place("PLACE", "Or a place in it", "The middle of a disc in the sample.", True, lambda _: [], "--like"),
    Option(
        _radius,
        lambda _: [],
        "Of the disc, in metres; in units of the raster where it has no CRS.",
        False,
    ),
)


def sample_word(values: Values) -> str:
    """`--like` with the sample.

    Raises
    ------
    QgsProcessingException
        If it is given in both ways, or in none.
    """
    if values.given("SAMPLE") == values.given("PLACE"):
        raise QgsProcessingException("give a sample either as polygons or as a place, and not both")
    return f"--like={_polygons(values) if values.given('SAMPLE') else _disc(values)}"


def _polygons(values: Values) -> str:
    layer = values.algorithm.parameterAsVectorLayer(values.parameters, "SAMPLE", values.context)
    if layer is not None:
        refuse_unsaved(layer, values.label("SAMPLE"))
    path: str = values.algorithm.parameterAsCompatibleSourceLayerPath(
        values.parameters,
        "SAMPLE",
        values.context,
        ["gpkg", "geojson", "fgb", "shp"],
        "gpkg",
        values.feedback,
    )
    return path


def _disc(values: Values) -> str:
    crs = values.algorithm.parameterAsRasterLayer(values.parameters, "INPUT", values.context).crs()
    point = values.algorithm.parameterAsPoint(values.parameters, "PLACE", values.context, crs)
    radius = values.number("RADIUS")
    if crs.isValid() and not crs.isGeographic():
        radius /= QgsUnitTypes.fromUnitToUnitFactor(crs.mapUnits(), QgsUnitTypes.DistanceMeters)
    return f"{point.x()!r},{point.y()!r},{plain(radius)}"
