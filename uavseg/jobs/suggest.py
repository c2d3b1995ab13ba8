"""Suggestion of ranges: classes of the means of a raster's leaves, and what each range would give."""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np

from uavseg.arrays import Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import phase
from uavseg.jobs.divide import block_map_of
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.source import Blocks, Pixels, Source, check_unchanged
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.thresholds import population_edges
from uavseg.raster.spectral.bands import ValueAxis, values_text
from uavseg.regions.tiles.class_tiles import count_segments
from uavseg.regions.tiles.range_tiles import count_greys, estimate_regions, outline_regions
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.cell_pairs import cells_with_mean_in_range, count_cell_pairs
from uavseg.segmentation.blocks.leaves import cell_intervals, cells_in_range, histogram_of_means, means_among
from uavseg.segmentation.params.segment import IntensityRange, SegmentParams
from uavseg.segmentation.pipeline import with_majority_means
from uavseg.segmentation.range_choice import (
    MAX_CLASSES,
    MIN_CONTRAST,
    ChosenRange,
    RangeChoice,
    choose_ranges,
    edge_beside_means,
)
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

EXACT_PIXELS = 400_000_000  # of larger rasters, the number of regions is estimated


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
    part: bool = False  # of the darkest or brightest range, which it stands out from; the others make up 0..1
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


Ranges = tuple[Suggestion, ...]


@dataclass(frozen=True)
class Suggestions:
    """Ranges of v, and what they come from.

    The class that looks most like things on a ground comes first: compact, closed and contrasting at its
    borders; then the other classes, then parts. There are none where all leaves have one mean.
    """

    ranges: tuple[Suggestion, ...]
    explained: float  # share of the variance of the leaves' means between the ranges, parts aside
    histogram: Integers = field(repr=False)  # (65536,): by the grey of leaves, or of pixels
    # (8 B, 8 C): which of `by_intensity`, from 1, the leaf of each cell of 8 x 8 pixels lies in, or the cell
    # itself where that is a part; 0 where the leaf has no valid pixel
    intervals: Uint8s = field(repr=False)
    blocks: BlockMap = field(repr=False)
    source: SourceInfo
    warnings: tuple[str, ...]
    by_pixel: bool = False  # the ranges part populations of pixels, which pixels show better than cells

    @property
    def by_intensity(self) -> tuple[Suggestion, ...]:
        """The ranges that together are 0..1, the darkest first, and then their parts."""
        return tuple(sorted(self.ranges, key=lambda one: (one.part, one.low)))


@dataclass(frozen=True, slots=True)
class SuggestRequest:
    """How many ranges, 2 to 8, by default as many as the histogram of means has, and of which leaves.

    Regions are counted with `segment`; with refine "none", those of cells of the block map. Another number is
    refused with ParameterError.
    """

    classes: int | None = None
    segment: SegmentParams = SegmentParams()

    def __post_init__(self) -> None:
        if self.classes is not None and not 2 <= self.classes <= MAX_CLASSES:
            raise ParameterError(f"ranges are 2 to {MAX_CLASSES} in number, not {self.classes}")


