"""Home position: the nearest place outside of all regions and keep-out zones."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.execution.executors import steps_done
from uavseg.flight.avoid.enclosing import MANY_CORNERS, filled_parts, merged, neighbour_groups, without_holes
from uavseg.flight.mission.plane import Plane, plane_around
from uavseg.flight.safety.keep_out import KeepOut

IsGround = Callable[[float, float], bool]

CLEARANCE_M = 15.0  # from home to regions and to zones with their margin
SIMPLIFIED_M = 0.75  # tolerance for outlines of many corners; GEOS moves the ends of rings by up to twice it
STEP_M = 5.0
MAX_TRIES = 5000
_DECIMALS = 7  # of degrees: a centimetre


def home_outside(
    polygons: Sequence[Any],
    points: Sequence[tuple[float, float]],
    zones: Sequence[Any] = (),
    avoid_margin_m: float = 0.0,
    is_ground: IsGround | None = None,
) -> tuple[float, float]:
    """Find the place nearest to the middle of all regions that lies outside of them and of keep-out zones.

    A place that a region or zone encloses, such as an island, is not taken: people may not get there. The
    polygons, with a point (lon, lat) inside each, and the zones are in degrees (WGS 84). `is_ground` says
    whether a place (lat, lon) may be home; by default every place may. A MissionError says that there are no
    regions, or that no place near them may be home.
    """
    if not len(polygons):
        raise MissionError("there is no region to fly to; choose at least one")
    regions = np.array([*polygons, None], object)[:-1]
    plane = plane_around(shapely.bounds(shapely.get_parts(regions)), points[0][0])
    keep_out = KeepOut(list(plane.project_polygons(zones)), avoid_margin_m)
    outlines = shapely.get_exterior_ring(shapely.get_parts(_around(regions, plane, keep_out.grown)))
    places = shapely.get_coordinates(shapely.segmentize(outlines, STEP_M))
    middle = np.mean(np.column_stack(plane.xy_from_lonlat(*np.array(points).T)), axis=0)
    nearest = places[np.argsort(np.hypot(*(places - middle).T), kind="stable")[:MAX_TRIES]]
    for lon, lat in np.round(np.column_stack(plane.lonlat_from_xy(*nearest.T)), _DECIMALS).tolist():
        if is_ground is None or is_ground(lat, lon):
            return lat, lon
    raise MissionError(
        "no place for home was found near the regions on valid pixels of the raster; give --home LAT,LON"
    )


def _around(regions: NDArray[np.object_], plane: Plane, zones: Any) -> Any:
    """Merge regions (degrees) and zones (metres), with the clearance around them and without holes.

    Groups of neighbours are filled one by one: a hole that several of them enclose lies within their group.
    """
    west, south, east, north = shapely.bounds(regions).T
    bounds = np.column_stack([*plane.xy_from_lonlat(west, south), *plane.xy_from_lonlat(east, north)])
    groups = neighbour_groups(regions, bounds)
    areas = []
    for k, group in enumerate(groups):
        steps_done(k, len(groups))
        metres = shapely.make_valid(plane.project_polygons(regions[group]))
        areas.append(_grown(metres if k else np.append(metres, zones)))
    return merged(areas, fill=True)


def _grown(areas: NDArray[np.object_]) -> Any:
    """Grow areas by the clearance, without holes; those of many corners are simplified first."""
    if shapely.get_num_coordinates(areas).sum() <= MANY_CORNERS:
        grown = shapely.buffer(shapely.union_all(areas), CLEARANCE_M, quad_segs=4)
    else:
        simple = shapely.simplify(filled_parts(areas), SIMPLIFIED_M)
        grown = shapely.union_all(shapely.buffer(simple, CLEARANCE_M + 2 * SIMPLIFIED_M, quad_segs=4))
    return without_holes(grown)
