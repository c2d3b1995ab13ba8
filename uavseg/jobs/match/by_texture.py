"""Regions like a sample by texture and intensity.

measured -> sample: its histograms, and how unlike each other its own windows are
         -> scored: G of a moving window     (one pass over all tiles)
         -> confirmed: windows that the background model explains better are rejected
                                             (one pass over the tiles with matches)
         -> matched: cells with a window that is like the sample; those near a boundary are open
         -> outlined: open cells decided pixel by pixel (one pass over the tiles with matches)
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from uavseg.arrays import Bools, Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.execution.executors import LazySequence, phase, trim_heap
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.result.result import Extraction, SourceInfo, filled, measured
from uavseg.jobs.source.source import detail_of
from uavseg.raster.grid.tiling import TilePass, Window, whole_blocks
from uavseg.regions.confidence import OF_TEXTURES, Parting, texture_terms
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.regions.outline.rings import EdgeTable, RegionOutlines, Rings, edge_tables
from uavseg.regions.outline.stitch import TileOutlines, TileStitcher, outline_tile
from uavseg.regions.sample.place import SampleMask
from uavseg.regions.sample.scores import (
    USUAL_WINDOWS,
    CellScores,
    Criterion,
    Sample,
    color_planes,
    fit_colors,
    fit_sample,
    fit_weights,
    fitting_window,
    mean_scores,
    reject_unlike,
    score_cells,
)
from uavseg.regions.tiles.class_tiles import cell_jobs, outline_segments
from uavseg.regions.tiles.range_tiles import with_detail
from uavseg.segmentation.blocks.lbp import coarse_symbols, lbp_symbols
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.components import label_components
from uavseg.segmentation.pipeline import measure_cells
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.sample import pixel_decision
from uavseg.segmentation.sample.g_scores import NULL_SCORE, SCORE_UNITS, separability
from uavseg.segmentation.sample.pixel_decision import DECISION_HALO, PixelWeights
from uavseg.segmentation.source import GreySource, with_statistics
from uavseg.units import CELL, GREY_MAX

Passes = Sequence[TilePass]

_PIECE = Area(CELL * CELL, in_pixels=True)
# A tile, its cells with those around it, and the edges of the regions that matches are clipped to, if any.
_MatchJob = tuple[Window, Uint8s, EdgeTable | None]


@dataclass(frozen=True)
class TextureSample:
    """A sample's texture, and how unlike it a window may be.

    `limit` is the largest G per pixel, beyond chance, of a window that is like the sample; `window` is the
    side of a window in pixels.
    """

    sample: Sample
    limit: float
    window: int

    @property
    def own(self) -> float:
        """G per pixel beyond chance that nineteen of twenty of the sample's own windows do not exceed."""
        return (self.sample.own - NULL_SCORE) / SCORE_UNITS


@dataclass(frozen=True, eq=False)
class TextureSearch:
    """A raster whose cells are scored by how unlike a sample's texture they are.

    `side` is that of a window, in cells; `valid`, (8 B, 8 C), are cells with valid pixels.
    """

    grey: GreySource
    place: SampleMask
    request: MatchRequest
    side: int
    sample: Sample
    criterion: Criterion
    scores: CellScores
    valid: Bools

    @property
    def how(self) -> TextureSample:
        """What was compared."""
        return TextureSample(self.sample, (self.criterion.limit - NULL_SCORE) / SCORE_UNITS, self.side * CELL)


def search_texture(
    grey: GreySource, bands: Sequence[GreySource], place: SampleMask, request: MatchRequest, passes: Passes
) -> TextureSearch:
    """Score all cells of a raster against a sample, in two passes; the intensity of `bands` counts too."""
    grey = with_statistics(grey, passes[0])
    side = (request.window or fitting_window(place) or USUAL_WINDOWS[-1]) // CELL
    with phase("cells and the sample"):
        known = measure_cells(grey, passes[0])
        sample = fit_sample(grey, known.bin_edges, place, side, passes[0].map)
        colors = fit_colors(bands, place, request.intensity)
    bounds, limit = sample.bounds(request.intensity), sample.limit(request.similarity)
    criterion = Criterion(sample.model, known.bin_edges, side, bounds, limit, colors)
    with phase("scores"):
        scores = score_cells(grey, criterion, passes[1])
    return TextureSearch(grey, place, request, side, sample, criterion, scores, known.blocks.counts > 0)


