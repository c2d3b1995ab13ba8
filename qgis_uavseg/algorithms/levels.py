"""Segment by levels: levels of v, and connected segments of each."""

from __future__ import annotations

from collections.abc import Sequence

from ..options import Option, listed
from ..reading import DIVISION, RASTER
from .regions import RegionAlgorithm, with_input


class SegmentByLevels(RegionAlgorithm):
    """`uavseg levels`."""

    NAME = "levels"
    TITLE = "Segment by levels"
    COMMAND = "levels"
    WHAT = "Segments"
    SUMMARY = (
        "Divides a raster into levels of intensity and each level into connected segments that cover the "
        "raster "
        "without gaps. Give either the width of a level, or breaks."
    )
    TAGS = ("segmentation", "contour", "otsu", "quantile", "classes")

    def options(self) -> Sequence[Option]:
        return with_input(
            listed("levels", "WIDTH", "BREAKS", "MIN_AREA"),
            RASTER,
            listed("levels", "REFINE", "SMALL", "DETAIL", "FLATTEN", "MIN_CONFIDENCE"),
            listed("levels", "SMOOTH_OUTLINE", "SIMPLIFY"),
            DIVISION,
            listed("levels", "THREADS"),
        )
