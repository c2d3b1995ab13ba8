"""Frontiers of a map of states, the cells that a view sees of them, and what a scan from there would tell.

B. Yamauchi, "A frontier-based approach for autonomous exploration" (1997): a frontier is where free cells lie
beside unknown ones. Rays go from cell to cell (Amanatides and Woo, 1987).
"""

from math import inf, tau

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Float32s, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.units import FREE, OCCUPIED, UNKNOWN

States = NDArray[np.uint8]  # (rows, cols); 1 free, 2 unknown, 3 occupied, 0 no data, which is never entered
_MAX_RAYS = 360
_CELLS_BETWEEN_RAYS = 0.7  # at the end of the range


@dataclass(frozen=True, slots=True, eq=False)
class Frontiers:
    """Free cells that share an edge with unknown ones."""

    cells: Integers  # (n, 2); row and column, 8-connected groups together
    widths: Integers  # (n,); cells along the longer side of the group's bounding box
    index: NDArray[np.int32]  # (rows, cols); position in `cells`, -1 elsewhere


def find_frontiers(states: States) -> Frontiers:
    """Find the frontiers of a map.

    Examples
    --------
    >>> find_frontiers(np.array([[1, 1, 2], [1, 3, 2]], np.uint8)).cells.tolist()
    [[0, 1]]
    """
    unknown = np.pad(states == UNKNOWN, 1)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    marked = np.where((states == FREE) & beside, np.int32(-2), np.int32(-1))
    found = np.ascontiguousarray(np.argwhere(marked == -2))
    cells, widths = np.empty(found.shape, np.int64), np.empty(len(found), np.int64)
    _group(found, marked, cells, widths)
    return Frontiers(cells, widths, marked)


@kernel("void(i8[:,::1], i4[:,::1], i8[:,::1], i8[::1])")
def _group(found, index, cells, widths):  # type: ignore[no-untyped-def]
    # A cell is put at the end of `cells` when it is found, which is the queue of the search as well.
    rows, cols = index.shape
    count = 0
    for k in range(found.shape[0]):
        if index[found[k, 0], found[k, 1]] != -2:
            continue
        first, taken = count, count
        top, left, bottom, right = found[k, 0], found[k, 1], found[k, 0], found[k, 1]
        index[top, left] = count
        cells[count, 0], cells[count, 1] = top, left
        count += 1
        while taken < count:
            r, c = cells[taken, 0], cells[taken, 1]
            taken += 1
            top, left, bottom, right = min(top, r), min(left, c), max(bottom, r), max(right, c)
            for y in range(max(r - 1, 0), min(r + 2, rows)):
                for x in range(max(c - 1, 0), min(c + 2, cols)):
                    if index[y, x] == -2:
                        index[y, x] = count
                        cells[count, 0], cells[count, 1] = y, x
                        count += 1
        for j in range(first, count):
            widths[j] = max(bottom - top, right - left) + 1


def rays_for(range_cells: float, first: float = 0.0, fov: float = tau) -> Floats:
    """Return rays from an angle on, so close that no frontier lies between two at the end of the range.

    The result (n, 2) are the rows and columns of one step; angles are radians, from the columns to the rows.
    """
    turn = min(max(int(tau * range_cells / _CELLS_BETWEEN_RAYS), 16), _MAX_RAYS)
    angles = first + tau * np.arange(max(int(turn * fov / tau), 1)) / turn
    return np.asarray(np.stack([np.sin(angles), np.cos(angles)], axis=1))


def seen_from(
    states: States, index: NDArray[np.int32], count: int, views: Integers, range_cells: float
) -> tuple[Integers, NDArray[np.int32]]:
    """Return the frontier cells that a scan from each view would resolve, whatever the heading.

    They lie beside an unknown cell into which a ray goes from free ones; along the shadow of a corner, rays
    pass by. `index` (rows, cols) is the number of a frontier cell, below `count`, and -1 elsewhere; `views`
    (n, 2) are rows and columns. The result are the starts (n + 1,) of each view in a list of numbers, and
    the list.
    """
    starts, size = np.zeros(len(views) + 1, np.int64), 64 * len(views) + count
    last_view = np.full(count, -1, np.int64)
    views = np.ascontiguousarray(views)
    while True:
        seen = np.empty(size, np.int32)
        last_view.fill(-1)
        if _see(states, index, views, range_cells, rays_for(range_cells), last_view, starts, seen):
            return starts, seen[: starts[-1]]
        size *= 4


def visible_cells(solid: Bools, views: Integers, range_cells: float) -> Bools:
    """Return the cells that rays from some views reach, the first solid ones included, (rows, cols)."""
    cells, marked = np.ascontiguousarray(solid).view(np.uint8), np.zeros(solid.shape, np.uint8)
    _mark(cells, np.ascontiguousarray(views), range_cells, rays_for(2 * range_cells), marked)
    return marked > 0


