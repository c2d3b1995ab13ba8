"""Search for the shortest path between two places of one region of a map."""

import time
from dataclasses import dataclass

from uavseg.errors import ParameterError
from uavseg.jobs.extract import ExtractRequest, regions_of_pixels
from uavseg.jobs.source.source import Blocks, ProbabilityMap
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.occupancy.paths.find_path import PathParams, PlannedPath, find_path
from uavseg.occupancy.paths.free_cells import FreeCells
from uavseg.options.ranges import AnyRange
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.segmentation.source import GreySource


@dataclass(frozen=True, slots=True)
class PathRequest:
    """From where to where, and over what.

    Parameters
    ----------
    interval : IntensityRange or ValueRange
        The range of v that is passable; or of values in the map's own units, or of percentiles.
    start, goal : (float, float)
        x and y on the map.
    params : PathParams
        Clearance, and whether the path is pulled tight.
    segment : SegmentParams
        How regions are found: by the own values of cells (refine "pixels"), or as the paper does by those of
        blocks ("scan"), where a path stays within one region.
    """

    interval: AnyRange
    start: tuple[float, float]
    goal: tuple[float, float]
    params: PathParams = PathParams()
    segment: SegmentParams = SegmentParams(refine="pixels")


def path_params(segment: SegmentParams, refine: str | None) -> SegmentParams:
    """How the regions of a path are found: "pixels" by default, and "scan" with the paper's method.

    Raises
    ------
    ParameterError
        If it is another refinement.
    """
    if refine is None:
        refine = "scan" if segment.method == "paper" else "pixels"
    if refine not in ("pixels", "scan"):
        raise ParameterError(f"regions of a path are refined by pixels or scan, not {refine}")
    return SegmentParams.from_words(segment.method, segment.threshold, segment.intensity_step, refine)


@dataclass(frozen=True)
class PathFound:
    """A path, and how it was found.

    Parameters
    ----------
    path : PlannedPath
    in_metres : bool
        Whether its length is in metres rather than in units of the map.
    search_s : float
        Seconds of the search alone.
    warnings : tuple of str
    """

    path: PlannedPath
    in_metres: bool
    search_s: float
    warnings: tuple[str, ...]


def path(source: ProbabilityMap | Blocks, request: PathRequest, work: Work = SERIAL) -> PathFound:
    """The shortest path between two places of one region, over cells whose own value is in range.

    Parameters
    ----------
    source : ProbabilityMap
    request : PathRequest
    work : Work

    Raises
    ------
    PathError
        If a place lies outside of the map or in no region, the two lie in different regions, or no path
        leads from one to the other.
    ParameterError
        If the source is a block map.
    """
    work = work.begun()
    if isinstance(source, Blocks):
        raise ParameterError(
            f"{source.path} is a block map; a path follows the values of single cells, so give the map itself"
        )
    free = free_cells(source, request, work)
    start = time.perf_counter()
    way = find_path(free, request.start, request.goal, request.params, work.local)
    return work.finished(PathFound(way, source.in_metres, time.perf_counter() - start, way.warnings))


def free_cells(source: ProbabilityMap, request: PathRequest, work: Work = SERIAL) -> FreeCells:
    """The cells that a path may enter: in a region as `extract` finds it, and their own value in range."""
    found = regions_of_pixels(source, ExtractRequest(request.interval, request.segment), work)
    assert found.wanted is not None, "an extraction holds its range"
    grey = GreySource(source.dataset, found.stretch)
    return FreeCells(grey, found.rings, found.wanted.interval, found.warnings)
