"""Thin lines of 1 to 3 pixels by curvilinear evidence: sums along short oriented lines, against both sides.

A matched filter for lines (Chaudhuri et al., IEEE Trans. Med. Imaging 8 (1989) 263-269) as a test: a pixel is
on a line where, in one of 16 directions, the mean of 15 pixels along it lies in the range, those of both
sides lie out of it on the same side, and their difference is significant. The spread of the difference by
chance is measured in squares of 16 pixels, so that grain and texture count as noise. Evidence of less
significance counts where it continues a line within 8 pixels of strong evidence.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.dataclass import dataclass
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.refine.noise import NOISE_SIDE, medians_around

LENGTH = 15  # pixels along a line
_DIRECTIONS = 16
_SIDES = (3, 4)  # pixels from the middle of a line to what it is compared with
_STRONG, _WEAK = 4.5, 2.5  # standard deviations of the difference
_REACH = 8  # pixels that weak evidence continues strong evidence
_MIN_NOISE = 74.0  # grey: standard deviation of rounding to 8 bits
_MEASURED = range(0, 16, 4)  # directions in which noise is measured
_INVALID = 1 << 24  # grey of invalid pixels, more than any sum of valid ones
MARGIN = 48  # pixels around a window that count: two squares, a line and a side

Offsets = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ThinLines:
    """Addition of thin lines to refined regions; it needs no more pixels around a tile than refinement."""

    halo: int = 0


def find_thin_lines(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], greys: tuple[int, int], margin: int
) -> NDArray[np.uint8]:
    """Detect the pixels on thin lines in a range of `greys`, whose ends belong to it.

    `grey` and `valid` are (M, N), multiples of 16, as is the position of the first pixel in its raster.
    `margin` is the number of pixels on every side that are context alone, a multiple of 16 and at least 48.
    The result, (M − 2 margin + 96, N − 2 margin + 96), is 1 on lines; exact on the part within the margin and
    a border of one pixel.
    """
    skipped = margin - MARGIN
    inner = slice(skipped, -skipped or None)
    values = grey[inner, inner].astype(np.int32)
    values[valid[inner, inner] == 0] = _INVALID
    evidence, sums = np.zeros(values.shape, np.uint8), np.zeros(values.shape, np.int32)
    spread = _spread(values, sums)
    weak, strong = (np.floor(z * spread).astype(np.int32) for z in (_WEAK, _STRONG))
    for k in range(_DIRECTIONS):
        along, sides = _offsets(math.pi * k / _DIRECTIONS)
        _sum_lines(values, along, sums)
        _add_evidence(sums, sides, greys[0], greys[1], weak, strong, evidence)
    lines: NDArray[np.uint8] = evidence >> np.uint8(1)
    for _ in range(_REACH):
        lines = dilate(lines) & (evidence & np.uint8(1))
    return _joined(lines, values, greys)


def _spread(values: NDArray[np.int32], sums: NDArray[np.int32]) -> NDArray[np.float64]:
    """Estimate the standard deviation of twice the sum of a line less that of a side, for each square.

    It follows from the median over 3 x 3 squares of the mean |difference|, which few lines do not change.
    """
    shape = values.shape[0] // NOISE_SIDE, values.shape[1] // NOISE_SIDE
    totals, counts = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    for k in _MEASURED:
        along, sides = _offsets(math.pi * k / _DIRECTIONS)
        _sum_lines(values, along, sums)
        _add_differences(sums, sides, totals, counts)
    means = np.where(counts > 0, totals / np.maximum(counts, 1), -1.0)
    spread = math.sqrt(math.pi / 2) * medians_around(means, np.ones(shape, np.uint8))
    return np.maximum(spread, _MIN_NOISE * math.sqrt(4 * LENGTH + 2 * LENGTH))


def _joined(lines: NDArray[np.uint8], values: NDArray[np.int32], greys: tuple[int, int]) -> NDArray[np.uint8]:
    """Add a pixel at each diagonal step, the nearer to the range, so that the pixels of lines share edges."""
    distance = np.maximum(np.maximum(greys[0] - values, values - greys[1]), 0)
    joined = lines.copy()
    first, last = slice(None, -1), slice(1, None)
    for here, there, one, other in (
        ((first, first), (last, last), (first, last), (last, first)),
        ((first, last), (last, first), (first, first), (last, last)),
    ):
        step = (lines[here] & lines[there] & ~(lines[one] | lines[other])) > 0
        step &= np.minimum(values[one], values[other]) < _INVALID
        by_one = distance[one] <= distance[other]
        joined[one] |= step & by_one
        joined[other] |= step & ~by_one
    return joined


def _offsets(angle: float) -> tuple[Offsets, Offsets]:
    """Return row and column offsets of the pixels of a line in a direction, and of two on each side of it."""
    down, across = math.sin(angle), math.cos(angle)
    half = range(-(LENGTH // 2), LENGTH // 2 + 1)
    if abs(across) >= abs(down):
        along = [(math.floor(t * down / across + 0.5), t) for t in half]
    else:
        along = [(t, math.floor(t * across / down + 0.5)) for t in half]
    sides = [
        (math.floor(side * far * across + 0.5), math.floor(-side * far * down + 0.5))
        for side in (1, -1)
        for far in _SIDES
    ]
    return np.array(along, np.int64), np.array(sides, np.int64)


@kernel("void(i4[:,::1], i8[:,::1], i4[:,::1])")
def _sum_lines(values, offsets, sums):  # type: ignore[no-untyped-def]
    reach = 8
    for row in range(reach, sums.shape[0] - reach):
        sums[row, :] = 0
        for k in range(offsets.shape[0]):
            r = row + offsets[k, 0]
            shift = offsets[k, 1]
            for col in range(reach, sums.shape[1] - reach):
                sums[row, col] += values[r, col + shift]


@kernel("void(i4[:,::1], i8[:,::1], i8[:,::1], i8[:,::1])")
def _add_differences(sums, sides, totals, counts):  # type: ignore[no-untyped-def]
    reach = 13
    for row in range(reach, sums.shape[0] - reach):
        for square in range(totals.shape[1]):
            total = np.int64(0)
            count = np.int64(0)
            for col in range(max(16 * square, reach), min(16 * square + 16, sums.shape[1] - reach)):
                line = sums[row, col]
                side = sums[row + sides[0, 0], col + sides[0, 1]] + sums[row + sides[1, 0], col + sides[1, 1]]
                known = line < 16777216 and side < 16777216
                total += abs(2 * line - side) if known else 0
                count += 1 if known else 0
            totals[row // 16, square] += total
            counts[row // 16, square] += count


@kernel("void(i4[:,::1], i8[:,::1], i8, i8, i4[:,::1], i4[:,::1], u1[:,::1])")
def _add_evidence(sums, sides, low, high, weak, strong, evidence):  # type: ignore[no-untyped-def]
    reach = 13
    minimum = np.int32(15 * low)
    maximum = np.int32(15 * high)
    for row in range(reach, sums.shape[0] - reach):
        for square in range(weak.shape[1]):
            weak_limit = weak[row // 16, square]
            strong_limit = strong[row // 16, square]
            for col in range(max(16 * square, reach), min(16 * square + 16, sums.shape[1] - reach)):
                line = sums[row, col]
                if minimum <= line <= maximum:
                    one = sums[row + sides[0, 0], col + sides[0, 1]]
                    one += sums[row + sides[1, 0], col + sides[1, 1]]
                    two = sums[row + sides[2, 0], col + sides[2, 1]]
                    two += sums[row + sides[3, 0], col + sides[3, 1]]
                    nearer = min(one, two)
                    farther = max(one, two)
                    if farther < 16777216:
                        contrast = np.int32(-1)
                        if nearer > 2 * maximum:
                            contrast = nearer - 2 * line
                        elif farther < 2 * minimum:
                            contrast = 2 * line - farther
                        if contrast > weak_limit:
                            evidence[row, col] |= np.uint8(3) if contrast > strong_limit else np.uint8(1)
