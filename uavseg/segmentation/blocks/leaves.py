"""Leaves by interval: cells in a range, state or level; leaf means."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.blocks.block_map import BlockMap, leaf_means_by_strip
from uavseg.segmentation.params.partition import Breaks, Partition, partition_of_levels
from uavseg.segmentation.params.segment import DivisionParams, IntensityRange, Levels, StateLimits
from uavseg.units import GREY_LEVELS, GREY_MAX


def cell_states(blocks: BlockMap, limits: StateLimits, division: DivisionParams) -> NDArray[np.uint8]:
    """The state of each cell: that of the mean of its leaf.

    Parameters
    ----------
    blocks : BlockMap
    limits : StateLimits
    division : DivisionParams

    Returns
    -------
    states : (8 B, 8 C) uint8 array
        1 free, 2 unknown, 3 occupied; 0 where the leaf has no valid pixel.
    """
    return cell_intervals(blocks, limits.edges, division)


def cell_levels(
    blocks: BlockMap, levels: Levels | Breaks, division: DivisionParams
) -> NDArray[np.uint8] | NDArray[np.uint32]:
    """The level of each cell, counted from 1: that of the mean of its leaf.

    Parameters
    ----------
    blocks : BlockMap
    levels : Levels or Breaks
    division : DivisionParams

    Returns
    -------
    levels : (8 B, 8 C) array
        0 where the leaf has no valid pixel; uint8 up to 255 levels, else uint32.
    """
    return cell_kinds(blocks, partition_of_levels(levels), division)


def cell_intervals(
    blocks: BlockMap, edges: Sequence[float], division: DivisionParams, dtype: Any = np.uint8
) -> NDArray[Any]:
    """The interval of each cell, counted from 1: that of the mean of its leaf.

    Parameters
    ----------
    blocks : BlockMap
    edges : sequence of float
        Edges between the intervals, increasing; a mean on an edge lies in the interval below it.
    division : DivisionParams
    dtype
        An unsigned integer type that holds the number of intervals.

    Returns
    -------
    intervals : (8 B, 8 C) array
        0 where the leaf has no valid pixel.
    """
    bounds = np.array([-0.5, *edges])  # a leaf without valid pixels has the mean -1
    intervals = np.empty(blocks.counts.shape, dtype)
    for rows, mean in leaf_means_by_strip(blocks, division):
        intervals[rows] = np.searchsorted(bounds, mean)
    return intervals


def cells_in_range(blocks: BlockMap, interval: IntensityRange, division: DivisionParams) -> NDArray[np.uint8]:
    """Cells of the leaves whose mean lies in a range.

    Parameters
    ----------
    blocks : BlockMap
    interval : IntensityRange
    division : DivisionParams

    Returns
    -------
    inside : (8 B, 8 C) uint8 array, 1 in range
    """
    inside = np.zeros(blocks.counts.shape, np.uint8)
    for rows, mean in leaf_means_by_strip(blocks, division):
        inside[rows] = (mean >= interval.low) & (mean <= interval.high)
    return inside


def cell_kinds(blocks: BlockMap, partition: Partition, division: DivisionParams) -> NDArray[Any]:
    """The kind of each cell: that of the interval in which the mean of its leaf lies.

    Parameters
    ----------
    blocks : BlockMap
    partition : Partition
    division : DivisionParams

    Returns
    -------
    kinds : (8 B, 8 C) array
        0 for no kind, and where the leaf has no valid pixel; uint8 up to 255 intervals, else uint32.
    """
    dtype = np.uint8 if len(partition.kinds) < 256 else np.uint32
    return partition.of_intervals(cell_intervals(blocks, partition.edges, division, dtype))


def cells_to_pixels(cells: NDArray[Any], valid: NDArray[np.uint8]) -> NDArray[Any]:
    """Upsample cells to pixels: each valid pixel gets the value of its cell.

    Parameters
    ----------
    cells : (m, n) uint8 or uint32 array
    valid : (8 m, 8 n) uint8 array

    Returns
    -------
    pixels : (8 m, 8 n) array of the dtype of the cells
        0 where a pixel is not valid.
    """
    pixels = np.empty(valid.shape, cells.dtype)
    upsample = _upsample_u1 if cells.dtype == np.uint8 else _upsample_u4
    upsample(cells, valid, pixels)
    return pixels


def pixels_in_range(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], low: int, high: int
) -> NDArray[np.uint8]:
    """The valid pixels whose own grey lies in low..high, both ends included.

    Parameters
    ----------
    grey : (M, N) uint16 array
    valid : (M, N) uint8 array
    low, high : int
        See `IntensityRange.greys`; low is larger than high where no grey lies in the range.

    Returns
    -------
    in_range : (M, N) uint8 array
    """
    in_range = np.empty_like(valid)
    _pixels_in_range(grey.reshape(-1), valid.reshape(-1), low, high, in_range.reshape(-1))
    return in_range


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _upsample_u1(cells, valid, pixels):  # type: ignore[no-untyped-def]
    for r in range(pixels.shape[0]):
        for cell in range(cells.shape[1]):
            own = cells[r // 8, cell]
            for c in range(8 * cell, 8 * cell + 8):
                pixels[r, c] = own & (np.uint8(0) - valid[r, c])  # faster than a product of bytes


@kernel("void(u4[:,::1], u1[:,::1], u4[:,::1])")
def _upsample_u4(cells, valid, pixels):  # type: ignore[no-untyped-def]
    for r in range(pixels.shape[0]):
        for cell in range(cells.shape[1]):
            own = cells[r // 8, cell]
            for c in range(8 * cell, 8 * cell + 8):
                pixels[r, c] = own * valid[r, c]


@kernel("void(u2[::1], u1[::1], i8, i8, u1[::1])")
def _pixels_in_range(grey, valid, low, high, in_range):  # type: ignore[no-untyped-def]
    minimum = np.uint16(max(low, 0))
    maximum = np.uint16(max(high, 0))
    for i in range(grey.size):
        in_range[i] = np.uint8(grey[i] >= minimum) & np.uint8(grey[i] <= maximum) & valid[i]


def histogram_of_means(blocks: BlockMap, division: DivisionParams) -> NDArray[np.int64]:
    """Number of valid pixels by the mean grey of their leaf.

    Parameters
    ----------
    blocks : BlockMap
    division : DivisionParams

    Returns
    -------
    histogram : (65536,) int64 array
        By the grey that is nearest to the mean. Histograms of parts of a raster merge by adding.
    """
    histogram = np.zeros(GREY_LEVELS, np.int64)
    for rows, mean in leaf_means_by_strip(blocks, division):
        greys = np.floor(np.maximum(mean, 0.0) * GREY_MAX + 0.5).astype(np.int64)
        counts = np.bincount(greys.reshape(-1), blocks.counts[rows].reshape(-1), GREY_LEVELS)
        histogram += counts.astype(np.int64)
    return histogram


def means_among(blocks: BlockMap, values: Sequence[float], division: DivisionParams) -> set[float]:
    """The values that are exactly equal to the mean of a leaf.

    Parameters
    ----------
    blocks : BlockMap
    values : sequence of float
        Values of v.
    division : DivisionParams
    """
    found: set[float] = set()
    for _, mean in leaf_means_by_strip(blocks, division):
        found.update(value for value in values if value not in found and (mean == value).any())
    return found
