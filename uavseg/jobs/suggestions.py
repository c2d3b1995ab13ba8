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
    """A range of v that one may ask for.

    Parameters
    ----------
    low, high : float
        Both ends are in it, and no leaf has one of them for its mean, 0 and 1 aside.
    pixels : int
        That extracting it gives; where regions end at block edges, those of the leaves whose mean lies in it,
        and of a part of a class, of such cells of 8 x 8 pixels.
    share : float
        Of all valid pixels, 0 to 1.
    regions : int
        How many regions extracting it gives.
    exact : bool
        Whether pixels and regions were counted; otherwise they are estimates, see `estimate_regions`.
    value_low, value_high : float or None
        The range in the units of the raster; None where it is open, or values are not known.
    unit : str
        Of the values; empty where it is not known.
    part : bool
        Whether it is a part of the darkest or the brightest range, of small things that stand out in it; the
        others together are 0..1.
    contrast : float or None
        Difference of the means on both sides of its borders, as a multiple of that between means on one side;
        below 2.5, the borders are those of noise or of slow light. None where it is not known.
    """

    low: float
    high: float
    pixels: int
    share: float
    regions: int
    exact: bool = True
    value_low: float | None = None
    value_high: float | None = None
    unit: str = ""
    part: bool = False
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

    Parameters
    ----------
    ranges : tuple of Suggestion
        Those that look most like things on a ground first: compact, closed and contrasting at their borders.
        None where all leaves have one mean.
    explained : float
        Share of the variance of the leaves' means that lies between the ranges, parts aside.
    histogram : (65536,) int64 array
        Valid pixels by the mean grey of their leaf, or by their own.
    intervals : (8 B, 8 C) uint8 array
        Which of `by_intensity` the leaf of each cell of 8 x 8 pixels lies in, or the cell itself where that
        is a part, counted from 1; 0 where the leaf has no valid pixel.
    warnings : tuple of str
    by_pixel : bool
        Whether the ranges part populations of pixels, so that pixels show them better than cells.
    """

    ranges: tuple[Suggestion, ...]
    explained: float
    histogram: NDArray[np.int64] = field(repr=False)
    intervals: NDArray[np.uint8] = field(repr=False)
    blocks: BlockMap = field(repr=False)
    source: SourceInfo
    warnings: tuple[str, ...]
    by_pixel: bool = False

    @property
    def by_intensity(self) -> tuple[Suggestion, ...]:
        """The ranges that together are 0..1, the darkest first, and then their parts."""
        return tuple(sorted(self.ranges, key=lambda one: (one.part, one.low)))
