"""Co-occurrence histograms of the means of neighbouring cells: contrast at the border of any range."""

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.units import CELL, GREY_LEVELS, GREY_MAX

BINS = 512
_MIN_PIXELS = CELL * CELL // 2  # valid ones, of a cell that counts
_APART = 2  # cells: a border runs through the cell between
_MIN_STEP = 0.001  # of v: smaller differences are rounding or noise


@dataclass(frozen=True, slots=True)
class RangeBorder:
    """Shape and contrast of the cells of a range; a background touches the frame, objects on it do not."""

    share: float  # of the cells
    frame: float  # in the range, of cells beside the edge of the raster or nodata
    compactness: float  # pairs of neighbours both in the range, of those with one or both; 1: no border
    contrast: float  # of means across the border, two cells apart, over that on one side of it

    @property
    def score(self) -> float:
        """Figure-ground score: large for compact, closed ranges with contrast at their border."""
        return self.contrast * math.sqrt(self.compactness) * (1 - self.frame) * (1 - self.share)


@dataclass(frozen=True)
class CellPairs:
    """Co-occurrence histograms of the means of neighbouring cells, in bins of grey."""

    first: int  # grey at which the first bin begins
    width: int  # greys in each bin
    cells: Integers  # (512,): with at least 32 valid pixels, by bin
    frame: Integers  # (512,): of them, beside the edge of the raster or a cell that does not count
    near: Integers  # (512, 512): pairs side by side, along rows and columns; the darker is the row
    far: Integers  # (512, 512): two cells apart

    def bin_of(self, v: float) -> int:
        """Return the number of bins below a bound, rounded."""
        return min(max(round((v * GREY_MAX + 0.5 - self.first) / self.width), 0), BINS)

    def grey_of(self, bound: int) -> float:
        """Return the grey at which a number of bins end, halfway between two greys."""
        return self.first + bound * self.width - 0.5

    def histogram(self) -> Integers:
        """Return the histogram of cells by grey, (65536,): those of a bin at its middle."""
        histogram = np.zeros(GREY_LEVELS, np.int64)
        bins = np.flatnonzero(self.cells)
        middles = self.first + bins * self.width + (self.width - 1) // 2
        histogram[np.minimum(middles, GREY_MAX)] = self.cells[bins]  # the last bin may exceed all greys
        return histogram

    def within(self, low: int, high: int) -> "CellPairs":
        """Restrict the histograms to the cells of the bins low..high - 1."""
        inside = (np.arange(BINS) >= low) & (np.arange(BINS) < high)
        both = np.outer(inside, inside)
        cells, frame = self.cells * inside, self.frame * inside
        return replace(self, cells=cells, frame=frame, near=self.near * both, far=self.far * both)

    def border(self, low: int, high: int) -> RangeBorder:
        """Measure the range of the bins low..high - 1; raise ValueError if it holds no cell."""
        inside = self.cells[low:high].sum()
        if not inside:
            raise ValueError(f"no cell lies in the bins {low} to {high - 1}")
        (both, cross, _), (_, crossing, within), (_, steps, steps_within) = (
            _sides(sums, low, high) for sums in self._prefix_sums
        )
        min_step = _MIN_STEP * GREY_MAX / self.width
        contrast = (steps / max(crossing, 1)) / (steps_within / max(within, 1) + min_step)
        return RangeBorder(
            share=float(inside / self.cells.sum()),
            frame=float(self.frame[low:high].sum() / max(self.frame.sum(), 1)),
            compactness=float(both / max(both + cross, 1)),
            contrast=float(contrast),
        )

    def contrasts(self) -> tuple[Floats, Integers]:
        """Compute the average contrast of each bound between two bins, and the number of pairs across it.

        The contrast that a bound t detects between two means is the smaller of their distances to t; a bound
        in the middle of many steps has the largest average (Kohler, Computer Graphics and Image Processing 15
        (1981) 319-338). The contrasts, (513,) float64, are in greys, of the pairs two cells apart; 0 where
        none is across a bound. The numbers are (513,) int64.
        """
        darker, brighter = np.nonzero(self.far)
        number = self.far[darker, brighter]
        tent = np.zeros(2 * BINS + 2, np.int64)  # its second differences, at every half bin
        np.add.at(tent, 2 * darker, number)
        np.add.at(tent, darker + brighter, -2 * number)
        np.add.at(tent, 2 * brighter, number)
        sums = np.cumsum(np.cumsum(tent))  # element x + 1 less 1 for the place x
        ends = np.zeros(BINS + 1, np.int64)
        np.add.at(ends, darker + 1, number)
        np.add.at(ends, brighter + 1, -number)
        crossing = np.cumsum(ends)[: BINS + 1]
        bounds = np.arange(BINS + 1)
        detected = sums[np.maximum(2 * bounds - 2, 0)] * (bounds > 0)
        contrasts = np.where(crossing > 0, detected / np.maximum(crossing, 1), 0.0) * self.width / 2
        return contrasts, crossing

    @cached_property
    def _prefix_sums(self) -> Integers:
        """Sums of `near`, of `far` and of its steps over all pairs before each: (3, 513, 513)."""
        bins = np.arange(BINS)
        pairs = (self.near, self.far, self.far * np.abs(bins[:, None] - bins))
        sums = np.zeros((3, BINS + 1, BINS + 1), np.int64)
        for counts, of_counts in zip(pairs, sums, strict=True):
            np.cumsum(np.cumsum(counts, axis=0), axis=1, out=of_counts[1:, 1:])
        return sums


