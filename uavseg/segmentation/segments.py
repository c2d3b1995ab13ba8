"""Which leaves, and which pixels, belong together: by a range of intensity, by state, by level.

Each of them cuts 0..1 at some edges. A value on an edge belongs to the interval below it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.segmentation.blockmap import FULL, BlockMap, strips_of_means

FREE, UNKNOWN, OCCUPIED = 1, 2, 3

_MOST_LEVELS = 65535  # v has 65536 values


class Cut(Protocol):
    """What cuts 0..1 into intervals."""

    @property
    def edges(self) -> tuple[float, ...]:
        """Where it is cut, increasing; an edge belongs to the interval below it."""


@dataclass(frozen=True, slots=True)
class IntensityRange:
    """An interval of v with both ends in it.

    Raises
    ------
    IntensityRangeError
        If not 0 <= low < high <= 1.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high <= 1:
            raise IntensityRangeError(
                f"an intensity range wants 0 <= low < high <= 1, not {self.low:g},{self.high:g}"
            )

    @property
    def edges(self) -> tuple[float, float]:
        """Edges of what lies below the range, in it and above it."""
        return math.nextafter(self.low, -1.0), self.high

    @property
    def greys(self) -> tuple[int, int]:
        """The smallest and the largest grey g whose v = g / 65535 lies in the range."""
        low, high = max(math.ceil(self.low * FULL) - 1, 0), min(math.floor(self.high * FULL) + 1, FULL)
        while low / FULL < self.low:
            low += 1
        while high / FULL > self.high:
            high -= 1
        return low, high


@dataclass(frozen=True, slots=True)
class StateLimits:
    """What probability of being occupied makes a cell free, unknown or occupied: the paper's limits.

    Parameters
    ----------
    free_below : float
        Up to here, and here too, a cell is free.
    occupied_above : float
        Above here it is occupied; here, and down to the other limit, unknown.

    Raises
    ------
    ParameterError
        If not 0 <= free_below < occupied_above <= 1.

    Examples
    --------
    >>> StateLimits().of([0.2, 0.498, 0.5, 0.502, 0.503])
    array([1, 1, 2, 2, 3], dtype=uint8)
    """

    free_below: float = 0.498
    occupied_above: float = 0.502

    def __post_init__(self) -> None:
        if not 0 <= self.free_below < self.occupied_above <= 1:
            raise ParameterError(
                "the limits of the states want 0 <= free below < occupied above <= 1, "
                f"not {self.free_below:g} and {self.occupied_above:g}"
            )

    @property
    def edges(self) -> tuple[float, float]:
        """The two limits."""
        return self.free_below, self.occupied_above

    def of(self, v: Any) -> NDArray[np.uint8]:
        """The state of each probability: 1 free, 2 unknown, 3 occupied."""
        states: NDArray[np.uint8] = (np.searchsorted(self.edges, v) + FREE).astype(np.uint8)
        return states

    @property
    def table(self) -> NDArray[np.uint8]:
        """The state of every grey g, whose v = g / 65535: a (65536,) uint8 array."""
        return self.of(np.arange(FULL + 1) / FULL)


@dataclass(frozen=True, slots=True)
class Levels:
    """0..1 cut into levels of equal width, the last of which may be narrower.

    Parameters
    ----------
    width : float
        P. Level k, from 0, is what lies above k P and not above (k + 1) P; level 0 has 0 too.

    Raises
    ------
    ParameterError
        If the width is not above 0 and at most 1, or so small that there would be more levels than greys.

    Examples
    --------
    >>> Levels(0.3).bounds
    (0.0, 0.3, 0.6, 0.9, 1.0)
    """

    width: float

    def __post_init__(self) -> None:
        if not 0 < self.width <= 1:
            raise ParameterError(f"the width of a level is above 0 and at most 1, not {self.width:g}")
        if 1 / self.width > _MOST_LEVELS:
            raise ParameterError(
                f"levels of {self.width:g} are finer than grey is, which has {_MOST_LEVELS + 1} values; "
                "give a larger width"
            )

    @property
    def count(self) -> int:
        """Number of levels."""
        return math.ceil(1 / self.width - 1e-9)

    @property
    def edges(self) -> tuple[float, ...]:
        """The edges between levels."""
        return tuple(round(k * self.width, 12) for k in range(1, self.count))

    @property
    def bounds(self) -> tuple[float, ...]:
        """The edges with 0 and 1: level k lies between bounds k and k + 1."""
        return (0.0, *self.edges, 1.0)


def states_of(
    blocks: BlockMap, limits: StateLimits, threshold: float, intensity_step: float
) -> NDArray[np.uint8]:
    """The state of each cell: that of the mean of the leaf which it lies in.

    Parameters
    ----------
    blocks : BlockMap
    limits : StateLimits
    threshold, intensity_step : float
        X and tau of the division, see `blockmap.leaves`; an infinite tau is the paper's method.

    Returns
    -------
    states : (8 B, 8 C) uint8 array
        1 free, 2 unknown, 3 occupied; 0 where the leaf has no valid pixel.
    """
    return intervals_of(blocks, limits.edges, threshold, intensity_step)


