"""Sums over connected components: pixels, grey, squared grey, first pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel


@dataclass(frozen=True, slots=True)
class Sums:
    """Sums over the pixels of each component; those of tiles merge by adding.

    Parameters
    ----------
    counts : (n,) int64 array
        Number of pixels.
    greys : (n,) uint64 array
        Sum of g.
    squares : (n,) uint64 array
        Sum of g * g; does not overflow up to 4e9 pixels.
    firsts : (n, 2) int64 array
        Row and column of the first pixel in raster order; pixels also where components are whole cells.
    """

    counts: NDArray[np.int64]
    greys: NDArray[np.uint64]
    squares: NDArray[np.uint64]
    firsts: NDArray[np.int64]


def component_sums(labels: NDArray[np.uint32], count: int, grey: NDArray[np.uint16], margin: int = 0) -> Sums:
    """Sums over the components 1..count of a label image.

    Parameters
    ----------
    labels : (M, N) uint32 array
    count : int
    grey : (M + 2 m, N + 2 m) uint16 array
    margin : int
        m, width of the border of `grey` that has no labels.
    """
    counts = np.zeros(count, np.int64)
    greys = np.zeros(count, np.uint64)
    squares = np.zeros(count, np.uint64)
    firsts = np.full((count, 2), -1, np.int64)
    _sum_up(labels, grey, margin, counts, greys, squares, firsts)
    return Sums(counts, greys, squares, firsts)


@kernel("void(u4[:,::1], u2[:,::1], i8, i8[::1], u8[::1], u8[::1], i8[:,::1])")
def _sum_up(labels, grey, margin, counts, greys, squares, firsts):  # type: ignore[no-untyped-def]
    rows, cols = labels.shape
    for r in range(rows):
        c = 0
        while c < cols:
            label = labels[r, c]
            start = c
            while c < cols and labels[r, c] == label:
                c += 1
            if label == 0:
                continue
            total = np.uint64(0)
            square = np.uint64(0)
            for k in range(start, c):
                g = np.uint64(grey[r + margin, k + margin])
                total += g
                square += g * g
            if counts[label - 1] == 0:
                firsts[label - 1, 0] = r
                firsts[label - 1, 1] = start
            counts[label - 1] += c - start
            greys[label - 1] += total
            squares[label - 1] += square
