"""Path planning job: the shortest path between two positions in one region of a map."""

import time
from dataclasses import replace

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.jobs.extract import ExtractRequest, regions_of_pixels
from uavseg.jobs.source.open_source import map_of
from uavseg.jobs.source.source import Blocks, ProbabilityMap
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.occupancy.paths.find_path import FreeCells, PathParams, PlannedPath, find_path
from uavseg.options.classes import AnyRange, requested_range
from uavseg.options.maps import PathOptions
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.source import GreySource


@dataclass(frozen=True, slots=True)
class PathRequest:
    """Ends of a path, and the cells that it may pass."""

    # The range of v that is passable; or of values in the units of the map, or of percentiles.
    interval: AnyRange
    start: tuple[float, float]  # x and y on the map
    goal: tuple[float, float]
    params: PathParams = PathParams()  # clearance, and whether the path is shortened by string pulling
    # Segmentation into regions: by the values of cells (refine "pixels"), or as in the paper by those of
    # blocks ("scan"), where a path stays within one region.
    segment: SegmentParams = SegmentParams(refine="pixels")


def path_request(options: PathOptions) -> PathRequest:
    """Return the two places of a path, and over what it leads."""
    interval, params = requested_range(options.ranges), PathParams(options.clearance, options.smooth)
    segment, refine = options.division.segment_params(), options.refine
    if refine is None:
        refine = "scan" if segment.method == "paper" else "pixels"
    if refine not in ("pixels", "scan"):
        raise ParameterError(f"regions of a path are refined by pixels or scan, not {refine}")
    segment = replace(segment, refine=refine)  # type: ignore[arg-type]
    return PathRequest(interval, options.start, options.goal, params, segment)


@dataclass(frozen=True)
class PathFound:
    """A path, and the time of its search."""

    path: PlannedPath
    in_metres: bool  # whether its length is in metres rather than in units of the map
    search_s: float  # seconds of the search alone
    warnings: tuple[str, ...]


def path(source: ProbabilityMap | Blocks, request: PathRequest, work: Work = SERIAL) -> PathFound:
    """Find the shortest path between two positions in one region, over cells whose value is in range."""
    work = work.begun()
    source = map_of(source, "a path follows the values of single cells, so give the map itself")
    free = free_cells(source, request, work)
    start = time.perf_counter()
    planned = find_path(free, request.start, request.goal, request.params, work.local)
    search_s = time.perf_counter() - start
    return work.finished(PathFound(planned, source.in_metres, search_s=search_s, warnings=planned.warnings))


def free_cells(source: ProbabilityMap, request: PathRequest, work: Work = SERIAL) -> FreeCells:
    """Find the cells that a path may enter: in a region of `extract`, and their value in range."""
    regions = regions_of_pixels(source, ExtractRequest(request.interval, request.segment), work)
    assert regions.detected is not None, "an extraction holds its range"
    grey, interval = GreySource(source.dataset, regions.stretch), regions.detected.interval
    return FreeCells(source=grey, rings=regions.rings, interval=interval, warnings=regions.warnings)