def levels_of(
    blocks: BlockMap, levels: Levels, threshold: float, intensity_step: float
) -> NDArray[np.uint8] | NDArray[np.uint32]:
    """The level of each cell, counted from 1: that of the mean of the leaf which it lies in.

    Parameters
    ----------
    blocks : BlockMap
    levels : Levels
    threshold, intensity_step : float
        As of `states_of`.

    Returns
    -------
    levels : (8 B, 8 C) array
        0 where the leaf has no valid pixel; uint8 where 255 levels are enough, else uint32.
    """
    dtype = np.uint8 if levels.count < 256 else np.uint32
    return intervals_of(blocks, levels.edges, threshold, intensity_step, dtype)


def intervals_of(
    blocks: BlockMap,
    edges: Sequence[float],
    threshold: float,
    intensity_step: float,
    dtype: Any = np.uint8,
) -> NDArray[Any]:
    """The interval of each cell, counted from 1: that of the mean of the leaf which it lies in.

    Parameters
    ----------
    blocks : BlockMap
    edges : sequence of float
        Between the intervals, increasing; a mean on an edge lies in the interval below it.
    threshold, intensity_step : float
        As of `states_of`.
    dtype
        An unsigned integer that holds the number of intervals.

    Returns
    -------
    intervals : (8 B, 8 C) array
        0 where the leaf has no valid pixel.
    """
    bounds = np.array([-0.5, *edges])  # a leaf without valid pixels has the mean -1
    found = np.empty(blocks.counts.shape, dtype)
    for rows, mean in strips_of_means(blocks, threshold, intensity_step):
        found[rows] = np.searchsorted(bounds, mean)
    return found


def in_range(
    blocks: BlockMap, interval: IntensityRange, threshold: float, intensity_step: float
) -> NDArray[np.uint8]:
    """Cells of the leaves whose mean lies in a range.

    Parameters
    ----------
    blocks : BlockMap
    interval : IntensityRange
    threshold, intensity_step : float
        X and tau of the division, see `blockmap.leaves`.

    Returns
    -------
    inside : (8 B, 8 C) uint8 array, 1 in range
    """
    inside = np.zeros(blocks.counts.shape, np.uint8)
    for rows, mean in strips_of_means(blocks, threshold, intensity_step):
        inside[rows] = (mean >= interval.low) & (mean <= interval.high)
    return inside


def pixels_of(cells: NDArray[Any], valid: NDArray[np.uint8]) -> NDArray[Any]:
    """What cells hold, at their valid pixels.

    Parameters
    ----------
    cells : (m, n) uint8 or uint32 array
        Such as 1 where a cell is in range.
    valid : (8 m, 8 n) uint8 array

    Returns
    -------
    pixels : (8 m, 8 n) array of the type of the cells
        0 where a pixel is not valid.
    """
    pixels = np.empty(valid.shape, cells.dtype)
    spread = _spread_u1 if cells.dtype == np.uint8 else _spread_u4
    spread(cells, valid, pixels)
    return pixels


def matching(grey: NDArray[np.uint16], valid: NDArray[np.uint8], low: int, high: int) -> NDArray[np.uint8]:
    """The valid pixels whose own grey lies in low..high, both ends in it.

    Parameters
    ----------
    grey : (M, N) uint16 array
    valid : (M, N) uint8 array
    low, high : int
        See `IntensityRange.greys`; low is larger than high where no grey lies in the range.

    Returns
    -------
    matching : (M, N) uint8 array
    """
    fits = np.empty_like(valid)
    _match(grey.reshape(-1), valid.reshape(-1), low, high, fits.reshape(-1))
    return fits


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _spread_u1(cells, valid, pixels):  # type: ignore[no-untyped-def]
    for r in range(pixels.shape[0]):
        for cell in range(cells.shape[1]):
            own = cells[r // 8, cell]
            for c in range(8 * cell, 8 * cell + 8):
                pixels[r, c] = own & (np.uint8(0) - valid[r, c])  # faster than a product of bytes


@kernel("void(u4[:,::1], u1[:,::1], u4[:,::1])")
def _spread_u4(cells, valid, pixels):  # type: ignore[no-untyped-def]
    for r in range(pixels.shape[0]):
        for cell in range(cells.shape[1]):
            own = cells[r // 8, cell]
            for c in range(8 * cell, 8 * cell + 8):
                pixels[r, c] = own * valid[r, c]


@kernel("void(u2[::1], u1[::1], i8, i8, u1[::1])")
def _match(grey, valid, low, high, fits):  # type: ignore[no-untyped-def]
    least = np.uint16(max(low, 0))
    most = np.uint16(max(high, 0))
    for i in range(grey.size):
        fits[i] = np.uint8(grey[i] >= least) & np.uint8(grey[i] <= most) & valid[i]
