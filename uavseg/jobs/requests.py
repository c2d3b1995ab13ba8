"""Requests of the jobs that make regions, from their options: the same for every face."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.jobs.extract import ExtractRequest, extract
from uavseg.jobs.result.result import Drawing, Extraction
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import Work
from uavseg.options.classes import classes_of_options, requested_range
from uavseg.options.regions import ExtractOptions, LevelsOptions, MatchOptions, SuggestOptions
from uavseg.raster.grid.geobox import as_length
from uavseg.regions.edit.small import as_area
from uavseg.segmentation.params.segment import Levels

if TYPE_CHECKING:
    from uavseg.jobs.match.by_classes import MatchClassesRequest
    from uavseg.jobs.match.ranges_of_sample import SuggestLikeRequest
    from uavseg.jobs.match.request import MatchRequest
    from uavseg.jobs.segment_classes import ClassesRequest, LevelsRequest
    from uavseg.jobs.suggest import SuggestRequest
    from uavseg.options.reading import ReadOptions
    from uavseg.regions.sample.place import Disc


@dataclass(frozen=True)
class RegionJob:
    """A job that finds regions in a source: how that is read, and what `find` answers, the request."""

    read: ReadOptions
    find: Callable[[Source, Work], Extraction]
    request: Any = None


def region_job(options: ExtractOptions | LevelsOptions | MatchOptions) -> RegionJob:
    """Return the job of some options, checked before any work."""
    if isinstance(options, ExtractOptions):
        return _extract_job(options)
    if isinstance(options, LevelsOptions):
        from uavseg.jobs.segment_classes import levels

        request = _levels_request(options)
        return RegionJob(options.read, lambda source, work: levels(source, request, work), request)
    return _match_job(options)


def _sizes(options: ExtractOptions | LevelsOptions | MatchOptions) -> dict[str, Any]:
    """Return how regions are drawn, and which are left out: what the requests have in common."""
    sizes, drawing = options.sizes, options.drawing
    return {
        "drawing": Drawing(drawing.smooth_outline, drawing.simplify),
        "fill_holes": as_area(sizes.fill_holes),
        "min_area": as_area(sizes.min_area),
        "detail": as_length(sizes.detail),
        "min_confidence": sizes.min_confidence,
    }


def _extract_job(options: ExtractOptions) -> RegionJob:
    classes = classes_of_options(options.ranges.range, options.class_texts, options.classes)
    ranges = (options.ranges.range, options.ranges.values, options.ranges.percentile)
    if options.classes is not None and any(one is not None for one in ranges):
        raise ParameterError("extract takes a range or classes; give one of them")
    segment = options.division.segment_params(None if classes else options.refine)
    common = _sizes(options)
    if classes is None:
        request = ExtractRequest(
            requested_range(options.ranges), segment, thin_lines=options.thin_lines, **common
        )
        return RegionJob(options.read, lambda source, work: extract(source, request, work), request)
    from uavseg.jobs.segment_classes import ClassesRequest, extract_classes, joint_params

    if options.thin_lines:
        raise ParameterError("thin lines are found for one range, not for classes; leave thin lines out")
    several: ClassesRequest = ClassesRequest(classes, joint_params(segment, options.refine), **common)
    return RegionJob(options.read, lambda source, work: extract_classes(source, several, work), several)


def _levels_request(options: LevelsOptions) -> LevelsRequest:
    from uavseg.jobs.ranges.level_breaks import breaks_of
    from uavseg.jobs.segment_classes import LevelsRequest, level_params

    levels = breaks_of(options.breaks) if options.width is None else Levels(options.width)
    sizes = _sizes(options)
    del sizes["fill_holes"]
    return LevelsRequest(
        levels,
        level_params(options.division.segment_params(), options.refine, levels),
        small=options.small,  # type: ignore[arg-type]
        **sizes,
    )


def _match_job(options: MatchOptions) -> RegionJob:
    if options.classes is not None:
        from uavseg.jobs.match.by_classes import match_classes

        classes = _match_classes_request(options)
        return RegionJob(options.read, lambda source, work: match_classes(source, classes, work), classes)
    from uavseg.jobs.match.match import match

    request = _match_request(options)
    return RegionJob(options.read, lambda source, work: match(source, request, work).found, request)


def _match_request(options: MatchOptions) -> MatchRequest:
    from uavseg.jobs.match.request import MatchRequest

    return MatchRequest(
        like=samples_of(options.like),
        unlike=samples_of(options.unlike),
        by=options.by,
        window=options.window,
        similarity=options.similarity,
        intensity=options.intensity,
        bands=tuple(options.bands),
        refine=options.refine,
        **_sizes(options),
    )


def _match_classes_request(options: MatchOptions) -> MatchClassesRequest:
    from uavseg.jobs.match.by_classes import MatchClassesRequest

    return MatchClassesRequest(
        os.fspath(options.classes or ""),
        bands=tuple(options.bands),
        refine=options.refine,
        **_sizes(options),
    )


def suggest_request(options: SuggestOptions) -> SuggestRequest:
    """Return which ranges are suggested; refuse a number of classes that is none with ParameterError."""
    from uavseg.jobs.suggest import SuggestRequest

    classes = options.classes
    if classes != "auto" and not isinstance(classes, int):
        raise ParameterError(f'classes are "auto" or a number, not {classes!r}')
    return SuggestRequest(classes if isinstance(classes, int) else None, options.division.segment_params())


def suggest_like_request(options: SuggestOptions) -> SuggestLikeRequest:
    """Return the sample that suggested ranges part."""
    from uavseg.jobs.match.ranges_of_sample import SuggestLikeRequest

    return SuggestLikeRequest(samples_of(options.like), samples_of(options.unlike), tuple(options.bands))


def samples_of(given: Any) -> tuple[Disc | str, ...]:
    """Return one sample or several for requests: files of polygons, X,Y,RADIUS as text, or discs."""
    from uavseg.regions.sample.place import Disc, parse_like

    if isinstance(given, str | os.PathLike):
        return (parse_like(os.fspath(given)),)
    if len(given) == 3 and all(isinstance(number, Real) for number in given):
        return (Disc(*given),)
    several: Sequence[Any] = given
    return tuple(sample for one in several for sample in samples_of(one))
