"""Segment by levels: levels of v, and connected segments of each."""

from __future__ import annotations

from collections.abc import Sequence

from ..options import Option, choice, metres, number, shown, text
from ..reading import DETAIL, DIVISION, FLATTEN, MIN_AREA, MIN_CONFIDENCE, RASTER, THREADS
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
        width = number(
            "WIDTH", "Width of a level in v", "--width", "Such as 0.1: levels 0..0.1, 0.1..0.2 and so on.", 0
        )
        return with_input(
            (
                shown(width),
                text(
                    "BREAKS",
                    "Breaks",
                    "--breaks",
                    "In place of a width: values of v between levels, such as 0.2,0.5; or otsu, otsu:4, "
                    "quantile, "
                    "quantile:5.",
                    advanced=False,
                ),
                MIN_AREA,
            ),
            RASTER,
            (
                choice(
                    "REFINE",
                    "Refinement",
                    "--refine",
                    "By total variation to the pixel (tv), every pixel by its own value (pixels), or none.",
                    ("tv", "none", "pixels"),
                ),
                choice(
                    "SMALL",
                    "Small segments",
                    "--small",
                    "Become part of a neighbour (merge), or are left out (drop). Empty: merge.",
                    ("merge", "drop"),
                ),
                DETAIL,
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
