"""Boustrophedon cellular decomposition: a polygon divided where sweep lines split or merge.

A line that sweeps over a polygon splits or merges at the corners that point against the sweep: the corners of
holes and of concave places (H. Choset and P. Pignon, Coverage path planning: the boustrophedon cellular
decomposition, Field and Service Robotics, 1998). Divided along the sweep line through each of them, every
line meets every cell in one piece.
"""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]

OVERLAP_M = 1e-6  # by which dividing lines are longer than the polygon is wide


def monotone_cells(polygon: Any, step_m: float = np.inf, detail_m: float = 0.0) -> list[Any]:
    """Divide a polygon into cells that every line along x meets in one piece at most.

    Parameters
    ----------
    polygon : shapely Polygon
        In metres; may have holes.
    step_m : float
        The polygon is also divided at the inner corner of a step: an edge so long that runs nearly along x.
        A line across it would be too long for the narrow side.
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
    """Return whether `monotone_cells` divides a polygon at steps of its outline; parameters as there."""
    return critical_count(polygon, step_m, detail_m) > critical_count(polygon, np.inf, detail_m)


def critical_count(polygon: Any, step_m: float = np.inf, detail_m: float = 0.0) -> int:
    """Return the number of corners at which `monotone_cells` divides a polygon; parameters as there."""
    return len(_all_critical(polygon, step_m, detail_m))


def merge_flat_cells(cells: list[Any], min_m: float) -> list[Any]:
    """Merge cells of one polygon less high than a minimum with the neighbour of the longest common edge.

    Lines along x may meet merged cells in two pieces, near an edge that is `min_m` away at most.
    """
    cells = list(cells)
    grown = list(shapely.buffer(cells, 1e-5))
    while len(cells) > 1:
        bounds = shapely.bounds(cells)
        height = bounds[:, 3] - bounds[:, 1]
        flat = int(np.argmin(height))
        if height[flat] >= min_m:
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
    """Return the vertices at which a polygon is divided."""
    outline = shapely.simplify(polygon, detail_m) if detail_m else polygon
    rings = shapely.get_rings(shapely.orient_polygons(outline))  # the inside to their left
    critical = [_critical(shapely.get_coordinates(ring)[:-1], step_m) for ring in rings]
    return np.unique(np.concatenate(critical), axis=0)


def _critical(ring: Floats, step_m: float) -> Floats:
    """Return the corners that turn right, with both neighbours on one side of the sweep line through them.

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
    """Node the outlines with the dividing lines: they meet at common vertices only."""
    west, _, east, _ = shapely.bounds(polygon)
    dividing = []
    for x, y in critical.tolist():
        across = shapely.LineString([(west - 1, y), (east + 1, y)])
        chords = shapely.get_parts(shapely.line_merge(shapely.intersection(polygon, across)))
        reach = shapely.Point(x, y)
        for chord in chords:
            if chord.geom_type == "LineString" and shapely.distance(chord, reach) < OVERLAP_M:
                (first, _), (last, _) = chord.coords[0], chord.coords[-1]
                low, high = min(first, last), max(first, last)
                dividing.append(shapely.LineString([(low - OVERLAP_M, y), (high + OVERLAP_M, y)]))
    lines = shapely.union_all([shapely.boundary(polygon), *dividing])
    return list(shapely.get_parts(lines))


def _inside(face: Any) -> tuple[float, float]:
    x, y = shapely.get_coordinates(shapely.point_on_surface(face))[0]
    return float(x), float(y)
