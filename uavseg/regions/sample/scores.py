"""Which cells of a raster are like a sample, tile by tile, and the outlines of what they make together."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import TilePass, Window, window_cells
from uavseg.regions.outline.rasterise import Sketch, Sketches
from uavseg.regions.outline.stitch import Outlined, Tile, joined, outlined_tile
from uavseg.regions.sample.model import Sample
from uavseg.regions.tiles.kind_tiles import CellJobs
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.lbp import SYMBOLS, lbp_symbols
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.components import label_components
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
from uavseg.segmentation.sample.pixel_decision import DECISION_HALO, PixelWeights, classify_pixels
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import CELL


@dataclass(frozen=True)
class Criterion:
    """What makes a window like a sample.

    Parameters
    ----------
    model : Model
        The histograms of the sample.
    cuts : (7,) int32 array
        Of the contrast.
    side : int
        Of a window, in cells.
    bounds : Bounds
        Of its mean grey.
    limit : int
        The largest score that is like the sample.
    """

    model: TextureModel
    cuts: NDArray[np.int32]
    side: int
    bounds: GreyBounds
    limit: int

    @classmethod
    def of(
        cls, sample: Sample, cuts: NDArray[np.int32], side: int, similarity: float, deviations: float
    ) -> "Criterion":
        """What is like a sample to the degree of a similarity, and within some deviations of its mean."""
        return cls(sample.model, cuts, side, sample.bounds(deviations), sample.limit(similarity))


@dataclass(frozen=True)
class Scored:
    """The scores of a raster, two bytes a cell, and what those cells look like that are unlike the sample.

    Parameters
    ----------
    best : (8 B, 8 C) uint16 array
        See `g_scores.best_scores`.
    rest : Model
        Of the cells with a score that is too large; not of all that `confirming.confirmed` refuses.
    whole : (2, 2048) int64 array
        How often each symbol occurs in the raster, at both scales, see `evidence`.
    """

    best: NDArray[np.uint16]
    rest: TextureModel
    whole: NDArray[np.int64]


def scored(
    source: GreySource,
    criterion: Criterion,
    tile_pass: TilePass,
) -> Scored:
    """The best score of every cell.

    Parameters
    ----------
    source : GreySource
    criterion : Criterion
    tile_pass : TilePass
    """
    best = np.full(BlockMap.empty(source.shape).counts.shape, NO_SCORE, np.uint16)
    rest, whole = TextureModel(), np.zeros((2, SYMBOLS), np.int64)
    for window, found in zip(
        tile_pass.windows, tile_pass.run(partial(_score_tile, source, criterion)), strict=True
    ):
        if found is not None:
            best[window_cells(window)], unlike, counts = found
            rest += unlike
            whole += counts
    return Scored(best, rest, whole)


def outline_matches(
    source: GreySource,
    cells: NDArray[np.uint8],
    cuts: NDArray[np.int32],
    weights: PixelWeights,
    tile_pass: TilePass,
) -> Outlined:
    """Regions of cells that are in, and of those pixels of open cells that weigh enough.

    Parameters
    ----------
    source : GreySource
    cells : (8 B, 8 C) uint8 array
        0 out, 1 in, 2 open.
    cuts : (7,) int32 array
    weights : Weights
    tile_pass
        As of `tilewise.outline_regions`.
    """
    outline = partial(_outline_match, source, cuts, weights)
    tiles = tile_pass.run(outline, CellJobs(cells, tile_pass.windows, DECISION_HALO))
    return joined(source.shape, tile_pass.windows, tiles).outlined()


def mean_scores(outlined: Outlined, best: NDArray[np.uint16], tile_pass: TilePass) -> NDArray[np.float64]:
    """The mean score of the pixels of each region.

    Parameters
    ----------
    outlined : Outlined
    best : (8 B, 8 C) uint16 array
        Scores of cells.
    windows, map

    Returns
    -------
    means : (n,) float64 array
        NaN where no cell of a region has a score.
    """
    sums, counts = np.zeros((2, len(outlined.sums.counts) + 1), np.int64)
    jobs = _Scores(Sketches(outlined.rings, tile_pass.windows), best)
    for names, total, count in tile_pass.silent.run(_sum_scores, jobs):
        sums[names] += total
        counts[names] += count
    means = np.full(len(sums) - 1, np.nan)
    np.divide(sums[1:], counts[1:], out=means, where=counts[1:] > 0)
    return means


class _Scores(Sequence[Any]):
    """Labels of tiles as they are drawn, with the scores of their cells."""

    def __init__(self, sketches: Sketches, best: NDArray[np.uint16]) -> None:
        self._sketches = sketches
        self._best = best

    def __len__(self) -> int:
        return len(self._sketches)

    def __getitem__(self, k: Any) -> Any:
        sketch = self._sketches[k]
        return sketch, self._best[window_cells(sketch.window)]


def _sum_scores(
    job: tuple[Sketch, NDArray[np.uint16]],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Labels in a tile, the sum of the scores of each, and of how many pixels."""
    sketch, best = job
    labels = sketch.paint()
    rows, cols = labels.shape
    scores = best.repeat(CELL, 0)[:rows].repeat(CELL, 1)[:, :cols].astype(np.int64)
    labels[scores >= MAX_SCORE] = 0
    counts = np.bincount(labels.ravel())
    names = np.flatnonzero(counts[1:]) + 1
    sums = np.bincount(labels.ravel(), scores.ravel()).astype(np.int64)
    return names, sums[names], counts[names]


def _score_tile(
    source: GreySource, criterion: Criterion, window: Window
) -> tuple[NDArray[np.uint16], TextureModel, NDArray[np.int64]] | None:
    """Scores of a tile's cells, the histograms of those that are unlike the sample, and how often each symbol
    occurs in the tile.
    """
    halo, side = CELL * (criterion.side - 1), criterion.side
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, halo + 1)
    names = lbp_symbols(tile.grey, tile.mask, criterion.cuts)
    grey = np.ascontiguousarray(tile.grey[1:-1, 1:-1])
    best = best_scores(window_scores(names, grey, criterion.model, side, criterion.bounds), side)
    unlike = ((best > criterion.limit) & (best != NO_SCORE)).view(np.uint8)
    coarse = coarse_symbols(*_cut(tile, halo + 1 - coarse_lbp.COARSE_HALO), criterion.cuts)
    whole = texture_model(names, grey, np.ones_like(unlike), halo, coarse)
    return best, texture_model(names, grey, unlike, halo, coarse), np.stack([whole.texture, whole.coarse])


def _cut(tile: GreyTile, margin: int) -> tuple[NDArray[np.uint16], NDArray[np.uint8] | None]:
    """Grey and validity of a tile with so much less of its margin."""
    inner = np.s_[margin : tile.grey.shape[0] - margin, margin : tile.grey.shape[1] - margin]
    return tile.grey[inner], None if tile.all_valid else tile.valid[inner]


def _outline_match(
    source: GreySource,
    cuts: NDArray[np.int32],
    weights: PixelWeights,
    job: tuple[Window, NDArray[np.uint8]],
) -> Tile | None:
    window, cells = job
    if not cells.any():
        return None
    tile = source.read(window, DECISION_HALO)
    if (cells == 2).any():
        known = tile.mask
        names = lbp_symbols(tile.grey, known, cuts), coarse_symbols(tile.grey, known, cuts)
        pixels = classify_pixels(cells, tile.valid, tile.grey, *names, weights)
    else:
        pixels = cells_to_pixels(cells, tile.valid)
    return outlined_tile(pixels, *label_components(pixels, DECISION_HALO), tile.grey, window, source.shape[1])
