"""Outlines with fewer corners (Douglas-Peucker) around areas of many, such as those along pixel edges."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats, Integers, Objects
from uavseg.execution.executors import steps_done

MANY_CORNERS = 2000
"""Areas with more are replaced: a buffer far wider than the steps of an outline takes gigabytes of them."""
SIMPLIFIED = 0.23  # of the reach; GEOS moves the ends of rings by up to twice the tolerance
GROUP_CORNERS = 20_000
"""Areas of so many corners together are united in one call of GEOS, which takes a fraction of a second."""
_MERGED = 8  # areas that are united in one go
_QUARTER = 2  # segments of a quarter of a circle: a buffer is 8 % narrower at their middles


def enclosing(area: Any, reach_m: float) -> Any:
    """Return an area with fewer corners that contains another one; with few corners, that one itself.

    `area` (shapely) is valid, in metres. No point of the result is farther than `reach_m` (above 0) from it,
    or the result is the convex hull of a part.

    Examples
    --------
    >>> disc = shapely.Point(0, 0).buffer(100, quad_segs=1000)
    >>> around = enclosing(disc, 2)
    >>> int(shapely.get_num_coordinates(disc)), bool(shapely.get_num_coordinates(around) < 300)
    (4001, True)
    >>> bool(shapely.covers(around, disc)), bool(shapely.covers(disc.buffer(2), around))
    (True, True)
    """
    if shapely.get_num_coordinates(area) <= MANY_CORNERS:
        return area
    parts = np.array(shapely.get_parts(area))
    around = _grown(parts, reach_m, preserve_topology=False)
    for method in (partial(_grown, reach_m=reach_m, preserve_topology=True), shapely.convex_hull):
        uncovered = ~shapely.covers(around, parts)  # simplified rings may cross themselves
        around[uncovered] = method(parts[uncovered])
    return shapely.union_all(around)


def _grown(parts: Objects, reach_m: float, preserve_topology: bool) -> Objects:
    moved = SIMPLIFIED * reach_m
    simple = shapely.simplify(parts, moved, preserve_topology=preserve_topology)
    grown: Objects = shapely.buffer(simple, reach_m - 2 * moved, quad_segs=_QUARTER)
    return grown


def without_small_holes(area: Any, min_m2: float) -> Any:
    """Fill the holes of an area (shapely, in metres) that are smaller than a minimum in square metres."""

    def filled(polygon: Any) -> Any:
        holes = shapely.get_rings(polygon)[1:]
        large = [hole for hole in holes if shapely.area(shapely.polygons(hole)) >= min_m2]
        return shapely.Polygon(polygon.exterior, large) if len(large) < len(holes) else polygon

    return shapely.union_all([filled(part) for part in shapely.get_parts(area)])


def filled_parts(areas: Any) -> Objects:
    """Return the polygons of areas without their holes."""
    rings = shapely.get_exterior_ring(shapely.get_parts(areas))
    filled: Objects = shapely.polygons(rings[~shapely.is_missing(rings)])
    return filled


def neighbour_groups(areas: Objects, bounds: Floats) -> list[Integers]:
    """Return the indices of areas in groups of neighbours with about `GROUP_CORNERS` corners, by strips.

    `bounds` (n, 4) are the bounding boxes of the areas in metres.
    """
    corners = shapely.get_num_coordinates(areas)
    strips = int(np.ceil(np.sqrt(corners.sum() / GROUP_CORNERS)))
    if strips <= 1:
        return [np.arange(len(areas))]
    middle = bounds[:, :2] + bounds[:, 2:]
    strip = np.argsort(np.argsort(middle[:, 0], kind="stable")) * strips // len(areas)
    order = np.lexsort((middle[:, 1], strip))
    return np.split(order, np.flatnonzero(np.diff(np.cumsum(corners[order]) // GROUP_CORNERS)) + 1)


def merged(areas: Sequence[Any], fill: bool = False) -> Any:
    """Unite areas that are unions of neighbours, a few at a time; with `fill`, without holes."""
    left, done = list(areas), 0
    while len(left) > 1:
        groups = [left[k : k + _MERGED] for k in range(0, len(left), _MERGED)]
        left = []
        for group in groups:
            area = shapely.union_all(group)
            left.append(shapely.union_all(filled_parts(area)) if fill else area)
            done += len(group)
            steps_done(done, done + len(groups))
    return left[0]
