"""Parts of a block map decided again: what `blockmap` does for all blocks, for some of them."""

from collections.abc import Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.block_map import BlockMap, leaves_of_block, mean_v, required_ratios_of_block

Places = NDArray[np.int64]


def undecided_at(
    blocks: BlockMap, edges: Sequence[float], intensity_step: float, places: Places
) -> NDArray[np.uint32]:
    """Which R must be known of some blocks, see `block_map.required_ratios`.

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
    bits: NDArray[np.uint32],
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
    bits : (n,) uint32 array
        Of these blocks, from `undecided_at`.
    leaves : (8 B, 8 C) uint8 and float64 arrays
        Scratch.
    intervals : (8 B, 8 C) uint8 array
        Filled in at the cells of these blocks: from 1; 0 where a cell has no valid pixel.
    """
    where = (blocks.sums, blocks.counts, blocks.ratios, threshold, intensity_step)
    _decide(*where, np.array(edges, np.float64), places, bits, *leaves, intervals)


@kernel("void(u4[:,::1], u1[:,::1], f8[::1], f8, i8[:,::1], u4[::1])")
def _undecided_at(sums, counts, edges, step, places, found):  # type: ignore[no-untyped-def]
    for k in range(places.shape[0]):
        row, col = max(places[k, 0], 0), max(places[k, 1], 0)
        found[k] = required_ratios_of_block(sums, counts, row, col, edges, step)


_DECIDE = (
    "void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, f8[::1], i8[:,::1], u4[::1], "
    "u1[:,::1], f8[:,::1], u1[:,::1])"
)


@inlined
def interval_of(value, edges):  # type: ignore[no-untyped-def]
    """In which interval a mean lies, from 1; 0 for the -1 of a leaf without a valid pixel."""
    interval = np.uint8(value >= 0.0)
    for edge in edges:
        interval += np.uint8(edge < value)
    return interval


@kernel(_DECIDE)
def _decide(  # type: ignore[no-untyped-def]
    sums, counts, ratios, threshold, step, edges, places, bits, side, mean, intervals
):
    for k in range(places.shape[0]):
        row, col = max(places[k, 0], 0), max(places[k, 1], 0)  # they are; the compiler does not know
        if bits[k] == 0 and step == inf:  # all cells lie in one interval, however the block is divided
            one = interval_of(mean_v(sums, counts, 8 * row, 8 * col, 8), edges)
            for r in range(8):
                for c in range(8):
                    there = np.uint8(counts[8 * row + r, 8 * col + c] > 0)
                    intervals[8 * row + r, 8 * col + c] = one * there
            continue
        leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)
        for r in range(8 * row, 8 * row + 8):
            for c in range(8 * col, 8 * col + 8):
                intervals[r, c] = interval_of(mean[r, c], edges) * np.uint8(counts[r, c] > 0)
