"""Which of the cells that may be like a sample are so, where the raster as a whole is held against it."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import TilePass, Window, window_cells
from uavseg.regions.sample.model import names_of
from uavseg.regions.sample.scores import Criterion, Scored
from uavseg.regions.tiles.kind_tiles import CellJobs
from uavseg.segmentation.dilation import dilate
from uavseg.segmentation.sample.coarse_lbp import COARSE_HALO
from uavseg.segmentation.sample.g_scores import MAX_SCORE, TextureModel, texture_model
from uavseg.segmentation.sample.likelihood_weights import best_mean_weights
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL


def confirmed(
    source: GreySource,
    criterion: Criterion,
    scores: Scored,
    weights: NDArray[np.int64],
    least: int,
    tile_pass: TilePass,
) -> Scored:
    """Scores without those of cells that look more like the raster as a whole than the sample does.

    Parameters
    ----------
    source, criterion, tile_pass
        As of `scores.scored`.
    scores : Scored
    weights : (2, 2048) int64 array
    least : int
        The smallest mean weight of a window that is like the sample, see `evidence.Evidence`.

    Returns
    -------
    scores : Scored
        Refused cells have the largest score. The rest has their histograms too, but for those that touch a
        cell that is kept.
    """
    matched = scores.best <= criterion.limit
    concerned = [window for window in tile_pass.windows if matched[window_cells(window)].any()]
    jobs = CellJobs(matched.view(np.uint8), concerned, CELL)
    best, rest = scores.best.copy(), scores.rest
    confirm = partial(_confirm_tile, source, criterion, weights, least)
    for window, (refused, unlike) in zip(concerned, tile_pass.run(confirm, jobs), strict=True):
        best[window_cells(window)][refused] = MAX_SCORE
        rest += unlike
    return Scored(best, rest, scores.whole)


def _confirm_tile(
    source: GreySource,
    criterion: Criterion,
    weights: NDArray[np.int64],
    least: int,
    job: tuple[Window, NDArray[np.uint8]],
) -> tuple[NDArray[np.bool_], TextureModel]:
    """Which of a tile's matched cells are refused, and the histograms of those that touch none that is kept:
    the others lie on boundaries and are of both sides.
    """
    window, around = job  # with one cell on every side
    halo = CELL * criterion.side
    tile = source.read(window, halo + COARSE_HALO)
    names = names_of(tile, criterion.cuts)
    convincing = best_mean_weights(names, weights, criterion.side) >= least
    matched, inner = around.view(np.bool_), np.s_[1:-1, 1:-1]
    refused = (matched & ~convincing)[inner]
    unlike = refused & ~dilate(matched & convincing, 1)[inner]
    grey = np.ascontiguousarray(tile.grey[COARSE_HALO:-COARSE_HALO, COARSE_HALO:-COARSE_HALO])
    own = np.ascontiguousarray(names[1][halo:-halo, halo:-halo])
    return refused, texture_model(names[0], grey, unlike.view(np.uint8), halo, own)
