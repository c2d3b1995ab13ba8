"""Extract regions: connected pixels in a range, or in several as classes."""

from __future__ import annotations

from collections.abc import Sequence

from qgis.core import QgsProcessingException, QgsProcessingParameterMatrix

from ..options import Option, Values, filled, interval, listed, unless
from ..reading import DIVISION, RASTER
from .regions import RegionAlgorithm, with_input


def _classes(values: Values) -> list[str]:
    """`--class` for each row of the table: a name, a lower and an upper end."""
    cells = values.algorithm.parameterAsMatrix(values.parameters, "CLASSES", values.context)
    texts = [str(cell).strip() if filled(cell) else "" for cell in cells]
    starts = range(0, len(texts), 3)
    rows = [row for row in (texts[start:][:3] for start in starts) if any(row)]
    for row in rows:
        if len(row) < 3 or not all(row):
            raise QgsProcessingException(
                f"Classes: expected a name, a lower and an upper end in each row, got {', '.join(row)!r}"
            )
    return [f"--class={name}={low},{high}" for name, low, high in rows]


CLASSES = Option(
    lambda: QgsProcessingParameterMatrix(
        "CLASSES", "Classes", 1, False, ["Name", "From v", "To v"], None, True
    ),
    lambda v: _classes(v) if v.given("CLASSES") else [],
    "In place of a range: a class in each row, with its range of v.",
    flags={"--class": ""},
)
RANGE, RANGE_IN = interval("0.55,1", "What is looked for: pixels from the lower to the upper end.")


class ExtractRegions(RegionAlgorithm):
    """`uavseg extract`."""

    NAME = "extract"
    TITLE = "Extract regions"
    COMMAND = "extract"
    SUMMARY = (
        "Finds the regions of a raster whose mean intensity lies in a range, with boundaries to the pixel. "
        "The raster is divided by texture (LBP and contrast, G statistic) and intensity. Several ranges "
        "at once "
        "are classes. Suggest ranges proposes ranges."
    )
    TAGS = ("segmentation", "polygonize", "threshold", "index", "ndvi", "classes")

    def options(self) -> Sequence[Option]:
        return with_input(
            (
                unless(RANGE, ("CLASSES", "CLASSES_FILE")),
                RANGE_IN,
                *listed("extract", "MIN_AREA", "FILL_HOLES"),
            ),
            RASTER,
            (CLASSES, *listed("extract", "CLASSES_FILE", "REFINE", "DETAIL", "THIN_LINES", "FLATTEN")),
            listed("extract", "MIN_CONFIDENCE", "SMOOTH_OUTLINE", "SIMPLIFY"),
            DIVISION,
            listed("extract", "THREADS"),
        )
