"""A whole map from samples of several classes: each pixel the likeliest of them by color, or none.

samples -> likeness of each class, against the samples of all others
        -> cells: where each may be
        -> outlined: decided together, pixel by pixel
"""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, SampleError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.match.ranges_of_sample import LEAST_PARTING, color_sources
from uavseg.jobs.result import result as results
from uavseg.jobs.result.result import Extraction, RegionRequest, SourceInfo
from uavseg.jobs.source.open_source import raster_of
from uavseg.jobs.source.source import Source, detail_of
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.raster.grid.tiling import TilePass
from uavseg.regions.confidence import OF_CLASSES, check_minimum, class_terms, none_confident
from uavseg.regions.edit.small import Area, drop_small_regions
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.sample.place import SampleMask, class_masks
from uavseg.regions.sample.similarity import BlurredBands, SimilaritySource, sample_colors, spread_colors
from uavseg.regions.tiles.class_tiles import LIKELY, ClassesByPixel, outline_likely_classes
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine, measure_block_maps_for
from uavseg.segmentation.refine.detail import Detail
from uavseg.segmentation.source import GreySource, with_statistics
from uavseg.units import MAX_PIXEL_CLASSES


@dataclass(frozen=True, slots=True)
class MatchClassesRequest(RegionRequest):
    """Samples of several classes, in a file of polygons, and how their regions are drawn.

    The classes are in a column `class`. Bands are those whose intensity is compared, each by itself, by
    number or name. Sizes are as of `ClassesRequest`, all else as of `MatchRequest`.
    """

    classes: str
    refine: str = "pixel"
    fill_holes: Area | None = None
    bands: tuple[int | str, ...] = ()

    def __post_init__(self) -> None:
        check_minimum(self.min_confidence, self.refine)
        if self.refine not in ("pixel", "none"):
            raise ParameterError(f"a refinement of matches is pixel or none, not {self.refine!r}")


def match_classes(source: Source, request: MatchClassesRequest, work: Work = SERIAL) -> Extraction:
    """Return regions of the classes of samples, in the column `class`; adjacent ones share borders.

    A SampleError says that a sample is not on the raster, too small, on nodata or in common with one of
    another class, or that the file has fewer than two classes, or too many.
    """
    work = work.begun()
    raster = raster_of(source, "a block map holds no colors to be compared; name the raster itself")
    places = class_masks(request.classes, raster.geobox)
    detail = detail_of(request.detail, raster.geobox, request.refine)
    if len(places) > MAX_PIXEL_CLASSES:
        most = f"at most {MAX_PIXEL_CLASSES} are told apart"
        raise SampleError(f"{request.classes} has {len(places)} classes; {most}")
    passes = work.over(raster).stages(3)
    grey = with_statistics(raster.grey(passes[0]), passes[0])
    bands = BlurredBands(color_sources(raster, grey, request.bands, passes[0].silent))
    params = SegmentParams(refine="none") if request.refine == "none" else SegmentParams()
    likenesses = learn_classes(bands, places, passes[0])
    hints = [
        f"color hardly parts the samples of {name} from the others"
        for name, found in zip(places, likenesses, strict=True)
        if found.table.separation < LEAST_PARTING
    ]
    outlined, classes = outlines_by_classes(grey, likenesses, params, passes[1:], detail)
    outlined = results.filled(grey, outlined, request.fill_holes, passes[-1])
    outlined = drop_small_regions(outlined, grey.dataset.geobox, request.min_area)
    kind = classes.at(outlined.sums.firsts) - 1
    columns = {"class": np.array(list(places), object)[kind]}
    hints += [f"no region is of {name}" for n, name in enumerate(places) if not (kind == n).any()]
    sure = partial(OF_CLASSES.of, class_terms, outlined, *alike(likenesses, kind), grey.statistics)
    info = SourceInfo.of(grey)
    result = results.measured(outlined, info, (0.0, 1.0), request, columns, sure, request.refine)
    if result.below_minimum and not len(result.regions):
        hints.append(none_confident(result.below_minimum, request.min_confidence))
    compared = request.bands or ("all" if raster.all_bands else None)
    how = {"classes": request.classes, "refine": request.refine, "bands": compared}
    how |= results.drawing_facts(request, request.fill_holes)
    return work.finished(results.with_metadata(result, raster, "match", how), *hints)


def learn_classes(
    bands: BlurredBands, places: Mapping[str, Sequence[SampleMask]], tile_pass: TilePass
) -> list[SimilaritySource]:
    """Return the raster as likeness to each class, against the samples of all others."""
    with phase("colors of the raster"):
        spread = spread_colors(bands.bands, tile_pass)
    likenesses = []
    for name, own in places.items():
        others = [mask for other, masks in places.items() if other != name for mask in masks]
        with phase(f"colors of {name}"):
            colors = sample_colors(bands.bands, own, tile_pass, others, f"the sample of {name}", spread)
            found = colors.similarity(bands)
        means = found.table.sample_mean, found.table.other_mean
        decided("%s: likeness %.3f in its samples, %.3f in the others", name, *means)
        likenesses.append(found)
    return likenesses


def outlines_by_classes(
    grey: GreySource,
    likenesses: Sequence[SimilaritySource],
    params: SegmentParams,
    passes: Sequence[TilePass],
    detail: Detail | None = None,
) -> tuple[RegionOutlines, ClassesByPixel]:
    """Return outlines of the likeliest class of each pixel, and the class of each by its first pixel, from 1.

    Regions are measured in the intensity `grey`; likenesses are those of `learn_classes`. There are two
    passes.
    """
    with phase("division"):
        maps = measure_block_maps_for(likenesses, LIKELY, params, passes[0])
        cells = [cells_to_refine(blocks, LIKELY, params) for blocks in maps]
    with phase("refinement and outlines"):
        return outline_likely_classes(grey, likenesses, cells, params.refine, passes[1], detail)


def alike(likenesses: Sequence[SimilaritySource], kind: Integers) -> tuple[Floats, Floats]:
    """Return how alike the samples of the class of each region are: two (n,) float64 arrays.

    Their mean likeness to it, and by how much that exceeds the mean of the raster. `kind` is the class of
    each region, from 0.
    """
    own = np.array([found.table.sample_mean for found in likenesses])
    share = np.array([found.table.raster_mean for found in likenesses])
    return own[kind], (own - share)[kind]
