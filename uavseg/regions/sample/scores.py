"""Scores of cells against a sample (G of moving windows), tile by tile."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.lazy_sequence import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, window_cells
from uavseg.regions.outline.rasterise import EdgeTable, edge_tables
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.sample.colors import (
    GREY_BINS,
    ColorBand,
    count_colors,
    limit_scores,
)
from uavseg.regions.sample.model import Sample
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.lbp import SYMBOLS, lbp_symbols
from uavseg.segmentation.sample import coarse_lbp
from uavseg.segmentation.sample.coarse_lbp import coarse_symbols
from uavseg.segmentation.sample.g_scores import (
    MAX_SCORE,
    NO_SCORE,
    GreyBounds,
    TextureModel,
    best_scores,
    texture_model,
    window_scores,
)
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import CELL


@dataclass(frozen=True)
class Criterion:
    """Criterion by which a window is like a sample.

    Parameters
    ----------
    model : TextureModel
        Of the sample.
    bin_edges : (7,) int32 array
        Of the histogram of contrast.
    side : int
        Side of a window in cells.
    bounds : GreyBounds
        Of the mean grey of a window.
    limit : int
        The largest score of a window that is like the sample.
    colors : tuple of ColorBand
        Further bands whose means are bounded.
    """

    model: TextureModel
    bin_edges: NDArray[np.int32]
    side: int
    bounds: GreyBounds
    limit: int
    colors: tuple[ColorBand, ...] = ()

    @classmethod
    def of(
        cls,
        sample: Sample,
        bin_edges: NDArray[np.int32],
        side: int,
        similarity: float,
        deviations: float,
        colors: tuple[ColorBand, ...] = (),
    ) -> "Criterion":
        """Criterion from a minimum similarity, and a number of deviations from the sample's mean grey."""
        bounds = sample.bounds(deviations)
        return cls(sample.model, bin_edges, side, bounds, sample.limit(similarity), colors)


@dataclass(frozen=True)
class CellScores:
    """Best scores of the cells of a raster, and texture models of unlike cells and of all cells.

    Parameters
    ----------
    best : (8 B, 8 C) uint16 array
        See `g_scores.best_scores`.
    rest : TextureModel
        Of the cells with a score that is too large; not of all that `reject_unlike` rejects.
    whole : (2, 2048) int64 array
        Count of each symbol in the raster, at both scales.
    rest_colors : (bands, 64) int64 array
        Histograms of the cells of `rest` in further bands.
    """

    best: NDArray[np.uint16]
    rest: TextureModel
    whole: NDArray[np.int64]
    rest_colors: NDArray[np.int64]


def score_cells(
    source: GreySource,
    criterion: Criterion,
    tile_pass: TilePass,
) -> CellScores:
    """The best score of every cell.

    Parameters
    ----------
    source : GreySource
    criterion : Criterion
    tile_pass : TilePass
    """
    best = np.full(BlockMap.empty(source.shape).counts.shape, NO_SCORE, np.uint16)
    rest, whole = TextureModel(), np.zeros((2, SYMBOLS), np.int64)
    rest_colors = np.zeros((len(criterion.colors), GREY_BINS), np.int64)
    for window, found in zip(
        tile_pass.windows, tile_pass.run(partial(_score_tile, source, criterion)), strict=True
    ):
        if found is not None:
            best[window_cells(window)], unlike, counts, colors = found
            rest += unlike
            whole += counts
            rest_colors += colors
    return CellScores(best, rest, whole, rest_colors)


def mean_scores(
    outlined: RegionOutlines, best: NDArray[np.uint16], tile_pass: TilePass
) -> NDArray[np.float64]:
    """Mean score of the pixels of each region.

    Parameters
    ----------
    outlined : RegionOutlines
    best : (8 B, 8 C) uint16 array
        Scores of cells.
    tile_pass : TilePass

    Returns
    -------
    means : (n,) float64 array
        NaN for a region without scored cells.
    """
    sums, counts = np.zeros((2, len(outlined.sums.counts) + 1), np.int64)
    tables = edge_tables(outlined.rings, tile_pass.windows)
    jobs = LazySequence(len(tables), partial(_score_job, tables, best))
    for names, total, count in tile_pass.silent.run(_sum_scores, jobs):
        sums[names] += total
        counts[names] += count
    means = np.full(len(sums) - 1, np.nan)
    np.divide(sums[1:], counts[1:], out=means, where=counts[1:] > 0)
    return means


def _score_job(
    tables: Sequence[EdgeTable], best: NDArray[np.uint16], k: int
) -> tuple[EdgeTable, NDArray[np.uint16]]:
    """The edge table of a tile, and the scores of its cells."""
    table = tables[k]
    return table, best[window_cells(table.window)]


def _sum_scores(
    job: tuple[EdgeTable, NDArray[np.uint16]],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Labels in a tile, and the sum of scores and the number of scored pixels of each."""
    edges, best = job
    labels = edges.rasterise()
    rows, cols = labels.shape
    scores = best.repeat(CELL, 0)[:rows].repeat(CELL, 1)[:, :cols].astype(np.int64)
    labels[scores >= MAX_SCORE] = 0
    counts = np.bincount(labels.ravel())
    names = np.flatnonzero(counts[1:]) + 1
    sums = np.bincount(labels.ravel(), scores.ravel()).astype(np.int64)
    return names, sums[names], counts[names]


def _score_tile(
    source: GreySource, criterion: Criterion, window: Window
) -> tuple[NDArray[np.uint16], TextureModel, NDArray[np.int64], NDArray[np.int64]] | None:
    """Scores of a tile's cells, the texture model of unlike cells, the count of each symbol in the tile, and
    histograms of unlike cells in further bands; None for an empty tile.
    """
    halo, side = CELL * (criterion.side - 1), criterion.side
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, halo + 1)
    names = lbp_symbols(tile.grey, tile.mask, criterion.bin_edges)
    grey = np.ascontiguousarray(tile.grey[1:-1, 1:-1])
    scores = window_scores(names, grey, criterion.model, side, criterion.bounds)
    best = best_scores(limit_scores(criterion.colors, scores, window, side), side)
    unlike = ((best > criterion.limit) & (best != NO_SCORE)).view(np.uint8)
    coarse = coarse_symbols(*_crop(tile, halo + 1 - coarse_lbp.COARSE_HALO), criterion.bin_edges)
    whole = texture_model(names, grey, np.ones_like(unlike), halo, coarse)
    counts = np.stack([whole.texture, whole.coarse])
    colors = count_colors(criterion.colors, window, unlike.view(np.bool_))
    return best, texture_model(names, grey, unlike, halo, coarse), counts, colors


def _crop(tile: GreyTile, margin: int) -> tuple[NDArray[np.uint16], NDArray[np.uint8] | None]:
    """Grey and validity of a tile, cropped by `margin` pixels on every side."""
    inner = np.s_[margin : tile.grey.shape[0] - margin, margin : tile.grey.shape[1] - margin]
    return tile.grey[inner], None if tile.all_valid else tile.valid[inner]
