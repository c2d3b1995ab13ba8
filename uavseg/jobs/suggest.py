"""Ranges worth asking for: what the means of a raster's leaves fall into, and what each range would give."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import Map, Progress, serial
from uavseg.jobs.extract import ExtractParams, divide
from uavseg.jobs.result import About
from uavseg.raster.dataset import Dataset
from uavseg.regions.tiles.block_map_regions import count_segments
from uavseg.segmentation.blocks.block_file import SavedBlocks
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaf_means import histogram_of_means, means_among
from uavseg.segmentation.blocks.leaves import cell_intervals
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.range_candidates import (
    MAX_CLASSES,
    RangeCandidates,
    edge_beside_means,
    propose_ranges,
)
from uavseg.segmentation.source import GreySource

PARAMS = ExtractParams(SegmentParams(refine="none"))
"""How leaves are found unless something else is said."""


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
        How many regions it gives before their boundaries are refined.
    """

    low: float
    high: float
    pixels: int
    share: float
    regions: int

    @property
    def range(self) -> tuple[float, float]:
        """As `uavseg.extract` takes it."""
        return self.low, self.high

    def __str__(self) -> str:
        """As --range takes it."""
        return f"{self.low:.7g},{self.high:.7g}"


@dataclass(frozen=True)
class Suggestions:
    """Ranges of v that together are 0..1, and what one wants to see of them.

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
    about : About
    warnings : tuple of str
    """

    ranges: tuple[Suggestion, ...]
    explained: float
    histogram: NDArray[np.int64] = field(repr=False)
    intervals: NDArray[np.uint8] = field(repr=False)
    blocks: BlockMap = field(repr=False)
    about: About
    warnings: tuple[str, ...]


def suggest(
    dataset: Dataset,
    classes: int | None = None,
    params: ExtractParams = PARAMS,
    map: Map = serial,
    progress: Progress | None = None,
) -> Suggestions:
    """Ranges of v of a raster, answered from its block map: the raster is passed as `divide` passes it.

    Parameters
    ----------
    dataset : Dataset
    classes : int, optional
        Number of ranges, 2 to 8; what the histogram of means has by itself, if left out.
    params : ExtractParams
        Of which `segment`, `stretch` and `tile` are used.
    map : Map
        Who runs the work.
    progress : callable, optional

    Raises
    ------
    UavsegError
        If the raster cannot be read, has no valid pixel, or a parameter is wrong.
    """
    _check(classes)
    blocks, stretch = divide(dataset, params.stretch, params.tile, map, progress)
    return _suggestions(blocks, About.source(GreySource(dataset, stretch)), classes, params.segment)


def suggest_from_blocks(
    saved: SavedBlocks, classes: int | None = None, params: ExtractParams = PARAMS
) -> Suggestions:
    """Ranges of v answered from a block map alone.

    Parameters
    ----------
    saved : SavedBlocks
    classes, params
        As of `suggest`.
    """
    _check(classes)
    return _suggestions(saved.blocks, About.saved(saved), classes, params.segment)


def _check(classes: int | None) -> None:
    if classes is not None and not 2 <= classes <= MAX_CLASSES:
        raise ParameterError(f"ranges are 2 to {MAX_CLASSES} in number, not {classes}")


def _suggestions(blocks: BlockMap, about: About, classes: int | None, how: SegmentParams) -> Suggestions:
    histogram = histogram_of_means(blocks, how.division)
    if not histogram.any():
        raise RasterError(
            f"no pixel of {about.name} is valid, so there is no range to choose; look at its nodata "
            "value with uavseg info"
        )
    cuts = propose_ranges(histogram, classes)
    taken = means_among(blocks, cuts.edges, how.division)
    edges = tuple(edge_beside_means(edge) if edge in taken else edge for edge in cuts.edges)
    intervals = cell_intervals(blocks, edges, how.division)
    ranges = _ranges(blocks, edges, intervals) if edges else ()
    warnings = (*about.warnings, *_doubts(cuts, classes, histogram))
    return Suggestions(ranges, cuts.classes.explained, histogram, intervals, blocks, about, warnings)


def _ranges(
    blocks: BlockMap, edges: tuple[float, ...], intervals: NDArray[np.uint8]
) -> tuple[Suggestion, ...]:
    """Each range between two edges, with what it gives."""
    bounds = (0.0, *edges, 1.0)
    pixels = np.bincount(intervals.reshape(-1), blocks.counts.reshape(-1), len(bounds))[1:]
    regions = count_segments(blocks, intervals, len(bounds) - 1)
    total = pixels.sum()
    return tuple(
        Suggestion(bounds[k], bounds[k + 1], int(pixels[k]), float(pixels[k] / total), int(regions[k]))
        for k in range(len(pixels))
    )


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
