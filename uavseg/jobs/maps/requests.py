"""Requests of the jobs over occupancy maps, from their options."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from uavseg.jobs.maps.classify import ClassifyRequest
    from uavseg.jobs.maps.explore import ExploreRequest
    from uavseg.jobs.maps.next_view import ViewRequest
    from uavseg.jobs.maps.path import PathRequest
    from uavseg.jobs.requests import RegionJob
    from uavseg.occupancy.bags.merge_bag import MergeParams
    from uavseg.options.maps import (
        BuildMapOptions,
        ClassifyOptions,
        ExploreOptions,
        NextViewOptions,
        PathOptions,
    )
    from uavseg.options.regions import CompareOptions


def classify_request(options: ClassifyOptions, with_objects: bool | None = None) -> ClassifyRequest:
    """Return the states of which a map is classified.

    Objects are outlined by default where a file of them is written.
    """
    from uavseg.jobs.maps.classify import ClassifyRequest
    from uavseg.jobs.result.result import Drawing
    from uavseg.regions.edit.small import as_area
    from uavseg.segmentation.params.segment import StateLimits

    named = options.objects is not None or options.labels is not None
    return ClassifyRequest(
        StateLimits(options.free_below, options.occupied_above),
        options.division.segment_params(options.refine),
        objects=named if with_objects is None else with_objects,
        drawing=Drawing(simplify_m=options.simplify),
        min_area=as_area(options.min_area),
        allow_lost_obstacles=options.allow_lost_obstacles,
    )


def path_request(options: PathOptions) -> PathRequest:
    """Return the two places of a path, and over what it leads."""
    from uavseg.jobs.maps.path import PathRequest, path_params
    from uavseg.occupancy.paths.find_path import PathParams
    from uavseg.options.classes import requested_range

    return PathRequest(
        requested_range(options.ranges),
        start=options.start,
        goal=options.goal,
        params=PathParams(options.clearance, options.smooth),
        segment=path_params(options.division.segment_params(), options.refine),
    )


def merge_params(options: BuildMapOptions) -> MergeParams:
    """Return how the scans of a bag are merged."""
    from uavseg.occupancy.bags.merge_bag import MergeParams

    return MergeParams(
        resolution_m=options.resolution,
        sigma_m=options.sigma,
        max_range_m=options.max_range,
        heights=options.heights,
        no_return=options.no_return,
        beam_order=options.beam_order,
    )


def view_request(options: NextViewOptions) -> ViewRequest:
    """Return the robot, its sensor and how many views are asked for."""
    from uavseg.jobs.maps.next_view import ViewRequest
    from uavseg.segmentation.params.segment import StateLimits

    return ViewRequest(
        options.pose,
        options.range,
        fov_deg=options.fov,
        count=options.count,
        clearance_m=options.clearance,
        limits=StateLimits(options.free_below, options.occupied_above),
    )


def explore_request(options: ExploreOptions) -> ExploreRequest:
    """Return how a scene is explored, and by which sensor."""
    from uavseg.jobs.maps.explore import ExploreRequest

    given = {
        "max_range_m": options.range,
        "fov_deg": options.fov,
        "sigma_m": options.sigma,
        "step_deg": options.step,
    }
    sensor = [(name, value) for name, value in given.items() if value is not None]
    return ExploreRequest(options.start, sensor, options.clearance, options.seed)


def compare_job(options: CompareOptions) -> RegionJob | None:
    """Return the job whose regions are compared; None where neither a range nor classes are given: maps."""
    from uavseg.jobs.requests import region_job
    from uavseg.options.regions import ExtractOptions

    ranges, classes, refine = options.ranges, options.classes, options.refine
    others = ranges.values, ranges.percentile, classes
    if all(one is None for one in (ranges.range, refine, *others)):
        return None
    if isinstance(ranges.range, list) and any(one is not None for one in others):
        raise ParameterError("several ranges are classes; give them, or values, percentile or classes")
    return region_job(ExtractOptions(ranges=ranges, classes=classes, refine=refine))
