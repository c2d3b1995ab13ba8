"""Second stage: reject cells that the background model (the whole raster) explains better than the sample."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import TilePass, Window, window_cells
from uavseg.regions.sample.colors import count_colors
from uavseg.regions.sample.model import symbol_pair
from uavseg.regions.sample.scores import CellScores, Criterion
from uavseg.regions.tiles.kind_tiles import cell_jobs
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.sample.coarse_lbp import COARSE_HALO
from uavseg.segmentation.sample.g_scores import MAX_SCORE, TextureModel, texture_model
from uavseg.segmentation.sample.likelihood_weights import best_mean_weights
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL


def reject_unlike(
    source: GreySource,
    criterion: Criterion,
    scores: CellScores,
    weights: NDArray[np.int64],
    least: int,
    tile_pass: TilePass,
) -> CellScores:
    """Reject cells whose texture the background model explains better than the sample.

    Parameters
    ----------
    source, criterion, tile_pass
        As of `score_cells`.
    scores : CellScores
    weights : (2, 2048) int64 array
        Of symbols at both scales, see `SampleWeights`.
    least : int
        The smallest mean weight of a window that is like the sample.

    Returns
    -------
    CellScores
        Rejected cells have the largest score, and their histograms are added to `rest`, except for cells that
        touch one that is kept.
    """
    matched = scores.best <= criterion.limit
    with_matches = [window for window in tile_pass.windows if matched[window_cells(window)].any()]
    jobs = cell_jobs(matched.view(np.uint8), with_matches, CELL)
    best, rest, rest_colors = scores.best.copy(), scores.rest, scores.rest_colors.copy()
    reject = partial(_reject_tile, source, criterion, weights, least)
    for window, (rejected, unlike, colors) in zip(with_matches, tile_pass.run(reject, jobs), strict=True):
        best[window_cells(window)][rejected] = MAX_SCORE
        rest += unlike
        rest_colors += colors
    return CellScores(best, rest, scores.whole, rest_colors)


def _reject_tile(
    source: GreySource,
    criterion: Criterion,
    weights: NDArray[np.int64],
    least: int,
    job: tuple[Window, NDArray[np.uint8]],
) -> tuple[NDArray[np.bool_], TextureModel, NDArray[np.int64]]:
    """Mask of the rejected cells of a tile, and the histograms of those that touch no cell that is kept, also
    in further bands: the others lie on boundaries and have texture of both sides.
    """
    window, around = job  # cells of the tile, and one more on every side
    halo = CELL * criterion.side
    tile = source.read(window, halo + COARSE_HALO)
    names = symbol_pair(tile, criterion.bin_edges)
    explained = best_mean_weights(names, weights, criterion.side) >= least
    matched, inner = around.view(np.bool_), np.s_[1:-1, 1:-1]
    rejected = (matched & ~explained)[inner]
    unlike = rejected & ~dilate(matched & explained, 1)[inner]
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    own = np.ascontiguousarray(names[1][halo:-halo, halo:-halo])
    model = texture_model(names[0], grey, unlike.view(np.uint8), halo, own)
    return rejected, model, count_colors(criterion.colors, window, unlike)
