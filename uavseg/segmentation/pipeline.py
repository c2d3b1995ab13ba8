"""Segmentation pipeline, from a raster to its block map and to refined tiles: read this first.

measure_cells     cell sums and the histogram of contrast   (one pass over all tiles)
fill_ratios       R where it is required                    (the tiles with such blocks)
cells_to_refine   leaves in range                           (on the block map alone)
refine_tile       pixels of a tile in regions               (one pass over all tiles)

Where each pixel is decided, by total variation or by its own value, the last step is the only one.
`refine_tile_classes` is that step for several intervals at once.
"""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Floats, Integers, Uint8s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import TilePass, Window, whole_blocks, window_blocks, window_cells
from uavseg.segmentation.blocks.block_map import BlockMap, cell_sums, required_ratios
from uavseg.segmentation.blocks.division import ALL_RATIOS, block_ratios, selected_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram
from uavseg.segmentation.blocks.leaves import cells_in_range, cells_to_pixels, pixel_classes, pixels_in_range
from uavseg.segmentation.params.segment import (
    PIXELWISE,
    DivisionParams,
    IntensityRange,
    Intervals,
    Refinement,
    SegmentParams,
)
from uavseg.segmentation.refine.range_scans import REFINE_HALO, refine_by_local_mean, refine_by_scans
from uavseg.segmentation.refine.total_variation import refine_by_tv, refine_classes_by_tv
from uavseg.segmentation.source import CACHED_SIDE, CAPACITY, BlockCache, GreySource, GreyTile
from uavseg.units import BLOCK, CELL, CELLS, GREY_LEVELS, GREY_MAX

Sources = Sequence[GreySource]
_Job = tuple[Window, NDArray[np.uint32]]  # a tile, and bit masks of the ratios of its blocks

IN_RANGE = np.uint8(1)


@dataclass(frozen=True)
class MeasuredCells:
    """Block map without ratios, and the bin edges of contrast: the result of the first pass."""

    blocks: BlockMap
    bin_edges: NDArray[np.int32] = field(repr=False)


@dataclass(frozen=True)
class Part:
    """A part of a raster that has a block map of its own, for rasters whose block map is too large."""

    window: Window  # begins at a block
    bin_edges: NDArray[np.int32] = field(repr=False)  # (7,): of the contrast of the whole raster


def measure_block_map(source: GreySource, tile_pass: TilePass) -> BlockMap:
    """Measure the whole block map of a raster: sums and counts of all cells, R of all blocks."""
    measuring, dividing = tile_pass.stages(2)
    measured = measure_cells(source, measuring)
    rows, cols = measured.blocks.blocks
    any_valid = measured.blocks.counts.reshape(rows, CELLS, cols, CELLS).any(axis=(1, 3))
    required = np.where(any_valid, ALL_RATIOS, np.uint32(0))
    fill_ratios(source, measured, required, dividing)
    return measured.blocks


def measure_block_map_for(
    source: GreySource, intervals: Intervals, params: SegmentParams, tiles: TilePass, part: Part | None = None
) -> BlockMap:
    """Measure a block map that answers one range, states or levels exactly, of a raster or of a part of it.

    R is computed only where the means of a block's cells do not decide in which interval its leaves lie. The
    pass has the tiles of the part.
    """
    return measure_block_maps_for([source], intervals, params, tiles, part)[0]


def measure_block_maps_for(
    sources: Sources, intervals: Intervals, params: SegmentParams, tiles: TilePass, part: Part | None = None
) -> list[BlockMap]:
    """Measure the block maps of several sources of one shape in one pass; see `measure_block_map_for`."""
    measuring, *dividing = tiles.stages(1 + len(sources))
    capacity = CAPACITY // len(sources)
    queries = [LeafQuery(intervals.edges, params.division, BlockCache(capacity)) for _ in sources]
    several = _measure_several(sources, measuring, queries, part)
    for source, measured, query, tiles in zip(sources, several, queries, dividing, strict=True):
        required = query.required_ratios(measured.blocks.sums, measured.blocks.counts)
        fill_ratios(source, measured, required, tiles, query, part)
    return [measured.blocks for measured in several]


@dataclass(frozen=True)
class LeafQuery:
    """Intervals and division parameters, which decide what R is required, and a cache of blocks."""

    edges: tuple[float, ...]
    division: DivisionParams
    cache: BlockCache = field(default_factory=BlockCache, repr=False, compare=False)

    def required_ratios(self, sums: Uint32s, counts: Uint8s) -> Uint32s:
        """Return bit masks of the required ratios, see `block_map.required_ratios`."""
        return required_ratios(sums, counts, self.edges, self.division.step)


