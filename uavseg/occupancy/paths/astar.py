"""A*: the shortest path over the cells of a mask, eight-connected, without cutting corners.

Hart, Nilsson and Raphael, "A formal basis for the heuristic determination of minimum cost paths", IEEE
Transactions on Systems Science and Cybernetics 4 (1968) 100-107. A step costs its Euclidean length, 1 or
sqrt 2; what is left is the cost of the shortest path were nothing in the way, which is never less than the
straight line. Of the many paths of one cost only those are followed that run diagonally first: the search
jumps to the next cell beside which something opens (Harabor and Grastien, "Online graph pruning for
pathfinding on grid maps", AAAI 2011, in the form that cuts no corners). Dead ends are filled beforehand.

A cost of a straight and b diagonal steps is the integer STRAIGHT * a + DIAGONAL * b. DIAGONAL / STRAIGHT is a
convergent of the continued fraction of sqrt 2, and no fraction with a smaller denominator lies between the
two, so integers compare as a + b sqrt 2 do as long as b is below STRAIGHT: all costs are exact. Cells wait in
buckets of cost plus what is left, last in first out; within a bucket order does not matter, for a cell that
turns out to be nearer is looked at again. So the answer depends neither on rounding nor on the machine.
"""

from dataclasses import dataclass
from math import sqrt
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, PathError
from uavseg.occupancy.paths.bitmap import Bits, fill_dead_ends, packed, transposed
from uavseg.occupancy.paths.jump_points import (
    BUCKETS,
    ENTRIES,
    EVERY,
    EXPANDED,
    FAR,
    NODES,
    NONE,
    STRAIGHT,
    left_to,
    search,
)

Number = TypeVar("Number", np.int32, np.int64, np.uint8)

MOST_CELLS = (1 << 31) - 1
_NARROWEST = 27  # bits of the narrowest bucket: a tenth of a straight step


@dataclass(frozen=True)
class Path:
    """A way over cells from one to another.

    Parameters
    ----------
    cells : (n, 2) int64 array
        Rows and columns, start and goal included; each is one of the eight neighbours of the one before.
    straight, diagonal : int
        Steps of either kind.
    expanded : int
        Cells from which the search went on.
    """

    cells: NDArray[np.int64]
    straight: int
    diagonal: int
    expanded: int

    @property
    def cost(self) -> float:
        """Length in cells: straight + diagonal * sqrt 2."""
        return self.straight + self.diagonal * sqrt(2)


def shortest_path(mask: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]) -> Path:
    """The shortest path between two cells of a mask.

    A step leads to one of the eight neighbours; a diagonal one needs both cells beside it to be passable.

    Parameters
    ----------
    mask : (M, N) bool array
        Which cells are passable.
    start, goal : (int, int)
        Row and column.

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
    _check(mask, start, goal)
    first, last = (start[0] + 1, start[1] + 1), (goal[0] + 1, goal[1] + 1)
    rows = packed(mask)
    fill_dead_ends(rows, first, last)
    turns, expanded = _turns(rows, transposed(rows, mask.shape[1]), mask.shape, first, last)
    cells = _between(turns - 1)
    diagonal = int(np.abs(np.diff(cells, axis=0)).prod(axis=1).sum())
    return Path(cells, len(cells) - 1 - diagonal, diagonal, expanded)


def _check(mask: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]) -> None:
    rows, cols = mask.shape
    if (rows + 2) * (cols + 2) > MOST_CELLS:
        raise ParameterError(
            f"a map of {rows} x {cols} cells is more than paths are searched on; make its cells larger"
        )
    for name, (row, col) in (("start", start), ("goal", goal)):
        if not (0 <= row < rows and 0 <= col < cols) or not mask[row, col]:
            raise PathError(f"the {name}, row {row} and column {col}, is not a passable cell")


def _turns(
    rows: Bits, cols: Bits, shape: tuple[int, int], start: tuple[int, int], goal: tuple[int, int]
) -> tuple[NDArray[np.int64], int]:
    """Cells of the framed map between which a path runs diagonally, then straight; how many were expanded."""
    width = shape[1] + 2
    numbers = np.zeros((shape[0] + 2) * width, np.int32)  # of the node on a cell, 0 for none
    heads = np.full(BUCKETS, NONE, np.int32)
    bits = max(_NARROWEST, (3 * max(shape) * STRAIGHT // BUCKETS).bit_length())
    memory = np.array([0, 1, NONE, 1, 2, FAR, 0, bits, left_to(*start, *goal), *goal, width], np.int64)
    room = 8 * max(shape) + 64  # of what one expansion adds at most
    places, parents, waiting, links = (np.zeros(2 * room, np.int32) for _ in range(4))
    costs, ways = np.zeros(2 * room, np.int64), np.zeros(2 * room, np.uint8)
    # Node 1 is the start, the only entry of the first bucket.
    places[1], ways[1], waiting[0], links[0], heads[0] = start[0] * width + start[1], EVERY, 1, NONE, 0
    numbers[places[1]] = 1
    if start == goal:
        return np.array([start]), 0
    while search(rows, cols, numbers, places, parents, costs, ways, waiting, links, heads, memory, room):
        if memory[NODES] + room > len(places):
            places, parents, costs, ways = (
                _doubled(places),
                _doubled(parents),
                _doubled(costs),
                _doubled(ways),
            )
        if memory[ENTRIES] + room > len(waiting):
            waiting, links = _doubled(waiting), _doubled(links)
    line = [int(numbers[goal[0] * width + goal[1]])]
    if not line[0]:
        raise PathError("no path leads from the start to the goal")
    while parents[line[-1]]:
        line.append(int(parents[line[-1]]))
    return np.stack(np.divmod(places[line[::-1]].astype(np.int64), width), axis=1), int(memory[EXPANDED])


def _doubled(pool: NDArray[Number]) -> NDArray[Number]:
    return np.concatenate([pool, pool])


def _between(turns: NDArray[np.int64]) -> NDArray[np.int64]:
    """All cells of a path that runs from each turn to the next, diagonally first."""
    moves = np.diff(turns, axis=0)
    lengths = np.abs(moves).max(axis=1)
    step = np.arange(1, lengths.sum() + 1) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    gone = np.minimum(step[:, None], np.repeat(np.abs(moves), lengths, axis=0))
    cells = np.repeat(turns[:-1], lengths, axis=0) + np.repeat(np.sign(moves), lengths, axis=0) * gone
    return np.concatenate([turns[:1], cells])
