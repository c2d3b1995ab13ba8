"""Suggestion of ranges: classes of the means of a raster's leaves, and what each range would give."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RasterError
from uavseg.execution.phases import phase
from uavseg.jobs.divide import block_map_of
from uavseg.jobs.result import SourceInfo
from uavseg.jobs.source import Blocks, Pixels, Source
from uavseg.jobs.unchanged import check_unchanged
from uavseg.jobs.work import SERIAL, Work
from uavseg.raster.tiling import TilePass
from uavseg.raster.value_scale import ValueAxis, values_text
from uavseg.regions.tiles.block_map_regions import count_segments
from uavseg.regions.tiles.count_regions import count_regions, estimate_regions
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cell_intervals, histogram_of_means, means_among
from uavseg.segmentation.params import IntensityRange, SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine
from uavseg.segmentation.range_candidates import (
    MAX_CLASSES,
    RangeCandidates,
    edge_beside_means,
    propose_ranges,
)
from uavseg.segmentation.source import GreySource

EXACT_PIXELS = 400_000_000  # of larger rasters, the number of regions is estimated


@dataclass(frozen=True, slots=True)
class SuggestRequest:
    """How many ranges, and of which leaves.

    Parameters
    ----------
    classes : int, optional
        Number of ranges, 2 to 8; by default as many as the histogram of means has.
    segment : SegmentParams
        That regions are counted with; with refine "none", those of cells of the block map.

    Raises
    ------
    ParameterError
        If the number is another.
    """

    classes: int | None = None
    segment: SegmentParams = SegmentParams()

    def __post_init__(self) -> None:
        if self.classes is not None and not 2 <= self.classes <= MAX_CLASSES:
            raise ParameterError(f"ranges are 2 to {MAX_CLASSES} in number, not {self.classes}")


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A range of v that one may ask for.

    Parameters
    ----------
    low, high : float
        Both ends are in it, and no leaf has one of them for its mean, 0 and 1 aside.
    pixels : int
        Valid pixels of the leaves whose mean lies in it.
    share : float
        Of all valid pixels, 0 to 1.
    regions : int
        How many regions extracting it gives.
    exact : bool
        Whether they were counted; otherwise their number is an estimate, see `estimate_regions`.
    value_low, value_high : float or None
        The range in the units of the raster; None where it is open, or values are not known.
    unit : str
        Of the values; empty where it is not known.
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
    """Ranges of v that together are 0..1, and what they come from.

    Parameters
    ----------
    ranges : tuple of Suggestion
        The darkest first; none where all leaves have one mean.
    explained : float
        Share of the variance of the leaves' means that lies between the ranges.
    histogram : (65536,) int64 array
        Valid pixels by the mean grey of their leaf.
    intervals : (8 B, 8 C) uint8 array
        The range of each cell of 8 x 8 pixels, counted from 1; 0 where its leaf has no valid pixel.
    blocks : BlockMap
    source : SourceInfo
    warnings : tuple of str
    """

    ranges: tuple[Suggestion, ...]
    explained: float
    histogram: NDArray[np.int64] = field(repr=False)
    intervals: NDArray[np.uint8] = field(repr=False)
    blocks: BlockMap = field(repr=False)
    source: SourceInfo
    warnings: tuple[str, ...]


def suggest(source: Source, request: SuggestRequest = SuggestRequest(), work: Work = SERIAL) -> Suggestions:
    """Ranges of v of a raster, answered from its block map.

    Parameters
    ----------
    source : Raster, ProbabilityMap or Blocks
        Unless it is a block map, it is divided first.
    request : SuggestRequest
    work : Work

    Raises
    ------
    UavsegError
        If the raster cannot be read or has no valid pixel.
    """
    work = work.begun()
    pixels: Pixels | None
    if isinstance(source, Blocks):
        saved, info = source.saved, SourceInfo.of(source)
        pixels = source.raster if request.segment.refine != "none" else None
        tile_pass = None if pixels is None else work.over(pixels)
    else:
        pixels = source
        dividing, tile_pass = work.over(source).stages(2)
        saved, info = block_map_of(source, dividing)
    found = _suggestions(saved.blocks, info, request)
    if pixels is None or tile_pass is None or request.segment.refine == "none":
        return work.finished(found)
    grey = GreySource(pixels.cleaned(tile_pass.silent), saved.stretch, illumination=saved.illumination)
    if isinstance(source, Blocks):
        with work.reading_here():
            check_unchanged(grey, source)
    with phase("count of regions"):
        ranges = _refined(found.ranges, saved.blocks, grey, request.segment, tile_pass)
    return work.finished(replace(found, ranges=ranges))


def _suggestions(blocks: BlockMap, source: SourceInfo, request: SuggestRequest) -> Suggestions:
    how = request.segment
    histogram = histogram_of_means(blocks, how.division)
    if not histogram.any():
        raise RasterError(
            f"no pixel of {source.name} is valid, so there is no range to choose; look at its nodata "
            "value with uavseg info"
        )
    cuts = propose_ranges(histogram, request.classes)
    taken = means_among(blocks, cuts.edges, how.division)
    edges = tuple(edge_beside_means(edge) if edge in taken else edge for edge in cuts.edges)
    intervals = cell_intervals(blocks, edges, how.division)
    ranges = _in_values(_ranges(blocks, edges, intervals), source.axis) if edges else ()
    warnings = (*source.warnings, *_doubts(cuts, request.classes, histogram))
    return Suggestions(ranges, cuts.classes.explained, histogram, intervals, blocks, source, warnings)


def _ranges(
    blocks: BlockMap, edges: tuple[float, ...], intervals: NDArray[np.uint8]
) -> tuple[Suggestion, ...]:
    """Each range between two edges, with what it gives at the edges of cells."""
    bounds = (0.0, *edges, 1.0)
    pixels = np.bincount(intervals.reshape(-1), blocks.counts.reshape(-1), len(bounds))[1:]
    regions = count_segments(blocks, intervals, len(bounds) - 1)
    total = pixels.sum()
    return tuple(
        Suggestion(bounds[k], bounds[k + 1], int(pixels[k]), float(pixels[k] / total), int(regions[k]))
        for k in range(len(pixels))
    )


def _in_values(ranges: tuple[Suggestion, ...], axis: ValueAxis | None) -> tuple[Suggestion, ...]:
    """The ranges with the values that they stand for."""
    if axis is None:
        return ranges
    found = []
    for one in ranges:
        low, high = (None if np.isnan(end) else float(end) for end in axis.ends(one.low, one.high))
        found.append(replace(one, value_low=low, value_high=high, unit=axis.unit))
    return tuple(found)


def _refined(
    ranges: tuple[Suggestion, ...],
    blocks: BlockMap,
    grey: GreySource,
    segment: SegmentParams,
    tile_pass: TilePass,
) -> tuple[Suggestion, ...]:
    """The ranges with their numbers of regions after refinement."""
    exact = math.prod(grey.shape) <= EXACT_PIXELS
    found = []
    for one, counting in zip(ranges, tile_pass.stages(len(ranges)), strict=True):
        interval = IntensityRange(one.low, one.high)
        cells = cells_to_refine(blocks, interval, segment)
        if exact:
            number = count_regions(grey, cells, interval, segment.refine, counting, blocks)
        else:
            number = estimate_regions(grey, cells, interval, segment.refine, counting)
        found.append(replace(one, regions=number, exact=exact))
    return tuple(found)


def _doubts(cuts: RangeCandidates, wanted: int | None, histogram: NDArray[np.int64]) -> tuple[str, ...]:
    """What the user should know of how far the ranges are to be trusted."""
    found = cuts.classes
    if found.count == 1:
        v = float(np.flatnonzero(histogram)[0] / (len(histogram) - 1))
        return (f"all leaves have the mean v = {v:.4g}: one class, and no range to choose",)
    if wanted is not None and found.count < wanted:
        return (f"the means of the leaves fall into {found.count} bins, which are no {wanted} classes",)
    if wanted is None and not cuts.clear:
        return (
            "the means of the leaves make one hump, without a valley where a cut would be sure; "
            "look where it lies (-o look.png) before you trust it",
        )
    return ()
