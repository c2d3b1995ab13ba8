"""Scores of cells against a sample (G of moving windows), and rejection of unlike cells, tile by tile."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import SampleError
from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, window_cells
from uavseg.regions.outline.rings import EdgeTable, RegionOutlines, Rings, edge_tables
from uavseg.regions.sample.model import bounds_around, symbol_pair
from uavseg.regions.sample.place import SampleMask
from uavseg.regions.tiles.class_tiles import cell_jobs
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.blocks.lbp import COARSE_HALO, SYMBOLS, coarse_symbols, lbp_symbols
from uavseg.segmentation.sample import g_scores
from uavseg.segmentation.sample.pixel_decision import ColorPlane, best_mean_weights, log_ratio, window_sums
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL


@dataclass(frozen=True)
class ColorBand:
    """One band of a sample: bounds of the mean of a window that is like it, and its histogram, (64,).

    Texture is that of one intensity; each further band adds its bounds to the criterion of a window, and its
    histogram to the decision of a pixel.
    """

    source: GreySource
    bounds: g_scores.GreyBounds
    counts: Integers


def fit_colors(sources: Sequence[GreySource], place: SampleMask, deviations: float) -> tuple[ColorBand, ...]:
    """Measure a sample in each band; refuse one without valid pixels in a band, with a SampleError.

    The mean of a window may differ by a number of standard `deviations` of the sample.
    """
    colors, here = [], np.s_[: place.window.rows, : place.window.cols]
    for source in sources:
        tile = source.read(place.window, 0)
        grey = tile.grey[here][place.mask & (tile.valid[here] != 0)]
        if len(grey) == 0:
            raise SampleError(f"the sample has no valid pixel in {source.dataset.band_names}")
        bounds = bounds_around(float(grey.mean()), float(grey.std()), deviations)
        counts = np.bincount(grey >> 10, minlength=g_scores.GREY_BINS).astype(np.int64)
        colors.append(ColorBand(source, bounds, counts))
    return tuple(colors)


def limit_scores(colors: Sequence[ColorBand], scores: Uint16s, window: Window, side: int) -> Uint16s:
    """Set scores of windows around a tile to the maximum where the mean of a band is out of bounds.

    The scores are those of `window_scores`, of the tile at `window` with a halo of ``side - 1`` cells.
    """
    for color in colors:
        tile = color.source.read(window, CELL * (side - 1))
        totals, counts = window_sums(_cell_sums(tile.grey), side), window_sums(_cell_sums(tile.valid), side)
        out = (totals < color.bounds.low * counts) | (totals > color.bounds.high * counts)
        scores = np.where(out & (scores != g_scores.NO_SCORE), np.uint16(g_scores.MAX_SCORE), scores)
        scores[counts < g_scores.min_count(side)] = g_scores.NO_SCORE
    return scores


def _cell_sums(pixels: NDArray[np.integer[Any]]) -> Integers:
    rows, cols = (length // CELL for length in pixels.shape)
    return np.asarray(pixels.reshape(rows, CELL, cols, CELL).sum(axis=(1, 3), dtype=np.int64))


def count_colors(colors: Sequence[ColorBand], window: Window, cells: Bools) -> Integers:
    """Return histograms of the chosen cells of the tile at `window` in each band, (bands, 64) int64."""
    counts = np.zeros((len(colors), g_scores.GREY_BINS), np.int64)
    chosen = cells.repeat(CELL, 0).repeat(CELL, 1)
    for k, color in enumerate(colors):
        tile = color.source.read(window, 0)
        counts[k] = np.bincount(tile.grey[chosen & (tile.valid != 0)] >> 10, minlength=g_scores.GREY_BINS)
    return counts


def color_planes(
    colors: Sequence[ColorBand], rest: Integers, window: Window, margin: int
) -> tuple[ColorPlane, ...]:
    """Read the bands of a tile with a margin in pixels, each with its weights of the sample against the rest.

    `rest`, (bands, 64), are histograms of unlike cells.
    """
    tiles = (color.source.read(window, margin) for color in colors)
    return tuple(
        ColorPlane(tile.grey, tile.valid, log_ratio(color.counts, others))
        for color, others, tile in zip(colors, rest, tiles, strict=True)
    )


@dataclass(frozen=True)
class Criterion:
    """Criterion by which a window is like a sample."""

    model: g_scores.TextureModel  # of the sample
    bin_edges: NDArray[np.int32]  # (7,): of the histogram of contrast
    side: int  # side of a window in cells
    bounds: g_scores.GreyBounds  # of the mean grey of a window
    limit: int  # the largest score of a window that is like the sample
    colors: tuple[ColorBand, ...] = ()  # further bands whose means are bounded


@dataclass(frozen=True)
class CellScores:
    """Best scores of the cells of a raster, and texture models of unlike cells and of all cells."""

    best: Uint16s  # (8 B, 8 C): see `g_scores.best_scores`
    # Of the cells with a score that is too large; not of all that `reject_unlike` rejects.
    rest: g_scores.TextureModel
    whole: Integers  # (2, 2048) int64: count of each symbol in the raster, at both scales
    rest_colors: Integers  # (bands, 64) int64: histograms of the cells of `rest` in further bands


def score_cells(source: GreySource, criterion: Criterion, tile_pass: TilePass) -> CellScores:
    """Compute the best score of every cell."""
    best = np.full(BlockMap.empty(source.shape).counts.shape, g_scores.NO_SCORE, np.uint16)
    rest, whole = g_scores.TextureModel(), np.zeros((2, SYMBOLS), np.int64)
    rest_colors = np.zeros((len(criterion.colors), g_scores.GREY_BINS), np.int64)
    tiles = tile_pass.run(partial(_score_tile, source, criterion))
    for window, scored in zip(tile_pass.windows, tiles, strict=True):
        if scored is not None:
            best[window_cells(window)], unlike, counts, colors = scored
            rest += unlike
            whole += counts
            rest_colors += colors
    return CellScores(best=best, rest=rest, whole=whole, rest_colors=rest_colors)


def _score_tile(
    source: GreySource, criterion: Criterion, window: Window
) -> tuple[Uint16s, g_scores.TextureModel, Integers, Integers] | None:
    """Return the parts of `CellScores` of a tile; None for an empty one."""
    halo, side = CELL * (criterion.side - 1), criterion.side
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, halo + 1)
    names = lbp_symbols(tile.grey, tile.mask, criterion.bin_edges)
    grey = np.ascontiguousarray(tile.grey[1:-1, 1:-1])
    scores = g_scores.window_scores(names, grey, criterion.model, side, criterion.bounds)
    best = g_scores.best_scores(limit_scores(criterion.colors, scores, window, side), side)
    unlike = ((best > criterion.limit) & (best != g_scores.NO_SCORE)).view(np.uint8)
    near = tile.cropped(halo + 1 - COARSE_HALO)
    coarse = coarse_symbols(near.grey, near.mask, criterion.bin_edges)
    whole = g_scores.texture_model(names, grey, np.ones_like(unlike), halo, coarse)
    counts = np.stack([whole.texture, whole.coarse])
    colors = count_colors(criterion.colors, window, unlike.view(np.bool_))
    return best, g_scores.texture_model(names, grey, unlike, halo, coarse), counts, colors


def reject_unlike(
    source: GreySource,
    criterion: Criterion,
    scores: CellScores,
    weights: Integers,
    minimum: int,
    tile_pass: TilePass,
) -> CellScores:
    """Reject cells whose texture the background model (the whole raster) explains better than the sample.

    `weights`, (2, 2048), are of symbols at both scales, see `SampleWeights`; `minimum` is the smallest mean
    weight of a window that is like the sample. Rejected cells have the largest score, and their histograms
    are added to `rest`, except for cells that touch one that is kept.
    """
    matched = scores.best <= criterion.limit
    with_matches = [window for window in tile_pass.windows if matched[window_cells(window)].any()]
    jobs = cell_jobs(matched.view(np.uint8), with_matches, CELL)
    best, rest, rest_colors = scores.best.copy(), scores.rest, scores.rest_colors.copy()
    reject = partial(_reject_tile, source, criterion, weights, minimum)
    for window, (rejected, unlike, colors) in zip(with_matches, tile_pass.run(reject, jobs), strict=True):
        best[window_cells(window)][rejected] = g_scores.MAX_SCORE
        rest += unlike
        rest_colors += colors
    return replace(scores, best=best, rest=rest, rest_colors=rest_colors)


def _reject_tile(
    source: GreySource, criterion: Criterion, weights: Integers, minimum: int, job: tuple[Window, Uint8s]
) -> tuple[Bools, g_scores.TextureModel, Integers]:
    """Return the rejected cells of a tile, and histograms of those off boundaries, beside no kept one."""
    window, around = job  # cells of the tile, and one more on every side
    halo = CELL * criterion.side
    tile = source.read(window, halo + COARSE_HALO)
    names = symbol_pair(tile, criterion.bin_edges)
    explained = best_mean_weights(names, weights, criterion.side) >= minimum
    matched, inner = around.view(np.bool_), np.s_[1:-1, 1:-1]
    rejected = (matched & ~explained)[inner]
    unlike = rejected & ~dilate(matched & explained, 1)[inner]
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    coarse = np.ascontiguousarray(names[1][halo:-halo, halo:-halo])
    model = g_scores.texture_model(names[0], grey, unlike.view(np.uint8), halo, coarse)
    return rejected, model, count_colors(criterion.colors, window, unlike)


def mean_scores(outlined: RegionOutlines, best: Uint16s, tile_pass: TilePass) -> Floats:
    """Compute the mean score of the pixels of each region, (n,); NaN for a region without scored cells.

    `best`, (8 B, 8 C), are the scores of cells.
    """
    sums, counts = np.zeros((2, len(outlined.sums.counts) + 1), np.int64)
    tables = edge_tables(outlined.rings, tile_pass.windows)
    jobs = LazySequence(len(tables), lambda k: (tables[k], best[window_cells(tables[k].window)]))
    for names, total, count in tile_pass.silent.run(_sum_scores, jobs):
        sums[names] += total
        counts[names] += count
    means = np.full(len(sums) - 1, np.nan)
    np.divide(sums[1:], counts[1:], out=means, where=counts[1:] > 0)
    return means


def _sum_scores(job: tuple[EdgeTable, Uint16s]) -> tuple[Integers, Integers, Integers]:
    """Return the labels in a tile, and the sum of scores and the number of scored pixels of each."""
    edges, best = job
    labels = edges.rasterise()
    rows, cols = labels.shape
    scores = best.repeat(CELL, 0)[:rows].repeat(CELL, 1)[:, :cols].astype(np.int64)
    labels[scores >= g_scores.MAX_SCORE] = 0
    counts = np.bincount(labels.ravel())
    names = np.flatnonzero(counts[1:]) + 1
    sums = np.bincount(labels.ravel(), scores.ravel()).astype(np.int64)
    return names, sums[names], counts[names]


def inner_cells(rings: Rings, shape: tuple[int, int], tile_pass: TilePass) -> Bools:
    """Return which cells of a raster have all their pixels in regions, (8 B, 8 C); none that exceeds it."""
    inner = np.zeros(BlockMap.empty(shape).counts.shape, bool)
    tiles = tile_pass.run(_whole_cells, edge_tables(rings, tile_pass.windows))
    for window, cells in zip(tile_pass.windows, tiles, strict=True):
        inner[Window(window.row // CELL, window.col // CELL, *cells.shape).slices] = cells
    return inner


def _whole_cells(table: EdgeTable) -> Bools:
    labels = table.rasterise()
    rows, cols = (length // CELL for length in labels.shape)
    inside = labels[: rows * CELL, : cols * CELL].reshape(rows, CELL, cols, CELL) > 0
    return np.asarray(inside.all((1, 3)))