def suggest(source: Source, request: SuggestRequest = SuggestRequest(), work: Work = SERIAL) -> Suggestions:
    """Return ranges of v of a raster, answered from its block map; any other source is divided first.

    RasterError is raised if it has no valid pixel.
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
    if pixels is None or tile_pass is None or request.segment.refine == "none":
        return work.finished(_suggestions(saved.blocks, info, request, False))
    grey = GreySource(pixels.cleaned(tile_pass.silent), saved.stretch, illumination=saved.illumination)
    if isinstance(source, Blocks):
        with work.reading_here():
            check_unchanged(grey, source)
    looking, counting = tile_pass.stages(2)
    found = _with_populations(saved.blocks, info, request, grey, looking)
    with phase("count of regions"):
        ranges = _refined(found.ranges, saved.blocks, grey, request.segment, counting)
    return work.finished(replace(found, ranges=ranges))


def _with_populations(
    blocks: BlockMap, source: SourceInfo, request: SuggestRequest, grey: GreySource, tile_pass: TilePass
) -> Suggestions:
    """Return the ranges where regions are refined: those of populations too, where each pixel is decided."""
    if not request.segment.decides_pixels:
        return _suggestions(blocks, source, request, True)
    with phase("populations"):
        greys = count_greys(grey, tile_pass, math.prod(grey.shape) <= EXACT_PIXELS)
        populations = population_edges(greys) if request.classes is None else ()
        if populations:
            blocks = with_majority_means(blocks, grey, populations, tile_pass.silent)
    found = _suggestions(blocks, source, request, True, greys, populations)
    shown = bool(populations) and not grey.is_flat
    return replace(found, histogram=greys, by_pixel=True) if shown else found


def _suggestions(
    blocks: BlockMap,
    source: SourceInfo,
    request: SuggestRequest,
    refined: bool,
    greys: Integers | None = None,
    populations: tuple[float, ...] = (),
) -> Suggestions:
    """Return the ranges with what they give at the edges of cells, which `refined` says will not be all."""
    how = request.segment
    histogram = histogram_of_means(blocks, how.division)
    if not histogram.any():
        raise RasterError(
            f"no pixel of {source.name} is valid, so there is no range to choose; look at its nodata "
            "value with uavseg info"
        )
    choice = choose_ranges(histogram, count_cell_pairs(blocks), request.classes, refined, greys, populations)
    warnings = (*source.warnings, *_doubts(choice, request.classes, histogram, bool(populations)))
    if not choice.edges:
        intervals = cell_intervals(blocks, (), how.division)
        return Suggestions((), choice.explained, histogram, intervals, blocks, source, warnings)
    taken = means_among(blocks, choice.bounds, how.division)
    if greys is not None:
        places = {end: round(end * GREY_MAX) for end in choice.bounds}
        taken |= {end for end, at in places.items() if at / GREY_MAX == end and greys[at]}
    beside = {end: edge_beside_means(end) if end in taken else end for end in (0.0, *choice.bounds, 1.0)}
    chosen = [replace(one, low=beside[one.low], high=beside[one.high]) for one in choice.ranges]
    edges = [beside[edge] for edge in choice.edges]
    intervals = cell_intervals(blocks, edges, how.division)
    pixels = np.bincount(intervals.reshape(-1), blocks.counts.reshape(-1), len(edges) + 2)[1:].tolist()
    regions = count_segments(blocks, intervals, len(edges) + 1).tolist()
    found = [_suggestion(blocks, *each) for each in zip(chosen, map(int, pixels), regions, strict=False)]
    for kind, part in enumerate(chosen[len(found) :], len(found) + 1):
        cells = cells_with_mean_in_range if refined else partial(cells_in_range, division=how.division)
        inside = cells(blocks, IntensityRange(part.low, part.high))
        intervals[inside > 0] = kind
        held = int(blocks.counts[inside > 0].sum(dtype=np.int64))
        found.append(_suggestion(blocks, part, held, int(count_segments(blocks, inside, 1)[0])))
    ranges = _in_values([found[k] for k in choice.ranked], source.axis)
    return Suggestions(ranges, choice.explained, histogram, intervals, blocks, source, warnings)


def _suggestion(blocks: BlockMap, one: ChosenRange, pixels: int, regions: int) -> Suggestion:
    total = int(blocks.counts.sum(dtype=np.int64))
    contrast = None if one.border is None else one.border.contrast or None  # no border: not known
    return Suggestion(one.low, one.high, pixels, pixels / total, regions, part=one.is_part, contrast=contrast)


def _in_values(ranges: Sequence[Suggestion], axis: ValueAxis | None) -> Ranges:
    """Return the ranges with the values that they stand for."""
    if axis is None:
        return tuple(ranges)
    found = []
    for one in ranges:
        low, high = (None if np.isnan(end) else float(end) for end in axis.ends(one.low, one.high))
        found.append(replace(one, value_low=low, value_high=high, unit=axis.unit))
    return tuple(found)


def _refined(
    ranges: Ranges, blocks: BlockMap, grey: GreySource, segment: SegmentParams, tile_pass: TilePass
) -> Ranges:
    """Return the ranges with their numbers of regions after refinement."""
    exact = math.prod(grey.shape) <= EXACT_PIXELS
    total = int(blocks.counts.sum(dtype=np.int64))
    found = []
    for one, counting in zip(ranges, tile_pass.stages(len(ranges)), strict=True):
        interval = IntensityRange(one.low, one.high)
        cells = cells_in_range(blocks, interval, segment.division)
        if exact:
            counts = outline_regions(grey, cells, interval, segment.refine, counting, blocks).sums.counts
            number, held = len(counts), int(counts.sum())
            share = held / total
        else:
            number, share = estimate_regions(grey, cells, interval, segment.refine, counting)
            held = round(share * total)
        found.append(replace(one, regions=number, pixels=held, share=share, exact=exact))
    return tuple(found)


def _doubts(choice: RangeChoice, wanted: int | None, histogram: Integers, parted: bool) -> tuple[str, ...]:
    """Return what the user should know of how far the ranges are to be trusted."""
    classes = len(choice.edges) + 1
    if classes == 1:
        v = float(np.flatnonzero(histogram)[0] / (len(histogram) - 1))
        return (f"all leaves have the mean v = {v:.4g}: one class, and no range to choose",)
    found = []
    if wanted is not None and classes < wanted:
        found.append(f"the means of the leaves fall into {classes} bins, which are no {wanted} classes")
    is_part, weak = max(choice.ranges, key=lambda one: one.score).is_part, choice.contrast / MIN_CONTRAST
    doubts = {
        "no range stands out at its borders": weak < 1 and not parted,
        "a part of a class stands out more than any class": is_part and not choice.separated,
        "the classes overlap, and no valley parts them": weak < 2 and not choice.separated,
    }
    how_far = f"contrast {choice.contrast:.1f}; noise and slow light reach {MIN_CONTRAST}"
    trust = f"({how_far}); look where the ranges lie (-o look.png) before you trust them"
    found += [f"{doubt} {trust}" for doubt, is_true in doubts.items() if is_true][:1]
    return tuple(found)
