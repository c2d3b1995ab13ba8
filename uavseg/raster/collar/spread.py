"""Breadth-first spread over the pixels of an image, 8-connected."""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel

UNREACHED = 255


def flood(sources: NDArray[np.bool_], passable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return passable pixels that are connected to a source, and the sources.

    Examples
    --------
    >>> row = np.array([[1, 1, 0, 1]], bool)
    >>> flood(np.array([[1, 0, 0, 0]], bool), row)
    array([[ True,  True, False, False]])
    """
    reached: NDArray[np.bool_] = _spread_from(sources, passable, 1, 0) != UNREACHED
    return reached


def distances(sources: NDArray[np.bool_], passable: NDArray[np.bool_], reach: int) -> NDArray[np.uint8]:
    """Return number of steps over passable pixels from the nearest source, up to `reach`; 255 beyond.

    Examples
    --------
    >>> distances(np.array([[1, 0, 0, 0]], bool), np.ones((1, 4), bool), 2)
    array([[  0,   1,   2, 255]], dtype=uint8)
    """
    return _spread_from(sources, passable, reach, 1)


def _spread_from(
    sources: NDArray[np.bool_], passable: NDArray[np.bool_], reach: int, step: int
) -> NDArray[np.uint8]:
    steps = np.where(sources, np.uint8(0), np.uint8(UNREACHED))
    _spread(np.ascontiguousarray(passable).view(np.uint8), steps, reach, step, np.empty(steps.size, np.int64))
    return steps


@kernel("void(u1[:,::1], u1[:,::1], i8, i8, i8[::1])")
def _spread(passable, steps, reach, step, queue):  # type: ignore[no-untyped-def]
    rows, cols = steps.shape
    end = 0
    for r in range(rows):
        for c in range(cols):
            if steps[r, c] == 0:
                others = 0
                for i in range(max(r - 1, 0), min(r + 2, rows)):
                    for j in range(max(c - 1, 0), min(c + 2, cols)):
                        others += steps[i, j] != 0
                if others > 0:  # a source among others spreads nowhere
                    queue[end] = r * cols + c
                    end += 1
    first = 0
    while first < end:
        r = queue[first] // cols
        c = queue[first] - r * cols
        first += 1
        if steps[r, c] >= reach:
            continue
        following = np.uint8(steps[r, c] + step)
        for i in range(max(r - 1, 0), min(r + 2, rows)):
            for j in range(max(c - 1, 0), min(c + 2, cols)):
                if steps[i, j] == 255 and passable[i, j] != 0:
                    steps[i, j] = following
                    queue[end] = i * cols + j
                    end += 1