def regions_by_texture(search: TextureSearch, passes: Passes, within: Rings | None = None) -> Extraction:
    """Return regions whose texture and intensity are like a sample's; arguments of `outlines_by_texture`."""
    outlined, scores = outlines_by_texture(search, passes, within)
    return _measured(search, outlined, scores, passes[1])


def outlines_by_texture(
    search: TextureSearch, passes: Passes, within: Rings | None = None
) -> tuple[RegionOutlines, CellScores]:
    """Outline regions whose texture and intensity are like a sample's, and score their cells, in two passes.

    Beyond the outlines `within` nothing is of interest. What remains of them in pieces of less than a cell is
    left out.
    """
    grey, request, edges = search.grey, search.request, search.criterion.bin_edges
    with phase("comparison with the background"):
        whole = search.scores.whole
        evidence = fit_weights(grey, edges, search.place, whole, search.side, passes[0].map)
        least = evidence.threshold(request.similarity)
        scores = reject_unlike(grey, search.criterion, search.scores, evidence.weights, least, passes[0])
    trim_heap()
    with phase("outlines"):
        outlined = _outlined(search, scores, within, passes[1])
        if within is not None:
            outlined = drop_small_regions(outlined, grey.dataset.geobox, _PIECE)
    trim_heap()
    return outlined, scores


def _outlined(
    search: TextureSearch, scores: CellScores, within: Rings | None, tiles: TilePass
) -> RegionOutlines:
    criterion, request = search.criterion, search.request
    matched = scores.best <= criterion.limit
    if request.refine == "none" and within is None:
        return outline_segments(search.grey, matched.view(np.uint8), tiles)
    if request.refine == "none":
        cells = matched.view(np.uint8)
    else:
        cells = pixel_decision.undecided_cells(matched, search.valid & ~matched, search.side // 2)
    weights = PixelWeights.between(criterion.model, scores.rest, np.isfinite(request.intensity))
    detail = detail_of(request.detail, search.grey.dataset.geobox, request.refine)
    return outline_matches(search.grey, cells, criterion, weights, scores.rest_colors, tiles, within, detail)


def _measured(
    search: TextureSearch, outlined: RegionOutlines, scores: CellScores, tiles: TilePass
) -> Extraction:
    """Return regions with their attributes; holes are filled before small ones are dropped."""
    grey, request, sample = search.grey, search.request, search.sample
    outlined = filled(grey, outlined, request.fill_holes, tiles)
    outlined = drop_small_regions(outlined, grey.dataset.geobox, request.min_area)
    bounds = sample.bounds(request.intensity)
    interval = bounds.low / GREY_MAX, bounds.high / GREY_MAX
    sure = partial(OF_TEXTURES.of, lambda: texture_terms(outlined, parting_of(search), grey.statistics))
    more = {"similarity": sample.similarity(mean_scores(outlined, scores.best, tiles))}
    return measured(outlined, SourceInfo.of(grey), interval, request, more, sure, request.refine)


def parting_of(search: TextureSearch) -> Parting:
    """Return how clearly texture parts the sample from the rest of the raster."""
    pixels = int(search.valid.sum()) * CELL * CELL
    return Parting(search.side * CELL, separability(search.scores.best.ravel()), pixels)


def outline_matches(
    source: GreySource,
    cells: Uint8s,
    criterion: Criterion,
    weights: PixelWeights,
    rest_colors: Integers,
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


def _match_job(jobs: Sequence[Any], tables: Sequence[EdgeTable] | None, k: int) -> _MatchJob:
    return *jobs[k], None if tables is None else tables[k]


def _outline_match(
    source: GreySource,
    criterion: Criterion,
    weights: PixelWeights,
    rest_colors: Integers,
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
        planes = color_planes(criterion.colors, rest_colors, decided, DECISION_HALO)
        pixels = pixel_decision.classify_pixels(cells, tile.valid, tile.grey, names, weights, planes)
    else:
        pixels = cells_to_pixels(cells, tile.valid)
    if within is not None:
        pixels &= within.rasterise() > 0
    if detail is not None:
        pixels, tile = with_detail(pixels, tile, detail)
    return outline_tile(pixels, *label_components(pixels, DECISION_HALO), tile, window, source.shape[1])
