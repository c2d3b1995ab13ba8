"""Regions like a sample by colour: likeness takes the place of grey, and regions are extracted from it.

sample and raster -> likeness: which colours are of the sample's kind
                  -> extracted: where it is one half and more, as `jobs.extract` does
                  -> measured: intensity, read again within the regions
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import decided, phase
from uavseg.jobs.match.request import MatchRequest
from uavseg.jobs.result.result import Extraction, SourceInfo, filled, measured
from uavseg.jobs.source.source import detail_of
from uavseg.raster.grid.tiling import TilePass
from uavseg.regions.confidence import OF_MATCHES, Confidence, match_terms
from uavseg.regions.edit.small import drop_small_regions
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.sample.next_place import next_place
from uavseg.regions.sample.place import Disc, SampleMask
from uavseg.regions.sample.similarity import BlurredBands, SimilaritySource, fit_similarity
from uavseg.regions.tiles.class_tiles import LIKELY
from uavseg.regions.tiles.range_tiles import outline_regions, sum_regions
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine, measure_block_map_for
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX


def learn(
    bands: Sequence[GreySource],
    places: Sequence[SampleMask],
    unlike: Sequence[SampleMask],
    tile_pass: TilePass,
) -> SimilaritySource:
    """Return the raster as likeness to samples, and not to others."""
    with phase("colours of the sample"):
        result = fit_similarity(BlurredBands(bands), places, tile_pass, unlike)
    decided(
        "likeness %.3f in the sample, %.3f in the raster", result.table.sample_mean, result.table.raster_mean
    )
    return result


def outlines_by_color(
    similarity: SimilaritySource,
    request: MatchRequest,
    samples: Sequence[SampleMask],
    passes: Sequence[TilePass],
) -> tuple[RegionOutlines, Disc | None]:
    """Return outlines where the likeness is one half and more, and where the next sample would help most.

    Samples are all that were given. There are two passes.
    """
    params = SegmentParams(refine="none") if request.refine == "none" else SegmentParams()
    with phase("division"):
        blocks = measure_block_map_for(similarity, LIKELY, params, passes[0])
        cells = cells_to_refine(blocks, LIKELY, params)
    with phase("next sample"):
        proposed = next_place(similarity, blocks, samples, passes[0])
    del blocks
    detail = detail_of(request.detail, similarity.dataset.geobox, params.refine)
    with phase("refinement and outlines"):
        outlined = outline_regions(similarity, cells, LIKELY, params.refine, passes[1], detail=detail)
    return outlined, proposed


def regions_by_color(
    grey: GreySource,
    similarity: SimilaritySource,
    outlined: RegionOutlines,
    request: MatchRequest,
    tile_pass: TilePass,
) -> Extraction:
    """Return outlines of `outlines_by_color` as regions, with attributes of the intensity `grey`."""
    outlined = filled(similarity, outlined, request.fill_holes, tile_pass)
    outlined = drop_small_regions(outlined, grey.dataset.geobox, request.min_area)
    shares = similarity_of(outlined, similarity.table.sample_mean)
    alike = shares, similarity.table.sample_mean - similarity.table.raster_mean
    confidence = Confidence.of(
        outlined,
        lambda: OF_MATCHES.probability(match_terms(outlined, *alike)),
        request.refine,
        request.min_confidence,
    )
    with phase("attributes and drawing"):
        outlined = replace(outlined, sums=sum_regions(grey, outlined, tile_pass))
        info = SourceInfo.of(grey)
        more = {"similarity": shares}
        return measured(outlined, info, (0.0, 1.0), request.drawing, more, confidence=confidence)


def similarity_of(outlined: RegionOutlines, own: float) -> NDArray[np.float64]:
    """Return mean likeness of regions as a share of that of the sample, at most 1: (n,) float64.

    The outlines have the sums of likeness; `own` is the mean likeness of the sample.
    """
    means = outlined.sums.greys / np.maximum(outlined.sums.counts, 1) / GREY_MAX
    return np.asarray(np.minimum(means / max(own, 1e-9), 1))