@dataclass(frozen=True)
class _CacheBlocks:
    """Cache of the blocks that a query requires, filled while cells are measured."""

    query: LeafQuery | None

    def fingerprint(self) -> tuple[()]:
        return ()  # cells do not depend on the query: a checkpoint of them serves every query

    def put(self, window: Window, tile: GreyTile, sums: Uint32s, counts: Uint8s) -> None:
        if self.query is not None:
            self.query.cache.put(window, tile, _block_corners(self.query.required_ratios(sums, counts)))


def measure_cells(source: GreySource, tile_pass: TilePass) -> MeasuredCells:
    """Measure sums and counts of all cells, and the bin edges of contrast over the raster (first pass)."""
    return _measure_several([source], tile_pass, [None])[0]


def _measure_several(
    sources: Sources, tile_pass: TilePass, queries: Sequence[LeafQuery | None], part: Part | None = None
) -> list[MeasuredCells]:
    whole = _window_of(sources[0], part)
    maps = [BlockMap.empty((whole.rows, whole.cols)) for _ in sources]
    histograms = [np.zeros(GREY_LEVELS, np.int64) for _ in sources]
    caches = [_CacheBlocks(query) for query in queries]
    measure_tile = partial(_measure_tile, list(zip(sources, caches, strict=True)))
    for window, results in zip(tile_pass.windows, tile_pass.run(measure_tile), strict=True):
        cells = window_cells(window.relative_to(whole))
        for blocks, histogram, result in zip(maps, histograms, results, strict=True):
            if result is None:
                continue
            sums, counts, contrasts = result
            blocks.sums[cells], blocks.counts[cells] = sums, counts
            histogram += contrasts
    edges = [part.bin_edges if part else contrast_bin_edges(histogram) for histogram in histograms]
    return list(map(MeasuredCells, maps, edges))


def _window_of(source: GreySource, part: Part | None) -> Window:
    return part.window if part else Window(0, 0, *source.shape)


def sum_contrasts(source: GreySource, windows: Sequence[Window]) -> Integers:
    """Count the pixels of some windows by contrast, (65536,) int64; see `lbp.contrast_bin_edges`."""
    histogram = np.zeros(GREY_LEVELS, np.int64)
    for window in windows:
        if not source.dataset.is_empty(window):
            tile = source.read(window, 1)
            histogram += contrast_histogram(tile.grey, tile.mask)
    return histogram


def with_majority_means(
    blocks: BlockMap, source: GreySource, edges: Sequence[float], tile_pass: TilePass
) -> BlockMap:
    """Replace the mean of each cell by that of the population that most of its pixels belong to.

    The mean of two populations is a value that neither has, so thresholds of such means separate no pixels.
    `source` is the raster that the block map was made from. The edges between populations increase; no pixel
    has one of them for its v.
    """
    greys = [-1, *(math.floor(edge * GREY_MAX) for edge in edges), GREY_MAX]
    sums = np.zeros_like(blocks.sums)
    results = tile_pass.run(partial(_majority_sums, source, greys))
    for window, result in zip(tile_pass.windows, results, strict=True):
        sums[window_cells(window)] = result
    return replace(blocks, sums=sums)


def fill_ratios(
    source: GreySource,
    measured: MeasuredCells,
    required: Uint32s,
    tile_pass: TilePass,
    query: LeafQuery | None = None,
    part: Part | None = None,
) -> None:
    """Fill in the required ratios of the block map, in place (second pass); others stay 0.

    Bit k of `required`, (B, C), is set where ratio k of a block is required. With `query`, the blocks within
    a required block that is not divided are skipped, and its cache is read.
    """
    whole = _window_of(source, part)
    jobs = [(window, required[window_blocks(window.relative_to(whole))]) for window in tile_pass.windows]
    jobs = [job for job in jobs if job[1].any()]
    divide_tile = partial(_divide_tile, source, measured.bin_edges, query)
    for (window, bits), ratios in zip(jobs, tile_pass.run(divide_tile, jobs), strict=True):
        measured.blocks.ratios[window_blocks(window.relative_to(whole))][bits > 0] = ratios


def cells_to_refine(blocks: BlockMap, interval: IntensityRange, params: SegmentParams) -> Uint8s:
    """Return the cells that are IN_RANGE by the mean of their leaf, (8 B, 8 C); all where no leaf decides."""
    if params.decides_pixels:
        return every_cell(blocks.shape)
    return cells_in_range(blocks, interval, params.division)


