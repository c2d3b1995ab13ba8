"""What closes the way between two free cells of a map: where it is narrowest, and what lies there.

A path cuts no corner, so cells are connected where they share an edge.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.occupancy.paths.clearance import is_at_least

Cell = tuple[int, int]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Gap:
    """The nearest two cells of two connected groups, and the cells of a way with one corner between them.

    Parameters
    ----------
    here, there : (int, int)
        Row and column of the cell on the side of the start, and on that of the goal.
    ways : two (n, 2) int64 arrays
        Cells of the way that goes down first and of the one that goes across first, without the two ends.
    """

    here: Cell
    there: Cell
    ways: tuple[NDArray[np.int64], NDArray[np.int64]]


def narrowest_gap(mask: Mask, start: Cell, goal: Cell, width: float, height: float) -> Gap:
    """Where the free cells around a start come nearest to those around a goal.

    Parameters
    ----------
    mask : (M, N) bool array
        The free cells, which do not connect the two.
    start, goal : (int, int)
        Row and column of free cells.
    width, height : float
        Of a cell, in any unit.

    Examples
    --------
    >>> gap = narrowest_gap(np.array([[1, 1, 0, 0, 1]], bool), (0, 0), (0, 4), 1.0, 1.0)
    >>> gap.here, gap.there, gap.ways[0].tolist()
    ((0, 1), (0, 4), [[0, 2], [0, 3]])
    """
    import shapely

    labels = _connected(mask)
    ours, theirs = (_border(labels == labels[cell]) for cell in (start, goal))
    tree = shapely.STRtree(shapely.points(ours * (height, width)))
    (at, nearest), away = tree.query_nearest(
        shapely.points(theirs * (height, width)), return_distance=True, all_matches=False
    )
    k = int(np.argmin(away))
    (row, col), (last_row, last_col) = ours[nearest[k]].tolist(), theirs[at[k]].tolist()
    rows, cols = _steps(row, last_row), _steps(col, last_col)
    down = [*((r, col) for r in rows), *((last_row, c) for c in cols[1:])]
    across = [*((row, c) for c in cols), *((r, last_col) for r in rows[1:])]
    first, second = (np.array(way[1:-1], np.int64).reshape(-1, 2) for way in (down, across))
    return Gap((row, col), (last_row, last_col), (first, second))


def largest_clearance(distance: NDArray[np.float64], start: Cell, goal: Cell) -> float:
    """The largest clearance with which a way connects two free cells; 0 where none does.

    Parameters
    ----------
    distance : (M, N) float64 array
        From the centre of each cell to the nearest impassable cell; 0 in these.
    start, goal : (int, int)
        Row and column.
    """
    known = np.unique(distance[(distance > 0) & (distance <= min(distance[start], distance[goal]))])
    open_, closed = -1, len(known)
    while closed - open_ > 1:
        middle = (open_ + closed) // 2
        labels = _connected(is_at_least(distance, known[middle]))
        if labels[start] == labels[goal]:
            open_ = middle
        else:
            closed = middle
    return 0.0 if open_ < 0 else float(known[open_])


def _connected(mask: Mask) -> NDArray[Any]:
    """Labels of the cells that share edges, 0 where the mask is false."""
    from skimage.measure import label

    return np.asarray(label(mask, connectivity=1))


def _border(mask: Mask) -> NDArray[np.int64]:
    """Row and column, (n, 2), of the cells of a mask beside others or at the edge of the map."""
    framed = np.pad(mask, 1)
    inner = framed[:-2, 1:-1] & framed[2:, 1:-1] & framed[1:-1, :-2] & framed[1:-1, 2:]
    return np.argwhere(mask & ~inner)


def _steps(first: int, last: int) -> range:
    return range(first, last - 1, -1) if last < first else range(first, last + 1)
