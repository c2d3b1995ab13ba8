"""Incremental division: the kernels of the block map, applied to some of its blocks only."""

from math import inf

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.segmentation.blocks.block_map import BlockMap, leaves_of_block, mean_v, required_ratios_of_block
from uavseg.segmentation.pipeline import LeafQuery

BlockIndices = NDArray[np.int64]
LeafArrays = tuple[NDArray[np.uint8], NDArray[np.float64]]


def required_ratios_at(blocks: BlockMap, query: LeafQuery, indices: BlockIndices) -> NDArray[np.uint32]:
    """Which R of some blocks must be known to answer a query, see `block_map`.

    Parameters
    ----------
    blocks : BlockMap
    query : LeafQuery
    indices : (n, 2) int64 array
        Row and column of each block.

    Returns
    -------
    required : (n,) uint32 array
        One bit per R.
    """
    required = np.empty(len(indices), np.uint32)
    edges = np.array(query.edges, np.float64)
    _required_ratios(blocks.sums, blocks.counts, edges, query.division.step, indices, required)
    return required


def classify_leaves(
    blocks: BlockMap,
    query: LeafQuery,
    indices: BlockIndices,
    required: NDArray[np.uint32],
    scratch: LeafArrays,
    intervals: NDArray[np.uint8],
) -> None:
    """Divide some blocks into leaves and write the interval in which the mean of each leaf lies.

    Parameters
    ----------
    blocks : BlockMap
        Its R are known where `required_ratios_at` asks for them.
    query : LeafQuery
        Edges between the intervals, increasing, 254 at most; a mean on an edge lies in the interval below it.
        Threshold and step of the division.
    indices : (n, 2) int64 array
        Row and column of each block.
    required : (n,) uint32 array
        Of these blocks, from `required_ratios_at`.
    scratch : (8 B, 8 C) uint8 and float64 arrays
        Side and mean of the leaves.
    intervals : (8 B, 8 C) uint8 array
        Set at the cells of these blocks: counted from 1; 0 where a cell has no valid pixel.
    """
    division = (blocks.sums, blocks.counts, blocks.ratios, query.division.threshold, query.division.step)
    edges = np.array(query.edges, np.float64)
    _classify_leaves(*division, edges, indices, required, *scratch, intervals)


@kernel("void(u4[:,::1], u1[:,::1], f8[::1], f8, i8[:,::1], u4[::1])")
def _required_ratios(sums, counts, edges, step, indices, required):  # type: ignore[no-untyped-def]
    for k in range(indices.shape[0]):
        row, col = max(indices[k, 0], 0), max(indices[k, 1], 0)
        required[k] = required_ratios_of_block(sums, counts, row, col, edges, step)


_CLASSIFY = (
    "void(u4[:,::1], u1[:,::1], f8[:,:,::1], f8, f8, f8[::1], i8[:,::1], u4[::1], "
    "u1[:,::1], f8[:,::1], u1[:,::1])"
)


@inlined
def index_of_interval(value, edges):  # type: ignore[no-untyped-def]
    """Interval in which a mean lies, counted from 1; 0 for the -1 of a leaf without a valid pixel."""
    interval = np.uint8(value >= 0.0)
    for edge in edges:
        interval += np.uint8(edge < value)
    return interval


@kernel(_CLASSIFY)
def _classify_leaves(  # type: ignore[no-untyped-def]
    sums, counts, ratios, threshold, step, edges, indices, required, side, mean, intervals
):
    for k in range(indices.shape[0]):
        row, col = max(indices[k, 0], 0), max(indices[k, 1], 0)  # lets the compiler see that they are not < 0
        if required[k] == 0 and step == inf:  # all cells lie in one interval, whatever the division
            one = index_of_interval(mean_v(sums, counts, 8 * row, 8 * col, 8), edges)
            for r in range(8):
                for c in range(8):
                    is_valid = np.uint8(counts[8 * row + r, 8 * col + c] > 0)
                    intervals[8 * row + r, 8 * col + c] = one * is_valid
            continue
        leaves_of_block(sums, counts, ratios, threshold, step, row, col, side, mean)
        for r in range(8 * row, 8 * row + 8):
            for c in range(8 * col, 8 * col + 8):
                intervals[r, c] = index_of_interval(mean[r, c], edges) * np.uint8(counts[r, c] > 0)