def every_cell(shape: tuple[int, int]) -> Uint8s:
    """Return all cells of a raster of a shape as IN_RANGE: a read-only view of one value."""
    rows, cols = (whole_blocks(length) // CELL for length in shape)
    return np.broadcast_to(IN_RANGE, (rows, cols))


def refine_tile(
    source: GreySource, cells: Uint8s, interval: IntensityRange, refine: Refinement, window: Window
) -> tuple[Uint8s, GreyTile] | None:
    """Refine the regions of a tile to the pixel; None where no cell is in range, or no pixel is valid.

    `cells` are those of the window with a halo of REFINE_HALO, from `cells_to_refine`; 0 outside the raster,
    and ignored by refinements that decide each pixel. The pixels, (M + 2 REFINE_HALO, N + 2 REFINE_HALO)
    uint8, are 1 in regions, exact on the window and a border of one pixel. The tile has the grey of the same
    pixels.
    """
    if refine in PIXELWISE:
        if source.dataset.is_empty(window.grown(REFINE_HALO).clipped(source.shape)):
            return None
        tile = source.read(window, REFINE_HALO, excess=True)
        pixels = pixels_in_range(tile.grey, tile.valid, *interval.greys)
        if refine == "tv":
            refine_by_tv(pixels, tile.valid, tile.grey, interval.greys, source.is_intensity)
        return pixels, tile
    if not cells.any():
        return None
    tile = source.read(window, REFINE_HALO, excess=True)
    pixels = cells_to_pixels(cells, tile.valid)
    if refine == "scan" and not cells.all():
        refine_by_scans(pixels, tile.valid, pixels_in_range(tile.grey, tile.valid, *interval.greys))
    elif refine == "smooth" and not cells.all():
        pixels = refine_by_local_mean(pixels, tile.valid, tile.grey, interval.low, interval.high)
    return pixels, tile


def refine_tile_classes(
    source: GreySource, table: Uint8s, refine: Refinement, window: Window
) -> tuple[Uint8s, GreyTile] | None:
    """Decide the classes of a tile's pixels by the (65536,) `table` of greys; None where no pixel is valid.

    The classes and the tile have the shape that those of `refine_tile` have; 0 is for no class. `refine` is
    "tv" or "pixels".
    """
    if source.dataset.is_empty(window.grown(REFINE_HALO).clipped(source.shape)):
        return None
    tile = source.read(window, REFINE_HALO, excess=True)
    classes = pixel_classes(tile.grey, tile.valid, table)
    if refine == "tv":
        refine_classes_by_tv(classes, tile.valid, tile.grey, table)
    return classes, tile


def _measure_tile(
    sources: Sequence[tuple[GreySource, _CacheBlocks]], window: Window
) -> list[tuple[Uint32s, Uint8s, Integers] | None]:
    return [_measure_source(source, cache, window) for source, cache in sources]


def _measure_source(
    source: GreySource, cache: _CacheBlocks, window: Window
) -> tuple[Uint32s, Uint8s, Integers] | None:
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, 1)
    sums, counts = cell_sums(tile.grey, tile.valid, margin=1)
    cache.put(window, tile, sums, counts)
    return sums, counts, contrast_histogram(tile.grey, tile.mask)


def _majority_sums(source: GreySource, greys: Sequence[int], window: Window) -> Uint32s:
    """Sum the cells of a tile as if all of their pixels were of the most frequent population."""
    tile = source.read(window, 0)
    _, total = cell_sums(tile.grey, tile.valid)
    majority = np.zeros((2, *total.shape), np.int64)
    for low, high in pairwise(greys):
        inside = pixels_in_range(tile.grey, tile.valid, low + 1, high)
        sums, counts = cell_sums(tile.grey * inside, inside)
        majority = np.where(counts > majority[1], (sums, counts), majority)
    return np.asarray((majority[0] * total // np.maximum(majority[1], 1)).astype(np.uint32))


def _divide_tile(
    source: GreySource, bin_edges: NDArray[np.int32], query: LeafQuery | None, job: _Job
) -> Floats:
    window, bits = job
    corners = _block_corners(bits)
    cached = None if query is None else query.cache.take(window)
    if cached is not None:
        grey, valid = cached
        corners = np.stack([np.arange(len(corners)) * CACHED_SIDE, np.zeros(len(corners), np.int64)], axis=1)
    else:
        row, col = (int(first) for first in corners.min(axis=0))
        end_row, end_col = (int(last) + BLOCK for last in corners.max(axis=0))
        part = Window(window.row + row, window.col + col, end_row - row, end_col - col)
        tile = source.read(part, 1)
        grey, valid = tile.grey, tile.mask
        corners = corners - (part.row - window.row, part.col - window.col)
    if query is None:
        return block_ratios(grey, valid, bin_edges, corners)
    return selected_ratios(grey, valid, bin_edges, corners, bits[bits > 0], query.division.threshold)


def _block_corners(bits: Uint32s) -> Integers:
    """Return the first pixels of the blocks with any bit set, (k, 2)."""
    return np.stack(np.nonzero(bits), axis=1) * BLOCK
