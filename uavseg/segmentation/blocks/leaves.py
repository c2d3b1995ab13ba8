"""Thresholding of leaf means: the cells in a range, and the state, level or class of each cell."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.arrays import Integers, Uint8s, Uint16s
from uavseg.segmentation.blocks.block_map import BlockMap, leaf_means_by_strip
from uavseg.segmentation.params.segment import DivisionParams, IntensityRange, Partition
from uavseg.units import GREY_LEVELS, GREY_MAX

STEPS = 1000
NO_CODE = 65535


def cell_intervals(
    blocks: BlockMap, edges: Sequence[float], division: DivisionParams, dtype: Any = np.uint8
) -> NDArray[Any]:
    """Return the interval of each cell, counted from 1: that of the mean of its leaf.

    It is 0 where the leaf has no valid pixel. The edges between the intervals increase; a mean on an edge
    lies in the interval below it. `dtype` is that of the (8 B, 8 C) array, an unsigned integer type that
    holds the number of intervals.
    """
    bounds = np.array([-0.5, *edges])  # a leaf without valid pixels has the mean -1
    intervals = np.empty(blocks.counts.shape, dtype)
    for rows, mean in leaf_means_by_strip(blocks, division):
        intervals[rows] = np.searchsorted(bounds, mean)
    return intervals


def cells_in_range(blocks: BlockMap, interval: IntensityRange, division: DivisionParams) -> Uint8s:
    """Return the cells of the leaves whose mean lies in a range: an (8 B, 8 C) uint8 array, 1 in range."""
    inside = np.zeros(blocks.counts.shape, np.uint8)
    for rows, mean in leaf_means_by_strip(blocks, division):
        inside[rows] = (mean >= interval.low) & (mean <= interval.high)
    return inside


def cell_classes(blocks: BlockMap, partition: Partition, division: DivisionParams) -> NDArray[Any]:
    """Return the class of each cell: that of the interval in which the mean of its leaf lies.

    The array is (8 B, 8 C), 0 for no class and where the leaf has no valid pixel; uint8 up to 255 intervals,
    else uint32.
    """
    dtype = np.uint8 if len(partition.classes) < 256 else np.uint32
    table = np.array([0, *partition.classes], dtype)
    return np.asarray(table[cell_intervals(blocks, partition.edges, division, dtype)])


def cells_to_pixels(cells: NDArray[Any], valid: Uint8s) -> NDArray[Any]:
    """Upsample cells to pixels: each valid pixel gets the value of its cell, others 0.

    `cells` is an (m, n) uint8 or uint32 array, `valid` (8 m, 8 n), as the result is.
    """
    pixels = np.empty(valid.shape, cells.dtype)
    upsample = _upsample_u1 if cells.dtype == np.uint8 else _upsample_u4
    upsample(cells, valid, pixels)
    return pixels


def pixels_in_range(grey: Uint16s, valid: Uint8s, low: int, high: int) -> Uint8s:
    """Return the valid pixels whose grey lies in low..high, both ends included, see `IntensityRange.greys`.

    All arrays are (M, N); `low` is larger than `high` where no grey lies in the range.
    """
    in_range = np.empty_like(valid)
    _pixels_in_range(grey.reshape(-1), valid.reshape(-1), low, high, in_range.reshape(-1))
    return in_range


def pixel_classes(grey: Uint16s, valid: Uint8s, table: Uint8s) -> Uint8s:
    """Return the class of each pixel's grey by a (65536,) table, 0 where not valid; all others are (M, N)."""
    classes = np.empty_like(valid)
    _pixel_classes(grey.reshape(-1), valid.reshape(-1), table, classes.reshape(-1))
    return classes


def _upsample(cells, valid, pixels):  # type: ignore[no-untyped-def]
    for r in range(pixels.shape[0]):
        for cell in range(cells.shape[1]):
            value = cells[r // 8, cell]
            for c in range(8 * cell, 8 * cell + 8):
                pixels[r, c] = value if valid[r, c] else 0


_upsample_u1 = kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")(_upsample)
_upsample_u4 = kernel("void(u4[:,::1], u1[:,::1], u4[:,::1])")(_upsample)


@kernel("void(u2[::1], u1[::1], i8, i8, u1[::1])")
def _pixels_in_range(grey, valid, low, high, in_range):  # type: ignore[no-untyped-def]
    minimum, maximum = np.uint16(max(low, 0)), np.uint16(max(high, 0))
    for i in range(grey.size):
        in_range[i] = np.uint8(grey[i] >= minimum) & np.uint8(grey[i] <= maximum) & valid[i]


def histogram_of_means(blocks: BlockMap, division: DivisionParams) -> Integers:
    """Count the valid pixels by the grey that is nearest to the mean of their leaf: (65536,) int64.

    Histograms of parts of a raster merge by adding.
    """
    histogram = np.zeros(GREY_LEVELS, np.int64)
    for rows, mean in leaf_means_by_strip(blocks, division):
        greys = np.floor(np.maximum(mean, 0.0) * GREY_MAX + 0.5).astype(np.int64)
        counts = np.bincount(greys.reshape(-1), blocks.counts[rows].reshape(-1), GREY_LEVELS)
        histogram += counts.astype(np.int64)
    return histogram


def means_among(blocks: BlockMap, values: Sequence[float], division: DivisionParams) -> set[float]:
    """Return the values of v that are exactly equal to the mean of a leaf."""
    means: set[float] = set()
    for _, mean in leaf_means_by_strip(blocks, division):
        means.update(value for value in values if value not in means and (mean == value).any())
    return means


def leaf_codes(blocks: BlockMap, division: DivisionParams) -> Uint16s:
    """Quantise the mean of each cell's leaf by the steps k / 1000 of a slider, without loss.

    The mean lies in low / 1000 .. high / 1000, both ends included, exactly where the code lies in 2 low .. 2
    high. The codes, (8 B, 8 C) uint16, are 2 k where the mean equals k / 1000, 2 k + 1 where it lies between
    k / 1000 and (k + 1) / 1000, 65535 where the leaf has no valid pixel.
    """
    steps = np.arange(STEPS + 1) / STEPS  # the doubles that texts such as "0.553" are read as
    codes = np.empty(blocks.counts.shape, np.uint16)
    for rows, mean in leaf_means_by_strip(blocks, division):
        below = np.searchsorted(steps, mean, side="left")
        reached = np.searchsorted(steps, mean, side="right")
        codes[rows] = np.where(mean < 0, NO_CODE, below + reached - 1)
    return codes


@kernel("void(u2[::1], u1[::1], u1[::1], u1[::1])")
def _pixel_classes(grey, valid, table, classes):  # type: ignore[no-untyped-def]
    for k in range(grey.size):
        classes[k] = table[grey[k]] & (np.uint8(0) - valid[k])
