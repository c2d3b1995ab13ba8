"""Clearance: the exact Euclidean distance transform of a mask, in two passes.

Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", Theory of Computing 8 (2012)
415-428: along the columns first, then a lower envelope of parabolas along each row. Distances are from the
centre of a cell to the nearest point of an impassable cell, not to its centre: a disc of that radius around
the centre touches no impassable cell. Everything outside of the map is unknown, hence impassable.
"""

from typing import Any

import numpy as np

from uavseg._jit import kernel
from uavseg.arrays import Bools, Floats

_TOLERANCE = 1e-9  # relative, so that rounding does not fail a distance that is met exactly


def clearance(mask: Bools, width: float = 1.0, height: float = 1.0) -> Floats:
    """Compute the distance from the centre of each cell to the nearest impassable cell or edge of the map.

    `mask` (M, N) are the passable cells. Width and height of a cell are in any unit; so are the distances (M,
    N), 0 in impassable cells.

    Examples
    --------
    >>> clearance(np.ones((3, 4), bool)).tolist()
    [[0.5, 0.5, 0.5, 0.5], [0.5, 1.5, 1.5, 0.5], [0.5, 0.5, 0.5, 0.5]]
    """
    squares = np.empty(mask.shape)
    size = mask.shape[1] + 1
    heights, vertices, bounds = np.empty(size), np.empty(size, np.int64), np.empty(size + 1)
    _down_columns(np.ascontiguousarray(mask).view(np.uint8), squares)
    _along_rows((height / width) ** 2, heights, vertices, bounds, squares)
    return np.asarray(np.sqrt(squares, out=squares) * (width / 2))


def is_at_least(distance: Any, metres: float) -> Any:
    """Return whether distances in metres reach a number of metres, with a tolerance for rounding."""
    return distance >= metres * (1 - _TOLERANCE)


@kernel("void(u1[:,::1], f8[:,::1])")
def _down_columns(mask, steps):  # type: ignore[no-untyped-def]
    # Half cells from each centre to the nearest impassable cell of its column: 0, 1, 3, 5...
    rows, cols = mask.shape
    for c in range(cols):
        steps[0, c] = mask[0, c]
    for r in range(1, rows):
        for c in range(cols):
            beside = steps[r - 1, c]
            steps[r, c] = (beside + 2.0 if beside > 0.0 else 1.0) if mask[r, c] else 0.0
    for c in range(cols):
        steps[rows - 1, c] = mask[rows - 1, c]
    for r in range(rows - 2, -1, -1):
        for c in range(cols):
            beside = steps[r + 1, c]
            steps[r, c] = min(steps[r, c], beside + 2.0 if beside > 0.0 else 1.0)


@kernel("void(f8, f8[::1], i8[::1], f8[::1], f8[:,::1])")
def _along_rows(squeeze, heights, vertices, bounds, steps):  # type: ignore[no-untyped-def]
    # From half cells along columns to squares of half cells, of the width of a cell. A parabola stands on
    # each edge between two columns, as high as the nearer of the two; outside of the map that is 0.
    rows, cols = steps.shape
    for r in range(rows):
        for k in range(cols + 1):
            nearer = min(steps[r, k - 1], steps[r, k]) if 0 < k < cols else 0.0
            heights[k] = nearer * nearer * squeeze
        rightmost = 0
        vertices[0] = 0
        bounds[0] = -np.inf
        for k in range(1, cols + 1):
            while True:
                p = vertices[rightmost]
                crossing = (heights[k] + 4.0 * k * k - heights[p] - 4.0 * p * p) / (4.0 * (k - p))
                if crossing > bounds[rightmost]:
                    break
                rightmost -= 1
            rightmost += 1
            vertices[rightmost], bounds[rightmost] = k, crossing
        current = 0
        for c in range(cols):
            x = 2.0 * c + 1.0
            while current < rightmost and bounds[current + 1] < x:
                current += 1
            distance = x - 2.0 * vertices[current]
            steps[r, c] = min(
                heights[vertices[current]] + distance * distance, steps[r, c] * steps[r, c] * squeeze
            )
