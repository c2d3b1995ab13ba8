"""Parts of a block map measured and decided again: what `blockmap` does for all blocks, for some of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.blockmap import BlockMap, leaves_of_block, undecided_in_block

Places = NDArray[np.int64]


def sum_cells(grey: NDArray[np.uint16], places: Places, sums: NDArray[np.uint32]) -> None:
    """Sum the grey of each cell of some blocks again.

    Parameters
    ----------
    grey : (M + 2, N + 2) uint16 array
        With a border of one pixel; 0 where a pixel is not valid.
    places : (n, 2) int64 array
        Row and column of blocks of 64.
    sums : (8 B, 8 C) uint32 array
        Of the block map; filled in at these blocks.
    """
    _sum_cells(grey, places, sums)


def undecided_at(
    blocks: BlockMap, edges: Sequence[float], intensity_step: float, places: Places
) -> NDArray[np.uint32]:
    """Which R must be known of some blocks, see `blockmap.undecided`.

    Returns
    -------
    undecided : (n,) uint32 array
    """
    found = np.empty(len(places), np.uint32)
    _undecided_at(blocks.sums, blocks.counts, np.array(edges, np.float64), intensity_step, places, found)
    return found


def decide(
    blocks: BlockMap,
    edges: Sequence[float],
    threshold: float,
    intensity_step: float,
    places: Places,
    intervals: NDArray[np.uint8],
) -> None:
    """Divide some blocks, and tell in which interval the mean of each leaf lies.

    Parameters
    ----------
    blocks : BlockMap
        Its R are known where `undecided_at` says so.
    edges : sequence of float
        Between the intervals, increasing, 254 at most; a mean on an edge lies in the interval below it.
    threshold, intensity_step : float
        X and tau.
    places : (n, 2) int64 array
    intervals : (8 B, 8 C) uint8 array
        Filled in at the cells of these blocks: from 1; 0 where a leaf has no valid pixel.
    """
    side, mean = np.empty(blocks.counts.shape, np.uint8), np.empty(blocks.counts.shape)
    where = (blocks.sums, blocks.counts, blocks.ratios, threshold, intensity_step)
    _decide(*where, np.array(edges, np.float64), places, side, mean, intervals)


@kernel("void(u2[:,::1], i8[:,::1], u4[:,::1])")
def _sum_cells(grey, places, sums):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        for row in range(8 * places[k, 0], 8 * places[k, 0] + 8):
            for col in range(8 * places[k, 1], 8 * places[k, 1] + 8):
                total = np.uint32(0)
                for r in range(8 * row + 1, 8 * row + 9):
                    for c in range(8 * col + 1, 8 * col + 9):
                        total += np.uint32(grey[r, c])
                sums[row, col] = total


@kernel("void(u4[:,::1], u1[:,::1], f8[::1], f8, i8[:,::1], u4[::1])")
def _undecided_at(sums, counts, edges, step, places, found):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        found[k] = undecided_in_block(sums, counts, places[k, 0], places[k, 1], edges, step)


@kernel("void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, f8[::1], i8[:,::1], u1[:,::1], f8[:,::1], u1[:,::1])")
def _decide(sums, counts, ratios, threshold, step, edges, places, side, mean, intervals):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        row, col = places[k, 0], places[k, 1]
        leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)
        for r in range(8):
            for c in range(8):
                value = mean[8 * row + r, 8 * col + c]
                interval = np.uint8(value >= 0.0)
                for edge in edges:
                    interval += np.uint8(edge < value)
                intervals[8 * row + r, 8 * col + c] = interval
