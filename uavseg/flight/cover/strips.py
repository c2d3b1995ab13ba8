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

MAX_LINES = 10_000  # of a region; 20 000 waypoints are planned at most, and a line takes two of them
LEAST_LINE_M = 5.0  # where the cell is as long: a vehicle looks along its line only when it flies along it
WIDTH_SLACK = 1e-3  # share of its height by which a cell may be higher before it needs another line


def strip_lines(cell: Any, spacing_m: float, reach_m: float = 0.0, least_m: float = LEAST_LINE_M) -> Floats:
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
    least_m : float
        Length of the shortest line.

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
    middle = ((edges[1:] + edges[:-1]) / 2).tolist()
    return np.stack(
        [
            line_in_strip(piece, y, reach_m, least_m)
            for piece, y in zip(strips_between(cell, edges), middle, strict=True)
        ]
    )


def line_in_strip(piece: Any, y: float, reach_m: float, least_m: float = LEAST_LINE_M) -> Floats:
    """The line along x at a height that covers what lies in its strip: (2, 2), west end and east end.

    It is no shorter than `least_m` where the strip is as long, but 5 m where one photograph shows all of it.
    """
    low, _, high, _ = shapely.bounds(piece)
    across = shapely.LineString([(low - 1, y), (high + 1, y)])
    begin, _, stop, _ = shapely.bounds(shapely.intersection(piece, across))  # NaN where it is not met
    start, end = np.fmin(low + reach_m, begin), np.fmax(high - reach_m, stop)
    if end - start < least_m:
        shown_at_once = high - low <= 2 * reach_m - LEAST_LINE_M
        middle = (low + high) / 2 if shown_at_once or start > end else (start + end) / 2
        half = (LEAST_LINE_M if shown_at_once else least_m) / 2
        start, end = max(low, middle - half), min(high, middle + half)
    return np.array([[start, y], [end, y]])


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


def strips_between(cell: Any, edges: Floats) -> list[Any]:
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
