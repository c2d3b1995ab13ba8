"""Regions like a sample by texture and intensity.

measured -> sample: its histograms, and how unlike each other its own windows are
         -> scored: G of a moving window     (one pass over all tiles)
         -> confirmed: windows that the background model explains better are rejected
                                             (one pass over the tiles with matches)
         -> matched: cells with a window that is like the sample; those near a boundary are open
         -> outlined: open cells decided pixel by pixel (one pass over the tiles with matches)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import trim_heap
from uavseg.execution.phases import phase
from uavseg.jobs.detail import detail_of
from uavseg.jobs.fill_holes import filled
from uavseg.jobs.like.request import MatchRequest
from uavseg.jobs.result import Extraction, SourceInfo, measured
from uavseg.raster.tiling import TilePass
from uavseg.regions.edit.small import drop_small_regions
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.sample.colors import fit_colors
from uavseg.regions.sample.model import Sample, fit_sample, fit_weights
from uavseg.regions.sample.place import SampleMask
from uavseg.regions.sample.reject import reject_unlike
from uavseg.regions.sample.scores import CellScores, Criterion, mean_scores, outline_matches, score_cells
from uavseg.regions.tiles.kind_tiles import outline_segments
from uavseg.segmentation.pipeline import measure_cells
from uavseg.segmentation.sample.g_scores import NULL_SCORE, SCORE_UNITS
from uavseg.segmentation.sample.pixel_decision import PixelWeights, undecided_cells
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX


@dataclass(frozen=True)
class TextureSample:
    """A sample's texture, and how unlike it a window may be.

    Parameters
    ----------
    sample : Sample
    limit : float
        The largest G per pixel, beyond chance, of a window that is like the sample.
    """

    sample: Sample
    limit: float

    @property
    def own(self) -> float:
        """G per pixel beyond chance that nineteen of twenty of the sample's own windows do not exceed."""
        return (self.sample.own - NULL_SCORE) / SCORE_UNITS


def regions_by_texture(
    grey: GreySource,
    bands: Sequence[GreySource],
    place: SampleMask,
    request: MatchRequest,
    passes: Sequence[TilePass],
) -> tuple[Extraction, TextureSample]:
    """Regions whose texture and intensity are like those of a sample.

    Parameters
    ----------
    grey : GreySource
    bands : sequence of GreySource
        Further bands whose intensity is compared.
    place : SampleMask
    request : MatchRequest
    passes : four of TilePass
    """
    run = passes[0].map
    with phase("cells and the sample"):
        known = measure_cells(grey, passes[0])
        sample = fit_sample(grey, known.bin_edges, place, request.side, run)
        colors = fit_colors(bands, place, request.intensity)
    criterion = Criterion.of(
        sample, known.bin_edges, request.side, request.similarity, request.intensity, colors
    )
    with phase("scores"):
        scores = score_cells(grey, criterion, passes[1])
    with phase("comparison with the background"):
        evidence = fit_weights(grey, known.bin_edges, place, scores.whole, request.side, run)
        least = evidence.threshold(request.similarity)
        scores = reject_unlike(grey, criterion, scores, evidence.weights, least, passes[2])
    valid = known.blocks.counts > 0
    del known
    trim_heap()
    with phase("outlines"):
        outlined = _outlined(grey, scores, valid, criterion, request, passes[3])
    trim_heap()
    found = _measured(grey, outlined, scores, sample, request, passes[3])
    return found, TextureSample(sample, (criterion.limit - NULL_SCORE) / SCORE_UNITS)


def _outlined(
    grey: GreySource,
    scores: CellScores,
    valid: NDArray[np.bool_],
    criterion: Criterion,
    request: MatchRequest,
    tile_pass: TilePass,
) -> RegionOutlines:
    matched = scores.best <= criterion.limit
    if request.refine == "none":
        return outline_segments(grey, matched.view(np.uint8), tile_pass)
    cells = undecided_cells(matched, valid & ~matched, request.side // 2)
    weights = PixelWeights.between(criterion.model, scores.rest, np.isfinite(request.intensity))
    detail = detail_of(request.detail, grey.dataset.geobox, request.refine)
    return outline_matches(grey, cells, criterion, weights, scores.rest_colors, tile_pass, detail)


def _measured(
    grey: GreySource,
    outlined: RegionOutlines,
    scores: CellScores,
    sample: Sample,
    request: MatchRequest,
    tile_pass: TilePass,
) -> Extraction:
    """Regions with their attributes; holes are filled before small ones are dropped."""
    outlined = filled(grey, outlined, request.fill_holes, tile_pass)
    if request.min_area is not None:
        outlined = drop_small_regions(outlined, grey.dataset.geobox, request.min_area)
    more = {"similarity": sample.similarity(mean_scores(outlined, scores.best, tile_pass))}
    bounds = sample.bounds(request.intensity)
    interval = bounds.low / GREY_MAX, bounds.high / GREY_MAX
    return measured(outlined, SourceInfo.of(grey), interval, request.drawing, more)
