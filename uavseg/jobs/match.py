"""Texture as a question: regions of a raster whose texture and intensity are like those of a sample.

stretch -> measured: cuts of contrast       (one pass over all tiles)
        -> looked at: the sample's histograms, and how unlike each other its own windows are
        -> scored: G of a moving window     (one pass over all tiles)
        -> confirmed: windows that the raster as a whole explains better than the sample are refused
                                            (one pass over the tiles with matches)
        -> matched: cells with a window that is like the sample; those near a boundary are open
        -> outlined: open cells decided pixel by pixel (one pass over the tiles with matches)
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavseg._memory import give_back
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, Progress, serial
from uavseg.jobs.result import About, Drawing, Extraction, measured
from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit
from uavseg.raster.tile_pass import TilePass
from uavseg.regions.edit.small import Area, drop_small_regions, fill_small_holes
from uavseg.regions.outline.region_outlines import RegionOutlines
from uavseg.regions.sample.model import Sample, evidence_of, sample_of
from uavseg.regions.sample.place import Disc, place_of
from uavseg.regions.sample.reject import confirmed
from uavseg.regions.sample.scores import Criterion, Scored, mean_scores, outline_matches, scored
from uavseg.regions.tiles.kind_tiles import outline_segments
from uavseg.regions.tiles.range_tiles import sum_regions
from uavseg.segmentation.pipeline import measure_cells
from uavseg.segmentation.sample.g_scores import NULL_SCORE, SCORE_UNITS
from uavseg.segmentation.sample.pixel_decision import PixelWeights, undecided_cells
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL, GREY_MAX

WINDOWS = (16, 24, 32, 48, 64, 96, 128)


@dataclass(frozen=True, slots=True)
class MatchParams:
    """How regions like a sample are found.

    Parameters
    ----------
    window : int
        Side in pixels of the window whose texture is compared.
    similarity : float
        How like the sample a window must be, above 0 and at most 1, see `Sample.similarity`, and by how much
        the raster as a whole may explain it better, see `evidence.Evidence.least`. A smaller one finds more.
    intensity : float
        By how many of the sample's standard deviations the mean of a window may differ from the sample's;
        infinite for texture alone.
    refine : {"pixel", "none"}
        Whether pixels near boundaries are decided one by one, or regions end at cells of 8 pixels.
    stretch, fill_holes, min_area, simplify_m, tile
        As of `ExtractParams`.

    Raises
    ------
    ParameterError
        If one of them is not what it may be.
    """

    window: int = 32
    similarity: float = 0.9
    intensity: float = 1.0
    refine: str = "pixel"
    stretch: Stretch | StretchSpec | str = "auto"
    fill_holes: Area | None = None
    min_area: Area | None = None
    simplify_m: float | None = None
    tile: int | None = None

    def __post_init__(self) -> None:
        if self.window not in WINDOWS:
            known = ", ".join(map(str, WINDOWS))
            raise ParameterError(f"the side of a window is one of {known} pixels, not {self.window}")
        if not 0 < self.similarity <= 1:
            raise ParameterError(f"a similarity is above 0 and at most 1, not {self.similarity:g}")
        if not self.intensity >= 0:
            raise ParameterError(
                f"an intensity is a number of deviations that is not negative, not {self.intensity:g}"
            )
        if self.refine not in ("pixel", "none"):
            raise ParameterError(f"a refinement of matches is pixel or none, not {self.refine!r}")
        if self.simplify_m is not None and not 0 <= self.simplify_m < float("inf"):
            raise ParameterError(
                f"outlines are simplified by metres that are not negative, not {self.simplify_m:g}"
            )

    @property
    def side(self) -> int:
        """Of a window, in cells."""
        return self.window // CELL


@dataclass(frozen=True)
class Match:
    """Regions like a sample, and what "like" meant.

    Parameters
    ----------
    found : Extraction
        Its regions have the column `similarity`, 1 where they are as like the sample as it is itself.
    sample : Sample
    limit : float
        The largest G per pixel, beyond chance, of a window that is like the sample.
    """

    found: Extraction
    sample: Sample
    limit: float

    @property
    def own(self) -> float:
        """G per pixel beyond chance that nineteen of twenty of the sample's own windows do not exceed."""
        return (self.sample.own - NULL_SCORE) / SCORE_UNITS


def match(
    dataset: Dataset,
    like: Disc | str,
    params: MatchParams = MatchParams(),
    map: Map = serial,
    progress: Progress | None = None,
) -> Match:
    """Regions of a raster whose texture and intensity are like those of a sample.

    Parameters
    ----------
    dataset : Dataset
    like : Disc or str
        The sample: a disc on the map, or a file of polygons.
    params : MatchParams
    map : Map
        Who runs the work.
    progress : callable, optional

    Raises
    ------
    SampleError
        If the sample is not on the raster, too small, or on nodata.
    UavsegError
        If the raster cannot be read or a parameter does not fit it.
    """
    place = place_of(like, dataset.geobox)
    passes = TilePass.over(dataset, params.tile, map, progress).stages(5)
    source = GreySource(dataset, fit(dataset, params.stretch, passes[0]))
    known = measure_cells(source, passes[1])
    sample = sample_of(source, known.bin_edges, place, params.side, map)
    criterion = Criterion.of(sample, known.bin_edges, params.side, params.similarity, params.intensity)
    scores = scored(source, criterion, passes[2])
    evidence = evidence_of(source, known.bin_edges, place, scores.whole, params.side, map)
    least = evidence.threshold(params.similarity)
    scores = confirmed(source, criterion, scores, evidence.weights, least, passes[3])
    valid = known.blocks.counts > 0
    del known
    give_back()
    outlined = _outlined(source, scores, valid, criterion, params, passes[4])
    give_back()
    found = _extraction(source, outlined, scores, sample, params, passes[4])
    return Match(found, sample, (criterion.limit - NULL_SCORE) / SCORE_UNITS)


def _outlined(
    source: GreySource,
    scores: Scored,
    valid: NDArray[np.bool_],
    criterion: Criterion,
    params: MatchParams,
    tile_pass: TilePass,
) -> RegionOutlines:
    matched = scores.best <= criterion.limit
    if params.refine == "none":
        return outline_segments(source, matched.view(np.uint8), tile_pass)
    cells = undecided_cells(matched, valid & ~matched, params.side // 2)
    weights = PixelWeights.between(criterion.model, scores.rest, np.isfinite(params.intensity))
    return outline_matches(source, cells, criterion.cuts, weights, tile_pass)


def _extraction(
    source: GreySource,
    outlined: RegionOutlines,
    scores: Scored,
    sample: Sample,
    params: MatchParams,
    tile_pass: TilePass,
) -> Extraction:
    """Regions with their attributes; holes are filled before small ones are dropped."""
    geobox, bounds = source.dataset.geobox, sample.bounds(params.intensity)
    if params.fill_holes is not None:
        filled = fill_small_holes(outlined, geobox, params.fill_holes)
        if filled is not outlined:
            outlined = replace(filled, sums=sum_regions(source, filled, tile_pass))
    if params.min_area is not None:
        outlined = drop_small_regions(outlined, geobox, params.min_area)
    more = {"similarity": sample.similarity(mean_scores(outlined, scores.best, tile_pass))}
    low, high = bounds.low / GREY_MAX, bounds.high / GREY_MAX
    return measured(outlined, About.source(source), low, high, Drawing(simplify_m=params.simplify_m), more)
