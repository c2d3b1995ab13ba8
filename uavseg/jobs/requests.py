"""Requests of the jobs that make regions, from their options: the same for every face."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, Any

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.result import result as results
from uavseg.jobs.result.result import Drawing, Extraction
from uavseg.jobs.source.open_source import open_all_bands, open_source, pixels_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import Work
from uavseg.options.classes import classes_of_options, requested_range
from uavseg.options.reading import ReadOptions
from uavseg.options.regions import ExtractOptions, LevelsOptions, MatchOptions, SuggestOptions
from uavseg.raster.grid.geobox import as_length
from uavseg.regions.edit.small import as_area
from uavseg.segmentation.params.segment import Levels

if TYPE_CHECKING:
    from uavseg.jobs.match.ranges_of_sample import SuggestLikeRequest
    from uavseg.jobs.suggest import SuggestRequest
    from uavseg.regions.sample.place import Disc


Find = Callable[..., Extraction]


@dataclass(frozen=True)
class RegionJob:
    """A job that finds regions in a source: how that is read, and what `find` answers, the request."""

    read: ReadOptions
    find: Callable[[Source, Work], Extraction]
    request: Any = None
    opened: Callable[[Any, ReadOptions], Source] = open_source  # by what its sources are opened


def region_job(options: ExtractOptions | LevelsOptions | MatchOptions) -> RegionJob:
    """Return the job of some options, checked before any work."""
    if isinstance(options, ExtractOptions):
        find, request = _extract(options)
    elif isinstance(options, LevelsOptions):
        find, request = _levels(options)
    else:
        find, request = _match(options)
    opened = open_all_bands if isinstance(options, MatchOptions) else open_source

    def answer(source: Source, work: Work) -> Extraction:
        if options.drawing.stats is None:
            return find(source, request, work)
        pixels = pixels_of(source, "--stats reads the bands of the raster; give it in place of its block map")
        results.bands_of(pixels.dataset)  # refused before any work
        found, work = find(source, request, work), replace(work.begun(), progress=None, started=None)
        with work.reading_here():
            dataset = pixels.cleaned(work.over(pixels))
            regions = results.with_band_statistics(found.regions, dataset, request.drawing)
        notes = dict.fromkeys((*found.warnings, *work.bad_block_warnings))
        return replace(found, regions=regions, warnings=tuple(notes))

    return RegionJob(options.read, answer, request, opened)


def _sizes(options: ExtractOptions | LevelsOptions | MatchOptions) -> dict[str, Any]:
    """Return how regions are drawn, and which are left out: what the requests have in common."""
    sizes, drawing = options.sizes, options.drawing
    return {
        "drawing": Drawing(drawing.smooth_outline, drawing.simplify, drawing.stats, drawing.regularize),
        "fill_holes": as_area(sizes.fill_holes),
        "min_area": as_area(sizes.min_area),
        "detail": as_length(sizes.detail),
        "min_confidence": sizes.min_confidence,
    }


def _extract(options: ExtractOptions) -> tuple[Find, Any]:
    classes = classes_of_options(options.ranges.range, options.class_texts, options.classes)
    ranges = (options.ranges.range, options.ranges.values, options.ranges.percentile)
    if options.classes is not None and any(one is not None for one in ranges):
        raise ParameterError("extract takes a range or classes; give one of them")
    segment = options.division.segment_params(None if classes else options.refine)
    common = _sizes(options) | {"diagonally": options.neighbours.diagonally}
    if classes is None:
        interval = requested_range(options.ranges)
        return extract, ExtractRequest(interval, segment, thin_lines=options.thin_lines, **common)
    from uavseg.jobs.segment_classes import ClassesRequest, extract_classes, joint_params

    if options.thin_lines:
        raise ParameterError("thin lines are found for one range, not for classes; leave thin lines out")
    return extract_classes, ClassesRequest(classes, joint_params(segment, options.refine), **common)


def _levels(options: LevelsOptions) -> tuple[Find, Any]:
    from uavseg.jobs.segment_classes import LevelsRequest, breaks_of, level_params, levels

    wanted = breaks_of(options.breaks) if options.width is None else Levels(options.width)
    sizes = _sizes(options) | {"small": options.small, "diagonally": options.neighbours.diagonally}
    del sizes["fill_holes"]
    segment = level_params(options.division.segment_params(), options.refine, wanted)
    return levels, LevelsRequest(wanted, segment, **sizes)


def _match(options: MatchOptions) -> tuple[Find, Any]:
    common = _sizes(options) | {"bands": tuple(options.bands), "refine": options.refine}
    if options.classes is not None:
        from uavseg.jobs.match.by_classes import MatchClassesRequest, match_classes

        return match_classes, MatchClassesRequest(os.fspath(options.classes), **common)
    from uavseg.jobs.match.match import match, with_answers
    from uavseg.jobs.match.request import MatchRequest

    def find(source: Source, request: MatchRequest, work: Work) -> Extraction:
        if options.ask:
            request = with_answers(source, request, options.ask, work)
        return match(source, request, work).found

    common |= {name: getattr(options, name) for name in ("by", "answer", "window", "similarity", "intensity")}
    return find, MatchRequest(like=samples_of(options.like), unlike=samples_of(options.unlike), **common)


def suggest_request(options: SuggestOptions) -> "SuggestRequest":
    """Return which ranges are suggested; refuse a number of classes that is none with ParameterError."""
    from uavseg.jobs.suggest import SuggestRequest

    classes = options.classes
    if classes != "auto" and not isinstance(classes, int):
        raise ParameterError(f'classes are "auto" or a number, not {classes!r}')
    return SuggestRequest(classes if isinstance(classes, int) else None, options.division.segment_params())


def suggest_like_request(options: SuggestOptions) -> "SuggestLikeRequest":
    """Return the sample that suggested ranges part."""
    from uavseg.jobs.match.ranges_of_sample import SuggestLikeRequest

    return SuggestLikeRequest(samples_of(options.like), samples_of(options.unlike), tuple(options.bands))


def samples_of(given: Any) -> "tuple[Disc | str, ...]":
    """Return one sample or several for requests: files of polygons, X,Y,RADIUS as text, or discs."""
    from uavseg.regions.sample.place import Disc, parse_like

    if isinstance(given, str | os.PathLike):
        return (parse_like(os.fspath(given)),)
    if len(given) == 3 and all(isinstance(number, Real) for number in given):
        return (Disc(*given),)
    several: Sequence[Any] = given
    return tuple(sample for one in several for sample in samples_of(one))
