"""Search for the regions of a raster that are like a sample of it.

color -> outlined: where the raster has the colors of the sample, see `regions_by_color`
      -> texture: where that clearly parts what is outlined, it decides which of it remains
texture alone, see `by_texture`: where color hardly parts the sample from the raster, or as chosen
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from uavseg.arrays import Floats, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, UnchosenBandsError
from uavseg.execution.executors import decided, phase
from uavseg.jobs.match.by_texture import TextureSample, TextureSearch, regions_by_texture, search_texture
from uavseg.jobs.match.ranges_of_sample import LEAST_PARTING, band_sources, color_sources
from uavseg.jobs.match.request import ANSWERS, Ask, MatchRequest
from uavseg.jobs.result import result as results
from uavseg.jobs.result.result import Extraction, SourceInfo
from uavseg.jobs.source.open_source import raster_of
from uavseg.jobs.source.source import Raster, Source, detail_of
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.plain_text import shown
from uavseg.raster.grid.tiling import TilePass
from uavseg.regions.confidence import OF_MATCHES, match_terms, none_confident
from uavseg.regions.edit.small import drop_small_regions
from uavseg.regions.outline.rings import Rasteriser, RegionOutlines, renumber_by_size
from uavseg.regions.sample.place import Disc, SampleMask, sample_mask
from uavseg.regions.sample.scores import fitting_window, inner_cells
from uavseg.regions.sample.similarity import (
    BlurredBands,
    SimilaritySource,
    next_place,
    place_to_ask,
    sample_colors,
    spread_colors,
    window_colors,
)
from uavseg.regions.table import Regions
from uavseg.regions.tiles.class_tiles import LIKELY
from uavseg.regions.tiles.range_tiles import outline_regions, sum_regions
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.pipeline import cells_to_refine, measure_block_map_for
from uavseg.segmentation.sample.g_scores import is_bimodal, separability
from uavseg.segmentation.sample.similarity_table import SimilarityTable
from uavseg.segmentation.source import GreySource, with_statistics
from uavseg.units import GREY_MAX

_LEAST_WINDOW = 24  # pixels: smaller ones tell textures apart where these differ much
_LEAST_SEPARABILITY = 0.8  # of the scores of smaller windows
Masks = Sequence[SampleMask]

_HARDLY = "color hardly parts the sample from the rest of the raster; texture may (--by texture)"
_MIXED = "color hardly parts the samples of what is wanted from the others; give bands or an index that does"
_NEITHER = (
    "color hardly parts the sample from the rest of the raster, and the sample is too small to tell by its "
    "texture; give a larger one"
)


@dataclass(frozen=True)
class Match:
    """Regions like a sample, and what "like" meant."""

    found: Extraction  # with the column `similarity`, 1 where a region is as like the sample as it is itself
    color: SimilarityTable | None  # where colors were compared
    texture: TextureSample | None  # where texture was compared
    next_sample: Disc | None = None  # where a further sample helps most, if color alone left much undecided
    answers: tuple[int, ...] = (1,)  # that differ, of `ANSWERS`
    spread: Uint16s | None = None  # the colors all over the raster that were compared, as of `spread_colors`

    @property
    def compared(self) -> str:
        """What decided: "color", "texture", or both."""
        parts = [self.color is not None and "color", self.texture is not None and "texture"]
        return " and ".join(part for part in parts if part)

    @property
    def advice(self) -> str | None:
        """Where to look for a further sample, as a line with what to type."""
        if self.next_sample is None:
            return None
        disc = self.next_sample.word
        x, y, _ = disc.split(",")
        return f"undecided is what lies at {x}, {y}: look there, and add --like {disc} or --unlike {disc}"

    @property
    def others(self) -> str | None:
        """What the other answers are, as a line with what to type; None where there is one."""
        table = self.color
        if table is None or len(self.answers) == 1:
            return None
        shares = {1: table.share if self.texture is None else None, 3: table.finer_share}
        known = {n: share for n, share in shares.items() if share is not None}
        about = {n: f", about {100 * share:.2g} % of the raster" for n, share in known.items()}
        texts = [f"--answer {n} ({ANSWERS[n]}{about.get(n, '')})" for n in self.answers]
        return f"there are {len(texts)} answers: {', '.join(texts)}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know."""
        return self.found.warnings


