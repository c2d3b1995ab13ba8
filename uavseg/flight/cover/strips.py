"""Strips: a cell cut into parallel strips at most one spacing wide, each with the line that covers it.

Lines along the middle of strips cover a cell if each line is as long as the cell inside its strip. A line
that is clipped to the cell is too short where an edge is slanted, and misses what ends between two lines.
"""

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError, ParameterError

Floats = NDArray[np.float64]

MAX_LINES = 32_000  # a mission has 65 534 items at most, and a line takes two of them
WIDTH_SLACK = 1e-3  # share of its height by which a cell may be higher before it needs another line


def strip_lines(cell: Any, spacing_m: float, reach_m: float = 0.0) -> Floats:
    """The lines along x that cover a cell, from south to north.

    Parameters
    ----------
    cell : shapely Polygon
        In metres; every line along x meets it in one piece, or nearly.
    spacing_m : float
        Largest distance between neighbouring lines.
    reach_m : float
        How far the ground that is covered reaches beyond the end of a line. So much shorter may a line be
        than the cell is in its strip, where the line itself does not end before the cell does.

    Returns
    -------
    lines : (n, 2, 2) float64 array
        West and east end of each line, as x, y. At least one; evenly spaced.

    Raises
    ------
    ParameterError
        If the spacing is not a positive number.
    MissionError
        If there would be more lines than a mission can hold.

    Examples
    --------
    >>> strip_lines(shapely.box(0, 0, 100, 30), 12).tolist()
    [[[0.0, 5.0], [100.0, 5.0]], [[0.0, 15.0], [100.0, 15.0]], [[0.0, 25.0], [100.0, 25.0]]]
    """
    _, south, _, north = shapely.bounds(cell)
    count = line_count(north - south, spacing_m)
    edges = np.linspace(south, north, count + 1)
    pieces = _cut(cell, edges)
    middle = (edges[1:] + edges[:-1]) / 2
    low, high = np.array([shapely.bounds(piece)[[0, 2]] for piece in pieces]).T
    begin, stop = _crossed(pieces, middle, low, high)
    start, end = np.fmin(low + reach_m, begin), np.fmax(high - reach_m, stop)
    short = start > end
    start[short] = end[short] = ((low + high) / 2)[short]
    return np.stack([np.column_stack([start, middle]), np.column_stack([end, middle])], axis=1)


def line_count(width_m: float, spacing_m: float) -> int:
    """Number of lines over a width.

    Raises
    ------
    ParameterError
        If the spacing is not a positive number.
    MissionError
        If they are more than a mission can hold.
    """
    if not (math.isfinite(spacing_m) and spacing_m > 0):
        raise ParameterError(f"the spacing of survey lines is a positive number of metres, not {spacing_m}")
    count = max(math.ceil(width_m / spacing_m * (1 - WIDTH_SLACK)), 1)
    if count > MAX_LINES:
        raise MissionError(
            f"{width_m:.0f} m at a spacing of {spacing_m:g} m make {count} lines, more than a mission holds; "
            "use a wider spacing"
        )
    return count


def _cut(cell: Any, edges: Floats) -> list[Any]:
    """The parts of a cell between lines along x: halved again and again, which is fast for many lines."""
    found: list[Any] = [None] * (len(edges) - 1)
    todo = [(cell, 0, len(edges) - 1)]
    while todo:
        part, first, last = todo.pop()
        if last - first == 1:
            found[first] = part
            continue
        middle = (first + last) // 2
        west, south, east, north = shapely.bounds(part)
        for begin, stop in ((first, middle), (middle, last)):
            low, high = (south - 1, edges[middle]) if begin == first else (edges[middle], north + 1)
            todo.append((shapely.intersection(part, shapely.box(west - 1, low, east + 1, high)), begin, stop))
    return found


def _crossed(pieces: list[Any], middle: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Where the middle line of each strip enters and leaves the cell; NaN where it does not meet it."""
    ends = [np.column_stack([low - 1, middle]), np.column_stack([high + 1, middle])]
    inside = shapely.intersection(np.array(pieces, object), shapely.linestrings(np.stack(ends, axis=1)))
    bounds = shapely.bounds(inside)
    return bounds[:, 0], bounds[:, 2]
