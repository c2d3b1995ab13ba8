"""Texture of a sample, scores of cells against it (G of moving windows), and rejection of unlike cells.

The model of a sample holds symbol histograms, the spread of the scores of its windows, intensity, and
log-likelihood-ratio weights against the raster as background. Cells are scored tile by tile.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import SampleError
from uavseg.execution.executors import LazySequence, Map
from uavseg.raster.grid.ground import pixel_on_ground
from uavseg.raster.grid.tiling import TilePass, Window, window_cells
from uavseg.regions.outline.rings import EdgeTable, RegionOutlines, Rings, edge_tables
from uavseg.regions.sample.place import SampleMask
from uavseg.regions.tiles.class_tiles import cell_jobs
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.blocks.lbp import COARSE_HALO, SYMBOLS, UNCOUNTED, coarse_symbols, lbp_symbols
from uavseg.segmentation.sample import g_scores
from uavseg.segmentation.sample.pixel_decision import (
    ColorPlane,
    SampleWeights,
    SymbolPair,
    best_mean_weights,
    log_ratio,
    window_sums,
)
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import CELL, GREY_MAX

_OWN_QUANTILE = (19, 20)  # of the scores of windows in the sample: they are similar up to it
_GREY_STEP = 257  # one step of 8 bits: the smallest deviation of a sample
USUAL_WINDOWS = (32, 24, 16)  # pixels
_WINDOWS_IN_SAMPLE = 3  # minimum area of a sample, in windows: a disc with the side as radius


@dataclass(frozen=True)
class Sample:
    """Texture model and intensity of a sample: mean and deviation of the grey levels of its counted pixels.

    `own` is the score that nineteen of twenty of its windows do not exceed, each compared with the rest of
    the sample; at least the expected score under the null hypothesis.
    """

    model: g_scores.TextureModel
    own: int
    mean: float
    deviation: float

    def limit(self, similarity: float) -> int:
        """Return the largest score at which a window has at least this similarity."""
        excess = math.floor(-2 * g_scores.SCORE_UNITS * math.log(similarity))
        return min(self.own + excess, g_scores.MAX_SCORE - 1)

    def similarity(self, score: Floats) -> Floats:
        """Return the similarity to the sample from 0 to 1, for mean scores of windows or regions.

        Half of G is a log-likelihood ratio. So this is the likelihood ratio per pixel of one texture for both
        against two textures, relative to that of windows in the sample.
        """
        excess = np.maximum(score - self.own, 0) / g_scores.SCORE_UNITS
        return np.exp(-excess / 2)

    def bounds(self, deviations: float) -> g_scores.GreyBounds:
        """Return bounds of mean grey, a number of standard deviations around the mean."""
        return bounds_around(self.mean, self.deviation, deviations)


def bounds_around(mean: float, deviation: float, deviations: float) -> g_scores.GreyBounds:
    """Return bounds of mean grey around a mean in grey levels, at least one step of 8 bits from it.

    `deviations` is their distance from it in multiples of the deviation; may be infinite.
    """
    if math.isinf(deviations):
        return g_scores.GreyBounds()
    half = min(max(deviations * deviation, _GREY_STEP), GREY_MAX)
    return g_scores.GreyBounds(max(math.floor(mean - half), 0), min(math.ceil(mean + half), GREY_MAX))


def fit_sample(
    source: GreySource, bin_edges: NDArray[np.int32], place: SampleMask, side: int, map: Map
) -> Sample:
    """Fit the texture model of a sample, with windows of `side` cells.

    `bin_edges` are of the histogram of contrast over the whole raster. SampleError is raised if the sample
    has too few pixels with a texture.
    """
    [(model, scores, moments)] = map(partial(_measure_sample, source, bin_edges, side), [place])
    window = CELL * side
    if model.count == 0:
        raise SampleError("the sample has no valid pixel with valid neighbours; it probably lies on nodata")
    if model.count < 2 * window**2 or len(scores) == 0:
        raise SampleError(
            f"the sample has {model.count:,} pixels with a texture; expected at least {2 * window**2:,}, "
            f"with a window of {window} x {window} among them, as a disc with a radius of "
            f"{_radius(source, window)} has; give a larger sample or a smaller --window, or compare colors "
            "(--by color)"
        )
    count, total, squares = (int(moment) for moment in moments)
    rank = -(-len(scores) * _OWN_QUANTILE[0] // _OWN_QUANTILE[1])
    return Sample(
        model=model,
        own=max(int(np.sort(scores)[rank - 1]), g_scores.NULL_SCORE),
        mean=total / count,
        deviation=math.sqrt((squares * count - total * total) / count**2),
    )


def fit_weights(
    source: GreySource, bin_edges: NDArray[np.int32], place: SampleMask, whole: Integers, side: int, map: Map
) -> SampleWeights:
    """Fit log-likelihood-ratio weights of symbols, sample against background (the whole raster).

    `whole`, (2, 2048), counts each symbol in the raster, at both scales; the others are those of
    `fit_sample`.
    """
    [weights] = map(partial(_fit_sample_weights, source, bin_edges, whole, side), [place])
    return weights


def symbol_pair(tile: GreyTile, bin_edges: NDArray[np.int32]) -> SymbolPair:
    """Return LBP symbols of a tile at both scales, without its halo of COARSE_HALO pixels."""
    inner = np.s_[COARSE_HALO - 1 : 1 - COARSE_HALO, COARSE_HALO - 1 : 1 - COARSE_HALO]
    known = tile.mask
    near = None if known is None else np.ascontiguousarray(known[inner])
    fine = lbp_symbols(np.ascontiguousarray(tile.grey[inner]), near, bin_edges)
    return fine, coarse_symbols(tile.grey, known, bin_edges)


def _fit_sample_weights(
    source: GreySource, bin_edges: NDArray[np.int32], whole: Integers, side: int, place: SampleMask
) -> SampleWeights:
    tile = source.read(place.window, COARSE_HALO)
    return SampleWeights.of(_sample_symbols(tile, bin_edges, place), whole, side)


def _sample_symbols(tile: GreyTile, bin_edges: NDArray[np.int32], place: SampleMask) -> SymbolPair:
    """Return the symbols of the pixels of a sample; UNCOUNTED for the other pixels of its blocks."""
    names = symbol_pair(tile, bin_edges)
    mask = np.zeros(names[0].shape, bool)
    mask[: place.window.rows, : place.window.cols] = place.mask
    for each in names:
        each[~mask] = UNCOUNTED
    return names


def _radius(source: GreySource, pixels: int) -> str:
    """Format a length in pixels, with metres where they are known."""
    box = source.dataset.geobox
    if box.crs is None:
        return f"{pixels} pixels"
    per_col, per_row, _ = pixel_on_ground(box, *(np.array([length / 2]) for length in box.shape))
    metres = pixels * max(float(per_col[0]), float(per_row[0]))
    return f"{pixels} pixels ({metres:.3g} m)" if math.isfinite(metres) else f"{pixels} pixels"


def _measure_sample(
    source: GreySource, bin_edges: NDArray[np.int32], side: int, place: SampleMask
) -> tuple[g_scores.TextureModel, Uint16s, NDArray[np.uint64]]:
    """Measure a sample: texture model, scores of its windows, and count, sum and sum of squares of grey."""
    tile = source.read(place.window, COARSE_HALO)
    names, coarse = _sample_symbols(tile, bin_edges, place)
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    cells = np.ones((names.shape[0] // CELL, names.shape[1] // CELL), np.uint8)
    model = g_scores.texture_model(names, grey, cells, coarse=coarse)
    scores = g_scores.window_scores(names, grey, model, side, leave_one_out=True)
    counted = grey[names != UNCOUNTED].astype(np.uint64)
    moments = np.array([len(counted), counted.sum(), (counted * counted).sum()], np.uint64)
    return model, scores[scores != g_scores.NO_SCORE], moments


def fitting_window(place: SampleMask) -> int | None:
    """Return the side in pixels of the largest usual window that fits into a sample; None where none does."""
    counts = place.cell_counts()
    for side in USUAL_WINDOWS:
        cells = side // CELL
        if counts.sum() >= _WINDOWS_IN_SAMPLE * side**2 and min(counts.shape) >= cells:
            windows = np.lib.stride_tricks.sliding_window_view(counts, (cells, cells))
            if windows.sum((2, 3)).max() >= g_scores.min_count(cells):  # one is covered well enough
                return side
    return None


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