def match(source: Source, request: MatchRequest, work: Work = SERIAL, spread: Uint16s | None = None) -> Match:
    """Return regions of a raster that are like a sample of it.

    `spread` is that of another match of the raster with the same bands, if any. A SampleError says that the
    sample is not on the raster, too small, or on nodata.
    """
    work = work.begun()
    raster = raster_of(source, "a block map holds no texture to be compared; name the raster itself")
    if raster.all_bands:
        if request.texture_alone:
            raise UnchosenBandsError(
                "texture is that of an intensity, and no band is chosen as one; choose with --band, --rgb, "
                "--index or --expr"
            )
        request = replace(request, by="color")
    detail_of(request.detail, raster.geobox, request.refine)  # refused before any work
    places = tuple(sample_mask(like, raster.geobox) for like in request.samples)
    passes = work.over(raster).stages(7)
    result = _compared(raster, raster.grey(passes[0]), places, request, passes, spread)
    hints = []
    if result.color is None and not len(result.found.regions) and not result.found.below_minimum:
        hints.append("nothing is like the sample; a smaller similarity or a larger intensity finds more")
    if result.color is not None and result.color.separation < LEAST_PARTING:
        hints.append(_MIXED if not request.is_one else _HARDLY if request.by == "color" else _NEITHER)
    if result.found.below_minimum and not len(result.found.regions):
        hints.append(none_confident(result.found.below_minimum, request.min_confidence))
    if result.color is not None:
        is_finer = result.color.finer_share is not None
        touching = is_finer or request.answer == 2 or len(result.found.regions) > 1
        result = replace(result, answers=(1, *[2] * touching, *[3] * is_finer))
    found = results.with_metadata(result.found, raster, "match", _facts(request, result, raster.all_bands))
    return replace(result, found=work.finished(found, *hints))


def each_answer(
    source: Source, request: MatchRequest, made: Match, work: Work = SERIAL
) -> dict[int, Regions]:
    """Return the regions of each answer that differs, by its number; `made` is the match of the request."""
    others = {n: replace(request, answer=n) for n in made.answers if n != request.answer}
    found = {n: match(source, other, work, made.spread).found.regions for n, other in others.items()}
    return dict(sorted({**found, request.answer: made.found.regions}.items()))


def with_answers(source: Source, request: MatchRequest, ask: Ask, work: Work = SERIAL) -> MatchRequest:
    """Return a request with a sample more for each place that was answered, until none is worth asking about.

    See `place_to_ask`. A ParameterError says that texture is compared alone, or that an answer is none; a
    SampleError is as of `match`.
    """
    if request.texture_alone:
        raise ParameterError("answers are compared by color; leave out the words of texture, or the asking")
    raster = raster_of(source, "a block map holds no colors to be compared; name the raster itself")
    passes = replace(work, progress=None, started=None).over(raster)
    colors = color_sources(raster, raster.grey(passes), request.bands, passes)
    windows = window_colors(colors, passes)
    asked: dict[Any, list[Any]] = {True: [*request.samples], False: [*request.unlike], "skip": []}
    while True:
        like, unlike, skipped = ([sample_mask(one, raster.geobox) for one in asked[key]] for key in asked)
        disc = place_to_ask(colors, windows, like, unlike, skipped, passes)
        answer = None if disc is None else ask(disc)
        if answer is None:
            return replace(request, like=tuple(asked[True]), unlike=tuple(asked[False]))
        if not isinstance(answer, bool | np.bool_ | str) or answer not in asked:
            raise ParameterError(f'an answer is True, False, "skip" or None, not {shown(answer)}')
        asked[answer].append(disc)


def _compared(
    raster: Raster,
    grey: GreySource,
    places: Masks,
    request: MatchRequest,
    passes: Sequence[TilePass],
    spread: Uint16s | None,
) -> Match:
    """Compare texture alone; or color, and unless that alone is chosen, texture where it tells more."""

    def search_with_bands() -> TextureSearch:
        bands = band_sources(raster, request.bands, passes[0].silent)
        return search_texture(grey, bands, places[0], request, passes[:2])

    if request.texture_alone:
        search = search_with_bands()
        return Match(regions_by_texture(search, passes[2:4]), None, search.how)
    colors = color_sources(raster, grey, request.bands, passes[0].silent)
    unlike = [sample_mask(one, raster.geobox) for one in request.unlike]
    if spread is None:
        with phase("colours of the raster"):
            spread = spread_colors(colors, passes[0])
    similarity = learn(colors, places, unlike, passes[0], request.answer != 1, spread)
    if request.answer == 3 and similarity.table.finer_share is None:
        raise ParameterError("there is no answer 3, because finer kinds find no less; leave the answer out")
    auto = request.by == "auto" and request.is_one and request.answer == 1
    window = fitting_window(places[0]) if auto else None
    if window is not None and similarity.table.separation < LEAST_PARTING:
        search = search_with_bands()
        if window >= _LEAST_WINDOW or separability(search.scores.best.ravel()) >= _LEAST_SEPARABILITY:
            decided("color hardly parts the sample from the raster: texture is compared")
            return Match(regions_by_texture(search, passes[2:4]), None, search.how)
    outlined, proposed = outlines_by_color(similarity, request, [*places, *unlike], passes[1:3])
    if window is not None and window >= _LEAST_WINDOW:
        plain = replace(request, intensity=float("inf"), bands=())
        search = search_texture(grey, (), places[0], plain, passes[3:5])
        inner = inner_cells(outlined.rings, raster.geobox.shape, passes[5].silent)
        if is_bimodal(search.scores.best[inner], search.criterion.limit):
            decided("texture clearly parts what has the colors of the sample")
            found = regions_by_texture(search, passes[5:7], outlined.rings)
            return Match(found, similarity.table, search.how)
    if request.answer == 2:  # the regions with pixels of a sample
        label, kept = Rasteriser(outlined.rings), np.zeros(len(outlined.sums.counts) + 1, bool)
        for place in places:
            kept[label(place.window)[place.mask]] = True
        outlined = renumber_by_size(outlined.rings, outlined.sums, kept[outlined.rings.labels])
    found = regions_by_color(grey, similarity, outlined, request, passes[2])
    return Match(found, similarity.table, None, proposed, spread=spread)


