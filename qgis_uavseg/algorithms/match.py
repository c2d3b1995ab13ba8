"""Regions like a sample: compared by texture and intensity."""

from __future__ import annotations

from collections.abc import Sequence

from ..options import Option, Values, choice, metres, number, text
from ..reading import DETAIL, FILL_HOLES, MIN_AREA, MIN_CONFIDENCE, RASTER, THREADS
from .regions import RegionAlgorithm, with_input
from .sample import SAMPLE, sample_word


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
                *SAMPLE,
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
        return [sample_word(values)]
