"""Any-angle paths by string pulling: a shorter path over passable cells.

A straight leg between two centres of cells is allowed if every cell that it touches is passable. Where it
runs through a corner, it touches both cells beside it, as a diagonal step does.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Integers

_MAX_HIDDEN = 32  # hidden cells in a row after which the search for a visible one stops
_MAX_SKIPPED = 256  # corners that a leg may skip
_MAX_ROUNDS = 64  # each makes the path shorter, by less and less


def pull_string(mask: Bools, cells: Integers) -> Integers:
    """Shorten a path between the same ends; returns its corners.

    From each corner the path goes straight to the last of its cells that is visible. Then, in turn, corners
    move by one cell at a time as long as that makes the path shorter, and corners are dropped where that
    does. The result is never longer than the given path.

    `mask` (M, N) are the passable cells, `cells` (n, 2) the row and column of a path from neighbour to
    neighbour, from `astar.shortest_path`. Each of the corners (k, 2) is visible from the one before; the
    first and the last are those of `cells`.

    Examples
    --------
    >>> pull_string(np.ones((3, 5), bool), np.array([[0, 0], [1, 1], [1, 2], [1, 3], [2, 4]])).tolist()
    [[0, 0], [2, 4]]
    """
    open_ = np.ascontiguousarray(mask).view(np.uint8)
    corners = np.ascontiguousarray(cells, np.int64).copy()
    corners = corners[: _skip_visible(open_, corners)]
    for _ in range(_MAX_ROUNDS):
        moved = _move_corners(open_, corners)
        before, lengths = np.zeros(len(corners), np.int64), np.zeros(len(corners))
        _shortest_over(open_, corners, _MAX_SKIPPED, lengths, before)
        chain = [len(corners) - 1]
        while chain[-1]:
            chain.append(int(before[chain[-1]]))
        corners = corners[chain[::-1]]
        if not moved:
            break
    return corners


@inlined
def has_line_of_sight(mask, row, col, to_row, to_col):  # type: ignore[no-untyped-def]
    """Walk along a leg from cell to cell; True if all of them are passable."""
    rows, cols = abs(to_row - row), abs(to_col - col)
    down = 1 if to_row > row else -1
    right = 1 if to_col > col else -1
    # Twice the area between the leg and the next corner; its sign says which edge is crossed first.
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
    rows, cols = np.float64(to_row - row), np.float64(to_col - col)
    return np.sqrt(rows * rows + cols * cols)


@kernel("i8(u1[:,::1], i8[:,::1])")
def _skip_visible(mask, corners):  # type: ignore[no-untyped-def]
    # Skip from each corner to the last visible one, in place; returns the number of corners left.
    total = corners.shape[0]
    kept, k = 0, 0
    while k < total - 1:
        farthest = k + 1
        for j in range(k + 2, total):
            if has_line_of_sight(mask, corners[k, 0], corners[k, 1], corners[j, 0], corners[j, 1]):
                farthest = j
            elif j - farthest > _MAX_HIDDEN:
                break
        corners[kept, 0] = corners[k, 0]
        corners[kept, 1] = corners[k, 1]
        kept += 1
        k = farthest
    corners[kept, 0] = corners[total - 1, 0]
    corners[kept, 1] = corners[total - 1, 1]
    return kept + 1


@kernel("void(u1[:,::1], i8[:,::1], i8, f8[::1], i8[::1])")
def _shortest_over(mask, corners, max_skipped, lengths, before):  # type: ignore[no-untyped-def]
    # Length of the shortest path to each corner, and the corner before it on that path.
    for k in range(1, corners.shape[0]):
        lengths[k] = np.inf
        for j in range(max(k - max_skipped, 0), k):
            length = lengths[j] + _leg(corners[j, 0], corners[j, 1], corners[k, 0], corners[k, 1])
            if length < lengths[k] and (
                j == k - 1
                or has_line_of_sight(mask, corners[j, 0], corners[j, 1], corners[k, 0], corners[k, 1])
            ):
                lengths[k], before[k] = length, j


@kernel("i8(u1[:,::1], i8[:,::1])")
def _move_corners(mask, corners):  # type: ignore[no-untyped-def]
    # Move each corner to the neighbour that makes the path shortest, until none does; returns the moves.
    moved = 0
    for k in range(1, corners.shape[0] - 1):
        prev_row, prev_col = corners[k - 1, 0], corners[k - 1, 1]
        next_row, next_col = corners[k + 1, 0], corners[k + 1, 1]
        row, col = corners[k, 0], corners[k, 1]
        while True:
            best = _leg(prev_row, prev_col, row, col) + _leg(row, col, next_row, next_col)
            best_row, best_col = row, col
            for r in range(max(row - 1, 0), min(row + 2, mask.shape[0])):
                for c in range(max(col - 1, 0), min(col + 2, mask.shape[1])):
                    length = _leg(prev_row, prev_col, r, c) + _leg(r, c, next_row, next_col)
                    if (
                        length < best - 1e-9
                        and has_line_of_sight(mask, prev_row, prev_col, r, c)
                        and has_line_of_sight(mask, r, c, next_row, next_col)
                    ):
                        best = length
                        best_row, best_col = r, c
            if best_row == row and best_col == col:
                break
            row, col = best_row, best_col
            moved += 1
        corners[k, 0], corners[k, 1] = row, col
    return moved
