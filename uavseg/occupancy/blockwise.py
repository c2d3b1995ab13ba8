"""Parts of a block map measured and decided again: what `blockmap` does for all blocks, for some of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.raster.tiling import BLOCK
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
    _sum_cells(grey, places, sums, np.empty(BLOCK, np.uint32))


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
    leaves: tuple[NDArray[np.uint8], NDArray[np.float64]],
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
    leaves : (8 B, 8 C) uint8 and float64 arrays
        Side and mean of each cell's leaf, filled in as well; see `blockmap.leaves`.
    intervals : (8 B, 8 C) uint8 array
        Filled in at the cells of these blocks: from 1; 0 where a leaf has no valid pixel.
    """
    where = (blocks.sums, blocks.counts, blocks.ratios, threshold, intensity_step)
    _decide(*where, np.array(edges, np.float64), places, *leaves, intervals)


@kernel("void(u2[:,::1], i8[:,::1], u4[:,::1], u4[::1])")
def _sum_cells(grey, places, sums, column):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        top, left = max(places[k, 0], 0), max(places[k, 1], 0)  # they are; the compiler does not know
        for row in range(8):
            for c in range(BLOCK):
                column[c] = 0
            for r in range(8):
                line = grey[BLOCK * top + 8 * row + r + 1, BLOCK * left + 1 :]
                for c in range(BLOCK):
                    column[c] += np.uint32(line[c])
            for col in range(8):
                total = np.uint32(0)
                for c in range(8):
                    total += column[8 * col + c]
                sums[8 * top + row, 8 * left + col] = total


@kernel("void(u4[:,::1], u1[:,::1], f8[::1], f8, i8[:,::1], u4[::1])")
def _undecided_at(sums, counts, edges, step, places, found):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        row, col = max(places[k, 0], 0), max(places[k, 1], 0)
        found[k] = undecided_in_block(sums, counts, row, col, edges, step)


@kernel(
    "void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, f8[::1], i8[:,::1], u1[:,::1], f8[:,::1], u1[:,::1])"
)
def _decide(sums, counts, ratios, threshold, step, edges, places, side, mean, intervals):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        row, col = max(places[k, 0], 0), max(places[k, 1], 0)
        leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)
        for r in range(8):
            for c in range(8):
                value = mean[8 * row + r, 8 * col + c]
                interval = np.uint8(value >= 0.0)
                for edge in edges:
                    interval += np.uint8(edge < value)
                intervals[8 * row + r, 8 * col + c] = interval
