"""Ranges that are suggested: what a user sees of each."""

import math
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.jobs.result.result import SourceInfo
from uavseg.raster.spectral.bands import values_text
from uavseg.segmentation.blocks.block_map import BlockMap


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A range of v that one may ask for, with both ends; none is the mean of a leaf, 0 and 1 aside."""

    low: float
    high: float
    # That extracting it gives; where regions end at block edges, those of the leaves whose mean lies in it,
    # and of a part of a class, of such cells of 8 x 8 pixels.
    pixels: int
    share: float  # of all valid pixels, 0 to 1
    regions: int  # how many extracting it gives
    exact: bool = True  # pixels and regions were counted; otherwise they are those of `estimate_regions`
    value_low: float | None = None  # in the units of the raster; None where open, or values are not known
    value_high: float | None = None
    unit: str = ""  # of the values; empty where it is not known
    part: bool = False  # of the darkest or brightest range, of small things in it; the others make up 0..1
    # Difference of the means on both sides of its borders, as a multiple of that between means on one side;
    # below 2.5, the borders are those of noise or of slow light. None where it is not known.
    contrast: float | None = None

    @property
    def range(self) -> tuple[float, float]:
        """As `uavseg.extract` takes it."""
        return self.low, self.high

    def __str__(self) -> str:
        """As --range takes it."""
        return f"{self.low:.7g},{self.high:.7g}"

    @property
    def values_text(self) -> str:
        """The range in values for people; empty where they are not known."""
        if self.value_low is None and self.value_high is None:
            return ""
        low, high = (math.nan if end is None else end for end in (self.value_low, self.value_high))
        return values_text((low, high), self.unit)

    @property
    def regions_text(self) -> str:
        """The number of regions for people."""
        return f"{self.regions:,}" if self.exact else f"about {float(f'{self.regions:.2g}'):,.0f}"


@dataclass(frozen=True)
class Suggestions:
    """Ranges of v, and what they come from.

    Those that look most like things on a ground come first: compact, closed and contrasting at their borders.
    There are none where all leaves have one mean.
    """

    ranges: tuple[Suggestion, ...]
    explained: float  # share of the variance of the leaves' means between the ranges, parts aside
    histogram: NDArray[np.int64] = field(repr=False)  # (65536,): by the grey of leaves, or of pixels
    # (8 B, 8 C): which of `by_intensity`, from 1, the leaf of each cell of 8 x 8 pixels lies in, or the cell
    # itself where that is a part; 0 where the leaf has no valid pixel
    intervals: NDArray[np.uint8] = field(repr=False)
    blocks: BlockMap = field(repr=False)
    source: SourceInfo
    warnings: tuple[str, ...]
    by_pixel: bool = False  # the ranges part populations of pixels, which pixels show better than cells

    @property
    def by_intensity(self) -> tuple[Suggestion, ...]:
        """The ranges that together are 0..1, the darkest first, and then their parts."""
        return tuple(sorted(self.ranges, key=lambda one: (one.part, one.low)))
