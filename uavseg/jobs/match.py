"""Search for the regions of a raster whose texture and intensity are like those of a sample.

stretch -> measured: bin edges of contrast  (one pass over all tiles)
        -> sample: its histograms, and how unlike each other its own windows are
        -> scored: G of a moving window     (one pass over all tiles)
        -> confirmed: windows that the background model explains better are rejected
                                            (one pass over the tiles with matches)
        -> matched: cells with a window that is like the sample; those near a boundary are open
        -> outlined: open cells decided pixel by pixel (one pass over the tiles with matches)
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.execution.executors import trim_heap
from uavseg.execution.phases import phase
from uavseg.jobs.fill_holes import filled
from uavseg.jobs.metadata import drawing_facts, with_metadata
from uavseg.jobs.open_source import raster_of
from uavseg.jobs.result import Drawing, Extraction, SourceInfo, measured
from uavseg.jobs.source import AUTO, Raster, Source
from uavseg.jobs.work import SERIAL, Work
from uavseg.raster.intensity.stretch import fit_stretch
from uavseg.raster.tiling import TilePass
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.sample.colors import fit_colors
from uavseg.regions.sample.model import Sample, fit_sample, fit_weights
from uavseg.regions.sample.place import Disc, sample_mask
from uavseg.regions.sample.reject import reject_unlike
from uavseg.regions.sample.scores import CellScores, Criterion, mean_scores, outline_matches, score_cells
from uavseg.regions.tiles.kind_tiles import outline_segments
from uavseg.segmentation.pipeline import measure_cells
from uavseg.segmentation.sample.g_scores import NULL_SCORE, SCORE_UNITS
from uavseg.segmentation.sample.pixel_decision import PixelWeights, undecided_cells
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL, GREY_MAX

WINDOWS = (16, 24, 32, 48, 64, 96, 128)


@dataclass(frozen=True, slots=True)
class MatchRequest:
    """Which sample, and what is like it.

    Parameters
    ----------
    like : Disc or str
        The sample: a disc on the map, or a file of polygons.
    window : int
        Side in pixels of the window whose texture is compared.
    similarity : float
        How like the sample a window must be, above 0 and at most 1, see `Sample.similarity`, and by how much
        the background may explain it better, see `Evidence.least`. A smaller one finds more.
    intensity : float
        By how many of the sample's standard deviations the mean of a window may differ from the sample's;
        infinite for texture alone.
    refine : {"pixel", "none"}
        Whether pixels near boundaries are decided one by one, or regions end at cells of 8 pixels.
    drawing : Drawing
    fill_holes, min_area : Area, optional
        As of `ExtractRequest`.
    bands : tuple of int or str
        Bands whose intensity is compared as well, each by itself, by number or name.

    Raises
    ------
    ParameterError
        If one of them is not allowed.
    """

    like: Disc | str
    window: int = 32
    similarity: float = 0.9
    intensity: float = 1.0
    refine: str = "pixel"
    drawing: Drawing = Drawing()
    fill_holes: Area | None = None
    min_area: Area | None = None
    bands: tuple[int | str, ...] = ()

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
        if self.bands and math.isinf(self.intensity):
            raise ParameterError("an infinite intensity compares texture alone; leave the bands out, or it")
        if self.refine not in ("pixel", "none"):
            raise ParameterError(f"a refinement of matches is pixel or none, not {self.refine!r}")

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

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know."""
        return self.found.warnings


def match(source: Source, request: MatchRequest, work: Work = SERIAL) -> Match:
    """Regions of a raster whose texture and intensity are like those of a sample.

    Parameters
    ----------
    source : Raster
    request : MatchRequest
    work : Work

    Raises
    ------
    SampleError
        If the sample is not on the raster, too small, or on nodata.
    UavsegError
        If the raster cannot be read or a parameter does not fit it.
    """
    work = work.begun()
    raster = raster_of(source, "a block map holds no texture to be compared; name the raster itself")
    place = sample_mask(request.like, raster.geobox)
    passes = work.over(raster).stages(5)
    run = passes[0].map
    grey = raster.grey(passes[0])
    with phase("cells and the sample"):
        known = measure_cells(grey, passes[1])
        sample = fit_sample(grey, known.bin_edges, place, request.side, run)
        colors = fit_colors(_color_sources(raster, request.bands, passes[0].silent), place, request.intensity)
    criterion = Criterion.of(
        sample, known.bin_edges, request.side, request.similarity, request.intensity, colors
    )
    with phase("scores"):
        scores = score_cells(grey, criterion, passes[2])
    with phase("comparison with the background"):
        evidence = fit_weights(grey, known.bin_edges, place, scores.whole, request.side, run)
        least = evidence.threshold(request.similarity)
        scores = reject_unlike(grey, criterion, scores, evidence.weights, least, passes[3])
    valid = known.blocks.counts > 0
    del known
    trim_heap()
    with phase("outlines"):
        outlined = _outlined(grey, scores, valid, criterion, request, passes[4])
    trim_heap()
    found = _measured(grey, outlined, scores, sample, request, passes[4])
    found = with_metadata(found, raster, "match", _facts(request))
    hint = "nothing is like the sample; a smaller similarity or a larger intensity finds more"
    hints = () if len(found.regions) else (hint,)
    return Match(work.finished(found, *hints), sample, (criterion.limit - NULL_SCORE) / SCORE_UNITS)


def _facts(request: MatchRequest) -> dict[str, Any]:
    """The parameters, for the metadata of the regions."""
    like = request.like
    disc = [like.x, like.y, like.radius] if isinstance(like, Disc) else None
    facts = {
        "like": like if isinstance(like, str) else disc,
        "window": request.window,
        "similarity": request.similarity,
        "intensity": request.intensity if np.isfinite(request.intensity) else "any",
        "refine": request.refine,
        "bands": request.bands or None,
    }
    return facts | drawing_facts(request.drawing, request.fill_holes, request.min_area)


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
    return outline_matches(grey, cells, criterion, weights, scores.rest_colors, tile_pass)


def _color_sources(raster: Raster, bands: Sequence[int | str], tile_pass: TilePass) -> list[GreySource]:
    """Each band as grey, by the stretch of the raster, fitted to it."""
    dataset = raster.cleaned(tile_pass)
    datasets = [dataset.of_band(band, raster.options.nodata) for band in bands]
    return [GreySource(one, fit_stretch(one, raster.options.spec or AUTO, tile_pass)) for one in datasets]


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
