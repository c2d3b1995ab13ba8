"""A*: the shortest path over the cells of a mask, eight-connected, without cutting corners.

Hart, Nilsson and Raphael, "A formal basis for the heuristic determination of minimum cost paths", IEEE
Transactions on Systems Science and Cybernetics 4 (1968) 100-107. A step costs its Euclidean length, 1 or
sqrt 2; the heuristic is the octile distance. Of the many paths of one cost, only those that run diagonally
first are searched, by jump point search (Harabor and Grastien, "Online graph pruning for pathfinding on grid
maps", AAAI 2011, in the variant that cuts no corners). Dead ends are filled before.

The cost of a straight and b diagonal steps is the integer STRAIGHT * a + DIAGONAL * b. DIAGONAL / STRAIGHT is
a convergent of the continued fraction of sqrt 2, and no fraction with a smaller denominator lies between the
two, so the integers compare as a + b sqrt 2 as long as b is below STRAIGHT: all costs are exact. The open
list is a bucket queue of cost plus heuristic, last in first out. The order within a bucket does not matter,
because a cell that is reached at a lower cost is expanded again. So the result depends neither on rounding
nor on the machine.
"""

from dataclasses import dataclass
from math import sqrt
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, PathError
from uavseg.occupancy.paths.bitmap import Bitmap, fill_dead_ends, pack_mask, transpose_bitmap
from uavseg.occupancy.paths.jump_points import (
    ALL_DIRECTIONS,
    BUCKETS,
    ENTRIES,
    EXPANDED,
    NO_ENTRY,
    NODES,
    STRAIGHT,
    UNREACHED,
    octile_cost,
    search,
)

PoolDtype = TypeVar("PoolDtype", np.int32, np.int64, np.uint8)

MAX_SEARCH_CELLS = (1 << 31) - 1
_MIN_BUCKET_BITS = 27  # bits of the narrowest bucket: a tenth of a straight step


@dataclass(frozen=True)
class CellPath:
    """A path from cell to cell.

    Parameters
    ----------
    cells : (n, 2) int64 array
        Rows and columns, start and goal included; each is one of the eight neighbours of the one before.
    straight, diagonal : int
        Number of steps of either kind.
    expanded : int
        Number of cells that the search expanded.
    """

    cells: NDArray[np.int64]
    straight: int
    diagonal: int
    expanded: int

    @property
    def cost(self) -> float:
        """Length in cells: straight + diagonal * sqrt 2."""
        return self.straight + self.diagonal * sqrt(2)


def shortest_path(mask: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]) -> CellPath:
    """The shortest path between two cells of a mask.

    A step leads to one of the eight neighbours; a diagonal one needs both cells beside it to be passable.

    Parameters
    ----------
    mask : (M, N) bool array
        The passable cells.
    start, goal : (int, int)
        Row and column.

    Returns
    -------
    CellPath

    Raises
    ------
    PathError
        If start or goal is not passable or lies outside, or no path leads from one to the other.
    ParameterError
        If the mask has 2^31 cells or more.

    Examples
    --------
    >>> mask = np.array([[1, 1, 1], [1, 0, 1]], bool)
    >>> shortest_path(mask, (1, 0), (1, 2)).cells.tolist()
    [[1, 0], [0, 0], [0, 1], [0, 2], [1, 2]]
    >>> shortest_path(np.ones((3, 3), bool), (0, 0), (2, 2)).cost == 2 * 2**0.5
    True
    """
    _check_ends(mask, start, goal)
    first, last = (start[0] + 1, start[1] + 1), (goal[0] + 1, goal[1] + 1)
    rows = pack_mask(mask)
    fill_dead_ends(rows, first, last)
    turns, expanded = _search_turns(rows, transpose_bitmap(rows, mask.shape[1]), mask.shape, first, last)
    cells = _fill_between(turns - 1)
    diagonal = int(np.abs(np.diff(cells, axis=0)).prod(axis=1).sum())
    return CellPath(cells, len(cells) - 1 - diagonal, diagonal, expanded)


def _check_ends(mask: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]) -> None:
    rows, cols = mask.shape
    if (rows + 2) * (cols + 2) > MAX_SEARCH_CELLS:
        raise ParameterError(
            f"a map of {rows} x {cols} cells is too large for the path search; make its cells larger"
        )
    for name, (row, col) in (("start", start), ("goal", goal)):
        if not (0 <= row < rows and 0 <= col < cols) or not mask[row, col]:
            raise PathError(f"the {name}, row {row} and column {col}, is not a passable cell")


def _search_turns(
    rows: Bitmap, cols: Bitmap, shape: tuple[int, int], start: tuple[int, int], goal: tuple[int, int]
) -> tuple[NDArray[np.int64], int]:
    """Cells of the framed map between which a path runs diagonally, then straight; number of expansions."""
    width = shape[1] + 2
    node_of_cell = np.zeros((shape[0] + 2) * width, np.int32)  # number of the node on a cell, 0 for none
    heads = np.full(BUCKETS, NO_ENTRY, np.int32)
    bits = max(_MIN_BUCKET_BITS, (3 * max(shape) * STRAIGHT // BUCKETS).bit_length())
    origin = octile_cost(*start, *goal)
    state = np.array([0, 1, NO_ENTRY, 1, 2, UNREACHED, 0, bits, origin, *goal, width], np.int64)
    reserve = 8 * max(shape) + 64  # upper bound of what one expansion adds
    node_cells, parents, entries, next_entry = (np.zeros(2 * reserve, np.int32) for _ in range(4))
    costs, directions = np.zeros(2 * reserve, np.int64), np.zeros(2 * reserve, np.uint8)
    # Node 1 is the start, the only entry of the first bucket.
    node_cells[1], directions[1] = start[0] * width + start[1], ALL_DIRECTIONS
    entries[0], next_entry[0], heads[0] = 1, NO_ENTRY, 0
    node_of_cell[node_cells[1]] = 1
    if start == goal:
        return np.array([start]), 0
    grid = (rows, cols, node_of_cell)
    while search(*grid, node_cells, parents, costs, directions, entries, next_entry, heads, state, reserve):
        if state[NODES] + reserve > len(node_cells):
            node_cells, parents = _double(node_cells), _double(parents)
            costs, directions = _double(costs), _double(directions)
        if state[ENTRIES] + reserve > len(entries):
            entries, next_entry = _double(entries), _double(next_entry)
    chain = [int(node_of_cell[goal[0] * width + goal[1]])]
    if not chain[0]:
        raise PathError("no path leads from the start to the goal")
    while parents[chain[-1]]:
        chain.append(int(parents[chain[-1]]))
    return np.stack(np.divmod(node_cells[chain[::-1]].astype(np.int64), width), axis=1), int(state[EXPANDED])


def _double(pool: NDArray[PoolDtype]) -> NDArray[PoolDtype]:
    return np.concatenate([pool, pool])


def _fill_between(turns: NDArray[np.int64]) -> NDArray[np.int64]:
    """All cells of a path that runs from each turn to the next, diagonally first."""
    moves = np.diff(turns, axis=0)
    lengths = np.abs(moves).max(axis=1)
    step = np.arange(1, lengths.sum() + 1) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    walked = np.minimum(step[:, None], np.repeat(np.abs(moves), lengths, axis=0))
    cells = np.repeat(turns[:-1], lengths, axis=0) + np.repeat(np.sign(moves), lengths, axis=0) * walked
    return np.concatenate([turns[:1], cells])
