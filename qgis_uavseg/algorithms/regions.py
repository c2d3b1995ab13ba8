"""What the algorithms share that write regions: the input, outputs, and the run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qgis.core import (
    QgsProcessing,
    QgsProcessingOutputNumber,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterVectorDestination,
    QgsVectorLayer,
)

from ..options import Option, Values, words_of
from ..styles import style_on_load
from ..targets import VECTOR_EXTENSIONS
from .base import ProgramAlgorithm

GROUP = ("regions", "Regions")
INPUT = Option(
    lambda: QgsProcessingParameterRasterLayer("INPUT", "Raster"),
    lambda _: [],
    "A raster in a file: GeoTIFF, VRT, or what else GDAL reads.",
    advanced=False,
)


class RegionAlgorithm(ProgramAlgorithm):
    """An algorithm that turns a raster into regions and, if asked, a raster of their labels."""

    GROUP = GROUP
    COMMAND = ""
    WHAT = "Regions"

    def add_outputs(self) -> None:
        self.addParameter(
            QgsProcessingParameterVectorDestination("OUTPUT", self.WHAT, QgsProcessing.TypeVectorPolygon)
        )
        self.addParameter(QgsProcessingParameterRasterDestination("LABELS", "Labels", None, True, False))
        self.addOutput(QgsProcessingOutputNumber("COUNT", f"Number of {self.WHAT.lower()}"))

    def answer(self, values: Values) -> dict[str, Any]:
        source = values.raster("INPUT")
        regions = self.target(values, "OUTPUT", VECTOR_EXTENSIONS)
        labels = self.target(values, "LABELS", ("tif",))
        words = [self.COMMAND, *words_of(self.options(), values), *self.more_words(values)]
        words += [f"--output={regions}", *([f"--labels={labels}"] if labels else [])]
        self.succeed(values, [*words, "--overwrite", "--progress=plain", "--", source])
        style_on_load(regions, self.styles.regions, values.context)
        found = QgsVectorLayer(regions, "regions", "ogr")
        results: dict[str, Any] = {"OUTPUT": regions, "COUNT": found.featureCount()}
        return {**results, "LABELS": labels} if labels else results

    def more_words(self, values: Values) -> list[str]:
        """Words that do not come from one parameter alone."""
        return []


def with_input(*options: Sequence[Option]) -> Sequence[Option]:
    """The raster, and then the options."""
    return (INPUT, *(option for group in options for option in group))