@kernel("void(u1[:,::1], i8[:,::1], f8, f8[:,::1], u1[:,::1])")
def _mark(solid, views, range_cells, rays, marked):  # type: ignore[no-untyped-def]
    rows, cols = solid.shape
    for k in range(views.shape[0]):
        for ray in range(rays.shape[0]):
            r, c = views[k, 0], views[k, 1]
            down, right, per_row, per_col = _begin_ray(rays[ray, 0], rays[ray, 1])
            to_row, to_col, length = per_row / 2, per_col / 2, 0.0
            while length <= range_cells and 0 <= r < rows and 0 <= c < cols:
                marked[r, c] = 1
                if solid[r, c] != 0:
                    break
                if to_row < to_col:
                    length, to_row, r = to_row, to_row + per_row, r + down
                else:
                    length, to_col, c = to_col, to_col + per_col, c + right


@inlined
def _begin_ray(down, right):  # type: ignore[no-untyped-def]
    """Return the directions in which a ray leaves cells, and how long it is in a row and in a column."""
    per_row = 1.0 / abs(down) if abs(down) > 1e-12 else inf
    per_col = 1.0 / abs(right) if abs(right) > 1e-12 else inf
    return (1 if down > 0 else -1), (1 if right > 0 else -1), per_row, per_col


@kernel("b1(u1[:,::1], i4[:,::1], i8[:,::1], f8, f8[:,::1], i8[::1], i8[::1], i4[::1])")
def _see(states, index, views, range_cells, rays, last_view, starts, seen):  # type: ignore[no-untyped-def]
    # False if `seen` is too short.
    rows, cols = states.shape
    used = 0
    for k in range(views.shape[0]):
        if used + last_view.shape[0] > seen.shape[0]:
            return False
        for ray in range(rays.shape[0]):
            r, c = views[k, 0], views[k, 1]
            down, right, per_row, per_col = _begin_ray(rays[ray, 0], rays[ray, 1])
            to_row, to_col, length = per_row / 2, per_col / 2, 0.0
            while length <= range_cells and 0 <= r < rows and 0 <= c < cols and states[r, c] == FREE:
                if to_row < to_col:
                    length, to_row, r = to_row, to_row + per_row, r + down
                else:
                    length, to_col, c = to_col, to_col + per_col, c + right
            if length > range_cells or not (0 <= r < rows and 0 <= c < cols) or states[r, c] != UNKNOWN:
                continue
            for side in range(4):
                y, x = r + (side == 0) - (side == 1), c + (side == 2) - (side == 3)
                cell = index[y, x] if 0 <= y < rows and 0 <= x < cols else -1
                if cell >= 0 and last_view[cell] != k:
                    last_view[cell], seen[used] = k, cell
                    used += 1
        starts[k + 1] = used
    return True


def expected_bits(
    probabilities: Float32s,
    states: States,
    view: tuple[int, int],
    range_cells: float,
    heading: float = 0.0,
    fov: float = tau,
) -> float:
    """Return the entropy in bits of the cells that a scan is expected to reach, each weighed by how likely.

    A ray reaches a cell with the product of 1 - p over the cells before it (S. Thrun, W. Burgard and D. Fox,
    Probabilistic Robotics, 2005, chapter 17); a cell that is unknown blocks it as often as known cells of the
    map are occupied. Angles are radians, from the columns towards the rows.
    """
    free, occupied = np.count_nonzero(states == FREE), np.count_nonzero(states == OCCUPIED)
    p = np.clip(probabilities.astype(np.float64), 1e-12, 1 - 1e-12)
    entropy = -p * np.log2(p) - (1 - p) * np.log2(1 - p)
    blocking = np.where(states == UNKNOWN, (occupied + 1.0) / (free + occupied + 2.0), p)
    rays = rays_for(range_cells, heading - fov / 2, fov)
    return float(_expect(entropy, blocking, states, *view, range_cells, rays, np.zeros(states.shape)))


@kernel("f8(f8[:,::1], f8[:,::1], u1[:,::1], i8, i8, f8, f8[:,::1], f8[:,::1])")
def _expect(entropy, blocking, states, row, col, range_cells, rays, reached):  # type: ignore[no-untyped-def]
    rows, cols = states.shape
    bits = 0.0
    for ray in range(rays.shape[0]):
        r, c = row, col
        down, right, per_row, per_col = _begin_ray(rays[ray, 0], rays[ray, 1])
        to_row, to_col, length, chance = per_row / 2, per_col / 2, 0.0, 1.0
        while length <= range_cells and 0 <= r < rows and 0 <= c < cols and states[r, c] != 0:
            if chance > reached[r, c]:
                bits += entropy[r, c] * (chance - reached[r, c])
                reached[r, c] = chance
            chance *= 1.0 - blocking[r, c]
            if to_row < to_col:
                length, to_row, r = to_row, to_row + per_row, r + down
            else:
                length, to_col, c = to_col, to_col + per_col, c + right
    return bits