def count_cell_pairs(blocks: BlockMap) -> CellPairs | None:
    """Count the pairs of neighbouring cells of a block map; None where no cell has 32 valid pixels."""
    extent = np.array([GREY_MAX + 1, -1])
    _extent(blocks.sums, blocks.counts, extent)
    first, last = extent.tolist()
    if last < 0:
        return None
    width = -(-(last - first + 1) // BINS)
    cells, frame = np.zeros(BINS, np.int64), np.zeros(BINS, np.int64)
    near, far = np.zeros((BINS, BINS), np.int64), np.zeros((BINS, BINS), np.int64)
    _count_pairs(blocks.sums, blocks.counts, first, width, cells, frame, near, far)
    return CellPairs(first=first, width=width, cells=cells, frame=frame, near=near, far=far)


def cells_with_mean_in_range(blocks: BlockMap, interval: IntensityRange) -> Uint8s:
    """Return the cells whose own mean lies in a range, not that of their leaf: (8 B, 8 C) uint8."""
    inside = np.zeros(blocks.counts.shape, np.uint8)
    for row in range(len(inside)):
        counts = blocks.counts[row]
        mean = blocks.sums[row] / (float(GREY_MAX) * np.maximum(counts, 1))
        inside[row] = (counts > 0) & (mean >= interval.low) & (mean <= interval.high)
    return inside


def _sides(sums: Integers, low: int, high: int) -> tuple[int, int, int]:
    """Sum over the pairs with both in a range of bins, with one, and with both or none."""

    def block(a: int, b: int, c: int, d: int) -> int:
        return int(sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c])

    both = block(low, high, low, high)
    one = block(0, low, low, high) + block(low, high, high, BINS)
    return both, one, int(sums[BINS, BINS]) - one


@inlined
def _grey(sums, counts, row, col):  # type: ignore[no-untyped-def]
    """Return the mean grey of a cell, rounded down; -1 where it does not count."""
    if row < 0 or col < 0 or row >= counts.shape[0] or col >= counts.shape[1]:
        return -1
    if counts[row, col] < _MIN_PIXELS:
        return -1
    return np.int64(sums[row, col]) // np.int64(counts[row, col])


@kernel("void(u4[:,::1], u1[:,::1], i8[::1])")
def _extent(sums, counts, extent):  # type: ignore[no-untyped-def]
    for row in range(counts.shape[0]):
        for col in range(counts.shape[1]):
            grey = _grey(sums, counts, row, col)
            if grey >= 0:
                extent[0] = min(extent[0], grey)
                extent[1] = max(extent[1], grey)


@kernel("void(u4[:,::1], u1[:,::1], i8, i8, i8[::1], i8[::1], i8[:,::1], i8[:,::1])")
def _count_pairs(sums, counts, first, width, cells, frame, near, far):  # type: ignore[no-untyped-def]
    for row in range(counts.shape[0]):
        for col in range(counts.shape[1]):
            grey = _grey(sums, counts, row, col)
            if grey < 0:
                continue
            here = (grey - first) // width
            cells[here] += 1
            outer = False
            for side in range(4):
                down, right = (side == 0) - (side == 1), (side == 2) - (side == 3)
                beside = _grey(sums, counts, row + down, col + right)
                outer |= beside < 0
                if down + right != 1:
                    continue
                if beside >= 0:
                    other = (beside - first) // width
                    near[min(here, other), max(here, other)] += 1
                apart = _grey(sums, counts, row + _APART * down, col + _APART * right)
                if apart >= 0:
                    other = (apart - first) // width
                    far[min(here, other), max(here, other)] += 1
            frame[here] += outer
