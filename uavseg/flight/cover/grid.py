"""Strips of one grid over a whole region, joined to cells where they neither split nor merge.

Cells that are cut into strips one by one (`cells`, `strips`) need up to one line more each. Strips of one
grid need as few lines as the region is high, but two for an arm that lies across an edge of the grid.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.cover.strips import line_count, line_in_strip, strips_between

Floats = NDArray[np.float64]
Free = Callable[[Floats, Floats], NDArray[np.bool_]]

TOUCH_M = 1e-6


def grid_lines(polygon: Any, spacing_m: float, ends: tuple[float, float], joins: Free) -> list[Floats]:
    """The lines along x that cover a polygon, cell by cell.

    Parameters
    ----------
    polygon : shapely Polygon
        In metres.
    spacing_m : float
        Largest distance between neighbouring lines.
    ends : (float, float)
        Reach and length of the shortest line, as of `strips.strip_lines`.
    joins : function of starts, ends (n, 2)
        Whether a line may lead over a gap in a strip.

    Returns
    -------
    list of (n, 2, 2) float64 arrays
        For each cell its lines from south to north: west and east end, as x, y.

    Raises
    ------
    ParameterError
        If the spacing is not a positive number.
    MissionError
        If there would be more lines than a mission can hold.

    Examples
    --------
    >>> ring = shapely.box(0, 0, 90, 90) - shapely.box(30, 30, 60, 60)
    >>> [len(cell) for cell in grid_lines(ring, 10, (0, 0), lambda starts, ends: np.zeros(len(starts), bool))]
    [3, 3, 3, 3]
    """
    _, south, _, north = shapely.bounds(polygon)
    edges = np.linspace(south, north, line_count(north - south, spacing_m) + 1)
    rows = []
    for k, strip in enumerate(strips_between(polygon, edges)):
        parts = [part for part in shapely.get_parts(strip) if part.geom_type == "Polygon"]
        rows.append(_row(parts, (edges[k] + edges[k + 1]) / 2, ends, joins))
    return _chains(rows, edges)


Segment = tuple[Any, Floats]  # what of the polygon a line covers, and the line


def _row(parts: list[Any], y: float, ends: tuple[float, float], joins: Free) -> list[Segment]:
    """The lines of one strip from west to east; one line for parts between which a line may lead."""
    laid = sorted(((part, line_in_strip(part, y, *ends)) for part in parts), key=lambda one: one[1][0, 0])
    if len(laid) < 2:
        return laid
    joined = joins(*(np.stack([line[k] for _, line in some]) for k, some in ((1, laid[:-1]), (0, laid[1:]))))
    row = [laid[0]]
    for join, (part, line) in zip(joined.tolist(), laid[1:], strict=True):
        if join:
            before, first = row[-1]
            last = line if line[1, 0] > first[1, 0] else first
            row[-1] = (shapely.union(before, part), np.stack([first[0], last[1]]))
        else:
            row.append((part, line))
    return row


def _chains(rows: list[list[Segment]], edges: Floats) -> list[Floats]:
    """Lines of neighbouring strips in one cell, as long as each has one neighbour only."""
    cells: list[list[Floats]] = []
    open_: list[list[Floats]] = []  # the cell of each segment of the row before
    before: list[Segment] = []
    for k, row in enumerate(rows):
        touch = _touching(before, row, float(edges[k]))
        cells_of_row = []
        for j, (_, line) in enumerate(row):
            below = np.flatnonzero(touch[:, j])
            if len(below) == 1 and touch[below[0]].sum() == 1:
                cell = open_[below[0]]
                cell.append(line)
            else:
                cell = [line]
                cells.append(cell)
            cells_of_row.append(cell)
        open_, before = cells_of_row, row
    return [np.stack(cell) for cell in cells]


def _touching(below: list[Segment], above: list[Segment], y: float) -> NDArray[np.bool_]:
    """Whether what one line covers meets what another does, along the edge between their strips."""
    touch = np.zeros((len(below), len(above)), bool)
    low, high = (
        [shapely.bounds(shapely.intersection(part, _slab(part, y))) for part, _ in some]
        for some in (below, above)
    )
    for i, one in enumerate(low):
        for j, other in enumerate(high):
            touch[i, j] = min(one[2], other[2]) - max(one[0], other[0]) > TOUCH_M  # False for NaN
    return touch


def _slab(part: Any, y: float) -> Any:
    west, _, east, _ = shapely.bounds(part)
    return shapely.box(west - 1, y - 1e-3, east + 1, y + 1e-3)
