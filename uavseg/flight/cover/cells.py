"""Cells: a polygon cut where sweep lines split or merge (boustrophedon cellular decomposition).

A line that sweeps over a polygon splits or merges at the corners that point against the sweep: the corners of
holes and of concave places (H. Choset and P. Pignon, Coverage path planning: the boustrophedon cellular
decomposition, Field and Service Robotics, 1998). Cut along the sweep line through each of them, and every
line meets every cell in one piece.
"""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]

OVERLAP_M = 1e-6  # by which cuts are longer than the polygon is wide


def monotone_cells(polygon: Any, step_m: float = np.inf, detail_m: float = 0.0) -> list[Any]:
    """Cells of a polygon that every line along x meets in one piece at most.

    Parameters
    ----------
    polygon : shapely Polygon
        In metres; may have holes.
    step_m : float
        The polygon is cut besides at the inner corner of a step: an edge so long that runs nearly along x. A
        line across it would be too long for the narrow side.
    detail_m : float
        Notches that are less deep do not divide it; lines along x may meet cells in more pieces there.

    Returns
    -------
    list of shapely Polygon
        From south to north, then from west to east.

    Examples
    --------
    >>> ring = shapely.box(0, 0, 9, 9) - shapely.box(3, 3, 6, 6)
    >>> [cell.bounds for cell in monotone_cells(ring)]  # doctest: +NORMALIZE_WHITESPACE
    [(0.0, 0.0, 9.0, 3.0), (0.0, 3.0, 3.0, 6.0), (6.0, 3.0, 9.0, 6.0), (0.0, 6.0, 9.0, 9.0)]
    """
    critical = _all_critical(polygon, step_m, detail_m)
    if not len(critical):
        return [polygon]
    faces = shapely.polygonize(_noded(polygon, critical))
    inner = [face for face in faces.geoms if shapely.contains_xy(polygon, *_inside(face))]
    return sorted(inner, key=lambda face: (face.bounds[1], face.bounds[0]))


def has_steps(polygon: Any, step_m: float, detail_m: float = 0.0) -> bool:
    """Whether `monotone_cells` cuts a polygon at steps of its outline."""
    return count_cuts(polygon, step_m, detail_m) > count_cuts(polygon, np.inf, detail_m)


def count_cuts(polygon: Any, step_m: float = np.inf, detail_m: float = 0.0) -> int:
    """At how many corners `monotone_cells` cuts a polygon."""
    return len(_all_critical(polygon, step_m, detail_m))


def merge_flat_cells(cells: list[Any], least_m: float) -> list[Any]:
    """Cells of which those less high than `least_m` are merged with the neighbour that they touch most.

    Parameters
    ----------
    cells : list of shapely Polygon
        Of one polygon.
    least_m : float

    Returns
    -------
    list of shapely Polygon
        Lines along x may meet merged cells in two pieces, near an edge that is `least_m` away at most.
    """
    cells = list(cells)
    grown = list(shapely.buffer(cells, 1e-5))
    while len(cells) > 1:
        bounds = shapely.bounds(cells)
        height = bounds[:, 3] - bounds[:, 1]
        flat = int(np.argmin(height))
        if height[flat] >= least_m:
            break
        cell = cells.pop(flat)
        grown.pop(flat)
        touched = shapely.length(shapely.intersection(shapely.boundary(cell), grown))
        best = int(np.argmax(touched))
        merged = shapely.union(shapely.buffer(cells[best], 1e-5, join_style="mitre"), cell)
        if merged.geom_type != "Polygon":
            cells.append(cell)  # it touches none: the polygon was not connected there
            break
        cells[best], grown[best] = merged, shapely.buffer(merged, 1e-5)
    return sorted(cells, key=lambda face: (face.bounds[1], face.bounds[0]))


def _all_critical(polygon: Any, step_m: float, detail_m: float) -> Floats:
    """The corners at which a polygon is cut: some of its vertices."""
    outline = shapely.simplify(polygon, detail_m) if detail_m else polygon
    return np.unique(np.concatenate([_critical(ring, step_m) for ring in _rings(outline)]), axis=0)


def _rings(polygon: Any) -> list[Floats]:
    """The rings, the inside to their left."""
    rings = shapely.get_rings(shapely.orient_polygons(polygon))
    return [shapely.get_coordinates(ring)[:-1] for ring in rings]


def _critical(ring: Floats, step_m: float) -> Floats:
    """Corners that turn right, and whose neighbours both lie on one side of the sweep line through them.

    An edge along the sweep line counts as one corner.
    """
    into, out = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    turns_right = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0
    first = into[:, 1] != 0  # of each run of equal heights
    corners, turns_right = ring[first], turns_right[first]
    height = corners[:, 1]
    below, above = np.roll(height, 1) < height, np.roll(height, -1) < height
    is_step = (np.abs(out[:, 0]) >= step_m) & (np.abs(out[:, 1]) <= step_m / 4)
    inner = (into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0) & (is_step | np.roll(is_step, 1))
    return np.concatenate([corners[turns_right & (below == above)], ring[inner]])


def _noded(polygon: Any, critical: Floats) -> list[Any]:
    """Outlines and cuts as lines that meet at common vertices only."""
    west, _, east, _ = shapely.bounds(polygon)
    cuts = []
    for x, y in critical.tolist():
        across = shapely.LineString([(west - 1, y), (east + 1, y)])
        chords = shapely.get_parts(shapely.line_merge(shapely.intersection(polygon, across)))
        reach = shapely.Point(x, y)
        for chord in chords:
            if chord.geom_type == "LineString" and shapely.distance(chord, reach) < OVERLAP_M:
                (first, _), (last, _) = chord.coords[0], chord.coords[-1]
                low, high = min(first, last), max(first, last)
                cuts.append(shapely.LineString([(low - OVERLAP_M, y), (high + OVERLAP_M, y)]))
    lines = shapely.union_all([shapely.boundary(polygon), *cuts])
    return list(shapely.get_parts(lines))


def _inside(face: Any) -> tuple[float, float]:
    x, y = shapely.get_coordinates(shapely.point_on_surface(face))[0]
    return float(x), float(y)
