"""Outlines of the cells that match a sample, classified pixel by pixel at their boundaries."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, whole_blocks
from uavseg.regions.outline.rasterise import EdgeTable, edge_tables
from uavseg.regions.outline.rings import RegionOutlines, Rings
from uavseg.regions.outline.stitch import TileOutlines, TileStitcher, outline_tile
from uavseg.regions.sample.colors import color_planes
from uavseg.regions.sample.scores import Criterion
from uavseg.regions.tiles.range_tiles import with_detail
from uavseg.regions.tiles.segment_tiles import cell_jobs
from uavseg.segmentation.blocks.lbp import coarse_symbols, lbp_symbols
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.components import label_components
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.sample.pixel_decision import (
    DECISION_HALO,
    PixelWeights,
    classify_colored_pixels,
    classify_pixels,
)
from uavseg.segmentation.source import GreySource

# A tile, its cells with those around it, and the edges of the regions that matches are clipped to, if any.
_MatchJob = tuple[Window, NDArray[np.uint8], EdgeTable | None]


def outline_matches(
    source: GreySource,
    cells: NDArray[np.uint8],
    criterion: Criterion,
    weights: PixelWeights,
    rest_colors: NDArray[np.int64],
    tile_pass: TilePass,
    within: Rings | None = None,
    detail: Detail | None = None,
) -> RegionOutlines:
    """Outline regions of inner cells, and of those pixels of undecided cells that are classified as sample.

    `cells`, (8 B, 8 C), are 0 outside, 1 inside, 2 undecided; for `rest_colors` see `CellScores`. Matches are
    clipped to the outlines `within`, if given, and structures narrower than `detail` are removed.
    """
    outline = partial(_outline_match, source, criterion, weights, rest_colors, detail)
    windows, halo = tile_pass.windows, DECISION_HALO + (detail.halo if detail else 0)
    blocks = [Window(w.row, w.col, whole_blocks(w.rows), whole_blocks(w.cols)).grown(halo) for w in windows]
    tables = None if within is None else edge_tables(within, blocks)
    jobs = partial(_match_job, cell_jobs(cells, windows, halo), tables)
    tiles = tile_pass.run(outline, LazySequence(len(windows), jobs))
    return TileStitcher(source.shape, windows, tiles).finish()


def _match_job(
    jobs: Sequence[tuple[Window, NDArray[np.uint8]]], tables: Sequence[EdgeTable] | None, k: int
) -> _MatchJob:
    return *jobs[k], None if tables is None else tables[k]


def _outline_match(
    source: GreySource,
    criterion: Criterion,
    weights: PixelWeights,
    rest_colors: NDArray[np.int64],
    detail: Detail | None,
    job: _MatchJob,
) -> TileOutlines | None:
    window, cells, within = job
    if not cells.any():
        return None
    decided = window if detail is None else window.grown(detail.halo)
    tile = source.read(decided, DECISION_HALO, excess=True)
    if (cells == 2).any():
        known, edges = tile.mask, criterion.bin_edges
        names = lbp_symbols(tile.grey, known, edges), coarse_symbols(tile.grey, known, edges)
        if criterion.colors:
            planes = color_planes(criterion.colors, rest_colors, decided, DECISION_HALO)
            pixels = classify_colored_pixels(cells, tile.valid, tile.grey, names, weights, planes)
        else:
            pixels = classify_pixels(cells, tile.valid, tile.grey, *names, weights)
    else:
        pixels = cells_to_pixels(cells, tile.valid)
    if within is not None:
        pixels &= within.rasterise() > 0
    if detail is not None:
        pixels, tile = with_detail(pixels, tile, detail)
    return outline_tile(pixels, *label_components(pixels, DECISION_HALO), tile, window, source.shape[1])
