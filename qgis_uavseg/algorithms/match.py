"""Regions like a sample: compared by texture and intensity."""

from __future__ import annotations

from collections.abc import Sequence

from ..options import Option, Values, listed
from ..reading import RASTER
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
            SAMPLE,
            listed("match", "BY", "SIMILARITY", "INTENSITY", "WINDOW", "BANDS", "REFINE", "MIN_AREA"),
            RASTER,
            listed("match", "ANSWER", "FLATTEN", "FILL_HOLES", "DETAIL", "MIN_CONFIDENCE", "SIMPLIFY"),
            listed("match", "THREADS"),
        )

    def more_words(self, values: Values) -> list[str]:
        return [sample_word(values)]
