"""Extract regions: connected pixels in a range, or in several as classes."""

from __future__ import annotations

from collections.abc import Sequence

from qgis.core import QgsProcessingException, QgsProcessingParameterMatrix

from ..options import Option, Values, choice, file, filled, interval, metres, unless
from ..reading import (
    DETAIL,
    DIVISION,
    FILL_HOLES,
    FLATTEN,
    MIN_AREA,
    MIN_CONFIDENCE,
    RASTER,
    THIN_LINES,
    THREADS,
)
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
            (unless(RANGE, ("CLASSES", "CLASSES_FILE")), RANGE_IN, MIN_AREA),
            RASTER,
            (
                CLASSES,
                file(
                    "CLASSES_FILE",
                    "File of classes",
                    "--classes",
                    "In place of a range: a table with name, range and color.",
                    "Classes (*.csv *.yaml *.yml)",
                ),
                choice(
                    "REFINE",
                    "Refinement",
                    "--refine",
                    "How boundaries are found to the pixel; pixels: every pixel by its own value. Empty: by "
                    "total variation.",
                    ("tv", "scan", "none", "smooth", "pixels"),
                ),
                FILL_HOLES,
                DETAIL,
                THIN_LINES,
                FLATTEN,
                MIN_CONFIDENCE,
                metres(
                    "SMOOTH_OUTLINE",
                    "Smooth outlines within",
                    "--smooth-outline",
                    "Draw outlines without stairs.",
                ),
                metres("SIMPLIFY", "Simplify outlines within", "--simplify", "Shared borders stay shared."),
            ),
            DIVISION,
            (THREADS,),
        )