def _facts(request: MatchRequest, made: Match, all_bands: bool) -> dict[str, Any]:
    likes = [_fact(like) for like in request.samples]
    metadata: dict[str, Any] = {"like": likes[0] if len(likes) == 1 else likes, "by": made.compared}
    if request.unlike:
        metadata |= {"unlike": [_fact(one) for one in request.unlike]}
    if made.texture is not None:
        metadata |= {"window": made.texture.window, "similarity": request.similarity}
        any_intensity = made.color is not None or not np.isfinite(request.intensity)
        metadata |= {"intensity": "any" if any_intensity else request.intensity}
    metadata |= {"refine": request.refine, "bands": request.bands or ("all" if all_bands else None)}
    if len(made.answers) > 1:
        metadata |= {"answer": request.answer, "answers": [ANSWERS[n] for n in made.answers]}
    if made.next_sample is not None:
        metadata |= {"next_sample": _fact(made.next_sample)}
    return metadata | results.drawing_facts(request, request.fill_holes)


def _fact(like: Disc | str) -> list[float] | str:
    return [like.x, like.y, like.radius] if isinstance(like, Disc) else like


def learn(
    bands: Sequence[GreySource],
    places: Masks,
    unlike: Masks,
    tile_pass: TilePass,
    finer: bool = False,
    spread: Uint16s | None = None,
) -> SimilaritySource:
    """Return the raster as likeness to samples, and not to others; by the finest mixture if asked for."""
    with phase("colours of the sample"):
        colors = sample_colors(bands, places, tile_pass, unlike, spread=spread)
        result = colors.similarity(BlurredBands(bands), finer)
    means = result.table.sample_mean, result.table.raster_mean
    decided("likeness %.3f in the sample, %.3f in the raster", *means)
    return result


def outlines_by_color(
    similarity: SimilaritySource, request: MatchRequest, samples: Masks, passes: Sequence[TilePass]
) -> tuple[RegionOutlines, Disc | None]:
    """Return outlines where likeness is one half and more, and the best next sample; in two passes."""
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
    grey: GreySource, like: SimilaritySource, outlined: RegionOutlines, request: MatchRequest, tiles: TilePass
) -> Extraction:
    """Return outlines of `outlines_by_color` as regions, with attributes of the intensity `grey`."""
    outlined = results.filled(like, outlined, request.fill_holes, tiles)
    outlined = drop_small_regions(outlined, grey.dataset.geobox, request.min_area)
    shares = similarity_of(outlined, like.table.sample_mean)
    own, statistics = like.table.sample_mean, with_statistics(grey, tiles).statistics
    parting = own - like.table.raster_mean
    sure = partial(OF_MATCHES.of, match_terms, outlined, shares, own, parting, statistics)
    with phase("attributes and drawing"):
        outlined, info = replace(outlined, sums=sum_regions(grey, outlined, tiles)), SourceInfo.of(grey)
        more = {"similarity": shares}
        return results.measured(outlined, info, (0.0, 1.0), request, more, sure, request.refine)


def similarity_of(outlined: RegionOutlines, own: float) -> Floats:
    """Return the mean likeness of regions as a share of the sample's, `own`, at most 1: (n,) float64."""
    means = outlined.sums.greys / np.maximum(outlined.sums.counts, 1) / GREY_MAX
    return np.asarray(np.minimum(means / max(own, 1e-9), 1))
