"""Pulling the string tight: a path of any angles that stays where a path over cells may go.

A straight leg between two centres of cells is allowed where every cell that it touches is passable; where it
runs through a corner, that means both cells beside it, as for a diagonal step.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

Cells = NDArray[np.int64]

_PATIENCE = 32  # cells in a row that are hidden before a view is taken to end
_FARTHEST = 256  # corners that a leg may skip
_ROUNDS = 64  # each makes the path shorter, by less and less


def tightened(mask: NDArray[np.bool_], cells: Cells) -> Cells:
    """The corners of a shorter path between the same ends.

    From each corner the path goes straight to the last cell of it that can be seen. Then, in turn, corners
    move by a cell at a time as long as that makes the path shorter, and those are kept that make the shortest
    path. What comes out is never longer than what went in.

    Parameters
    ----------
    mask : (M, N) bool array
        Which cells are passable.
    cells : (n, 2) int64 array
        A path from neighbour to neighbour, from `astar.shortest_path`.

    Returns
    -------
    corners : (k, 2) int64 array
        Some centres of cells, each visible from the one before; the first and the last are those of `cells`.

    Examples
    --------
    >>> tightened(np.ones((3, 5), bool), np.array([[0, 0], [1, 1], [1, 2], [1, 3], [2, 4]])).tolist()
    [[0, 0], [2, 4]]
    """
    open_ = np.ascontiguousarray(mask).view(np.uint8)
    corners = np.ascontiguousarray(cells, np.int64).copy()
    corners = corners[: _straighten(open_, corners)]
    for _ in range(_ROUNDS):
        moved = _pull(open_, corners)
        corners = _chosen(open_, corners)
        if not moved:
            break
    return corners


def _chosen(mask: NDArray[np.uint8], corners: Cells) -> Cells:
    """The corners of a shortest path over some of them, in their order."""
    before, lengths = np.zeros(len(corners), np.int64), np.zeros(len(corners))
    _choose(mask, corners, _FARTHEST, lengths, before)
    line = [len(corners) - 1]
    while line[-1]:
        line.append(int(before[line[-1]]))
    return corners[line[::-1]]


def is_visible(mask: NDArray[np.bool_], one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether every cell that the leg between two centres touches is passable.

    Examples
    --------
    >>> mask = np.array([[1, 1, 1], [1, 0, 1]], bool)
    >>> is_visible(mask, (0, 0), (0, 2)), is_visible(mask, (1, 0), (0, 1))
    (True, False)
    """
    return bool(_visible(np.ascontiguousarray(mask).view(np.uint8), *one, *other))


def length(corners: Cells) -> float:
    """Length of a path in cells."""
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())


@inlined
def sees(mask, row, col, to_row, to_col):  # type: ignore[no-untyped-def]
    """Walk along a leg from cell to cell; True if it ends without meeting an impassable one."""
    rows = abs(to_row - row)
    cols = abs(to_col - col)
    down = 1 if to_row > row else -1
    right = 1 if to_col > col else -1
    # Twice the area between the leg and the next corner: which of the two edges there is crossed first.
    ahead = cols - rows
    while mask[row, col]:
        if row == to_row and col == to_col:
            return True
        if ahead > 0:
            col += right
            ahead -= 2 * rows
        elif ahead < 0:
            row += down
            ahead += 2 * cols
        else:
            if not (mask[row + down, col] and mask[row, col + right]):
                return False
            row += down
            col += right
            ahead += 2 * (cols - rows)
    return False


@inlined
def _leg(row, col, to_row, to_col):  # type: ignore[no-untyped-def]
    rows = np.float64(to_row - row)
    cols = np.float64(to_col - col)
    return np.sqrt(rows * rows + cols * cols)


@kernel("b1(u1[:,::1], i8, i8, i8, i8)")
def _visible(mask, row, col, to_row, to_col):  # type: ignore[no-untyped-def]
    return sees(mask, row, col, to_row, to_col)


@kernel("i8(u1[:,::1], i8[:,::1])")
def _straighten(mask, corners):  # type: ignore[no-untyped-def]
    # From each corner go on from the last that it sees, and drop those between; how many are left.
    count = corners.shape[0]
    kept = 0
    k = 0
    while k < count - 1:
        farthest = k + 1
        for j in range(k + 2, count):
            if sees(mask, corners[k, 0], corners[k, 1], corners[j, 0], corners[j, 1]):
                farthest = j
            elif j - farthest > _PATIENCE:
                break
        corners[kept, 0] = corners[k, 0]
        corners[kept, 1] = corners[k, 1]
        kept += 1
        k = farthest
    corners[kept, 0] = corners[count - 1, 0]
    corners[kept, 1] = corners[count - 1, 1]
    return kept + 1


@kernel("void(u1[:,::1], i8[:,::1], i8, f8[::1], i8[::1])")
def _choose(mask, corners, most, lengths, before):  # type: ignore[no-untyped-def]
    # Length of the shortest path to each corner, and the corner before it there.
    for k in range(1, corners.shape[0]):
        lengths[k] = np.inf
        for j in range(max(k - most, 0), k):
            total = lengths[j] + _leg(corners[j, 0], corners[j, 1], corners[k, 0], corners[k, 1])
            if total < lengths[k] and (
                j == k - 1 or sees(mask, corners[j, 0], corners[j, 1], corners[k, 0], corners[k, 1])
            ):
                lengths[k] = total
                before[k] = j


@kernel("i8(u1[:,::1], i8[:,::1])")
def _pull(mask, corners):  # type: ignore[no-untyped-def]
    # Move each corner to the neighbour that makes the path shortest, until none does; how many moved.
    moved = 0
    for k in range(1, corners.shape[0] - 1):
        before_row, before_col = corners[k - 1, 0], corners[k - 1, 1]
        after_row, after_col = corners[k + 1, 0], corners[k + 1, 1]
        row, col = corners[k, 0], corners[k, 1]
        while True:
            best = _leg(before_row, before_col, row, col) + _leg(row, col, after_row, after_col)
            best_row, best_col = row, col
            for r in range(max(row - 1, 0), min(row + 2, mask.shape[0])):
                for c in range(max(col - 1, 0), min(col + 2, mask.shape[1])):
                    total = _leg(before_row, before_col, r, c) + _leg(r, c, after_row, after_col)
                    if (
                        total < best - 1e-9
                        and sees(mask, before_row, before_col, r, c)
                        and sees(mask, r, c, after_row, after_col)
                    ):
                        best = total
                        best_row, best_col = r, c
            if best_row == row and best_col == col:
                break
            row, col = best_row, best_col
            moved += 1
        corners[k, 0] = row
        corners[k, 1] = col
    return moved
