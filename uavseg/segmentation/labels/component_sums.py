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
        Row and column of the first pixel in raster order.
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


def cell_totals(
    sums: NDArray[np.uint32], counts: NDArray[np.uint8], labels: NDArray[np.uint32], count: int
) -> tuple[NDArray[np.int64], NDArray[np.uint64], NDArray[np.int64]]:
    """Totals over the components 1..count of an image of cells.

    Parameters
    ----------
    sums : (m, n) uint32 array
        Sum of the grey of each cell.
    counts : (m, n) uint8 array
        Its valid pixels.
    labels : (m, n) uint32 array
    count : int

    Returns
    -------
    counts : (count,) int64 array
        Valid pixels.
    greys : (count,) uint64 array
    firsts : (count, 2) int64 array
        Row and column of the first cell in raster order.
    """
    totals, greys, firsts = (
        np.zeros(count, np.int64),
        np.zeros(count, np.uint64),
        np.zeros((count, 2), np.int64),
    )
    arrays = (np.ascontiguousarray(array) for array in (sums, counts, labels))
    _total(*arrays, np.zeros(count, np.uint8), totals, greys, firsts)
    return totals, greys, firsts


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


@kernel("void(u4[:,::1], u1[:,::1], u4[:,::1], u1[::1], i8[::1], u8[::1], i8[:,::1])")
def _total(sums, counts, labels, seen, totals, greys, firsts):  # type: ignore[no-untyped-def]
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if labels[r, c] == 0:
                continue
            k = labels[r, c] - 1
            totals[k] += np.int64(counts[r, c])
            greys[k] += np.uint64(sums[r, c])
            if not seen[k]:
                seen[k] = 1
                firsts[k, 0] = r
                firsts[k, 1] = c
