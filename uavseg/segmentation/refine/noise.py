"""Local noise estimation (Immerkaer) in squares of 16 x 16 pixels.

J. Immerkaer, Fast noise variance estimation, Comput. Vis. Image Underst. 64 (1996) 300-302: the mean
|response| to the second difference along rows of the second difference along columns is 6 sqrt(2 / pi) times
the standard deviation of the noise.
"""

import math

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers, Uint8s, Uint16s
from uavseg.segmentation.blocks.dilation import dilate

NOISE_SIDE = 16  # pixels: side of a square
_COARSE = 4  # side of a mean in pixels, and of a square in means
_SEPARATION = 4.0


def estimate_noise(grey: Uint16s, valid: Uint8s, active: Uint8s, bounds: Integers) -> Floats:
    """Estimate the standard deviation of the noise around each square with active cells; 0 elsewhere.

    It is in grey, the larger of two estimates: the noise of pixels, and that of means of 4 x 4 pixels, scaled
    to independent pixels. Only the second detects grain and crowns of trees. The median over 3 x 3 squares
    makes it robust against edges.

    Structure is not noise: where the pixels below a bound and those from it on form two separate groups,
    the estimates are those of the residuals from the means of the groups. Groups are separate where their
    means differ by more than `_SEPARATION` times the standard deviation within them. Halves of one normal
    distribution are 2.7 apart, those of a uniform one 3.5.

    `grey` and `valid` are (M, N), multiples of 16; `active`, 0 or 1, is (M / 8, N / 8). `bounds` are greys
    at which intervals begin, above 0. The noise is (M / 16, N / 16).
    """
    rows, cols = (n // NOISE_SIDE for n in grey.shape)
    squares = active[::2, ::2] | active[::2, 1::2] | active[1::2, ::2] | active[1::2, 1::2]
    estimates = np.full((2, rows, cols), -1.0)
    lines, means = np.empty((3, grey.shape[1]), np.int32), np.empty((_COARSE, _COARSE * cols), np.int32)
    flags = np.empty(grey.shape[1], np.uint8), np.empty(means.shape, np.uint8)
    residuals = np.zeros((NOISE_SIDE, grey.shape[1]), np.int32)
    _measure_squares(
        grey, valid, dilate(squares), bounds, residuals, lines, flags[0], means, flags[1], *estimates
    )
    return math.sqrt(math.pi / 2) / 6 * medians_around(estimates.max(axis=0), squares)


def medians_around(values: Floats, squares: Uint8s) -> Floats:
    """Compute the upper median of the known values in the 3 x 3 squares around some squares; 0 elsewhere.

    Both arrays are (m, n): `values` are negative where not known, `squares` 1 where to compute a median.
    """
    medians = np.zeros(values.shape)
    _take_medians(values, squares, np.empty(9), np.empty((2, values.shape[1])), medians)
    return medians


@inlined
def add_responses(grey, valid, row, begin, end, second, all_valid, sums, number):  # type: ignore[no-untyped-def]
    """Add the |responses| of a row where all 3 x 3 pixels are valid, column by column."""
    above, below = row - np.uintp(1), row + np.uintp(1)
    for c in range(begin, end):
        here = np.int32(grey[row, c])
        second[c] = (np.int32(grey[above, c]) - here) + (np.int32(grey[below, c]) - here)
    for c in range(begin, end):
        all_valid[c] = valid[above, c] & valid[row, c] & valid[below, c]
    for c in range(begin + np.uintp(1), end - np.uintp(1)):
        here = second[c]
        size = abs((second[c - np.uintp(1)] - here) + (second[c + np.uintp(1)] - here))
        ok = np.int32(all_valid[c - np.uintp(1)] & all_valid[c] & all_valid[c + np.uintp(1)])
        sums[c] += size * ok
        number[c] += ok


@inlined
def store_mean_responses(sums, number, side, scale, needed, means):  # type: ignore[no-untyped-def]
    """Store the mean |response| of each square, from responses within it; reset the sums."""
    for col in range(np.uintp(needed.shape[0])):
        size, count = np.int32(0), np.int32(0)
        for c in range(side * col + np.uintp(1), side * col + side - np.uintp(1)):
            size += sums[c]
            count += number[c]
        if needed[col] and count > 0:
            means[col] = scale * (size / count)
    sums[:] = 0
    number[:] = 0


@inlined
def mean_of_4x4(grey, valid, row, begin, end, sums, column_valid, means, all_valid):  # type: ignore[no-untyped-def]
    """Compute the means of 4 x 4 pixels, and whether all their pixels are valid."""
    a, b, c, d = row, row + np.uintp(1), row + np.uintp(2), row + np.uintp(3)
    for x in range(begin, end):
        sums[x] = np.int32(grey[a, x]) + np.int32(grey[b, x]) + np.int32(grey[c, x]) + np.int32(grey[d, x])
    for x in range(begin, end):
        column_valid[x] = valid[a, x] & valid[b, x] & valid[c, x] & valid[d, x]
    one, two, three, four = np.uintp(1), np.uintp(2), np.uintp(3), np.uintp(_COARSE)
    for k in range(begin // four, end // four):
        f = four * k
        means[k] = (sums[f] + sums[f + one] + sums[f + two] + sums[f + three] + np.int32(8)) >> np.int32(4)
    for k in range(begin // four, end // four):
        f = four * k
        all_valid[k] = (
            column_valid[f] & column_valid[f + one] & column_valid[f + two] & column_valid[f + three]
        )


@inlined
def extent_of_nonzero(needed):  # type: ignore[no-untyped-def]
    """Find the first nonzero element and the index after the last; the latter is 0 if there is none."""
    first = needed.shape[0]
    last = 0
    for k in range(needed.shape[0]):
        if needed[k]:
            first = min(first, k)
            last = k + 1
    return first, last


@inlined
def extremes(grey, valid, row, col):  # type: ignore[no-untyped-def]
    """Return the minimum and maximum grey of the valid pixels of a square."""
    minimum, maximum = np.uint16(65535), np.uint16(0)
    for r in range(row, row + np.uintp(NOISE_SIDE)):
        for c in range(col, col + np.uintp(NOISE_SIDE)):
            minimum = min(minimum, grey[r, c] | (np.uint16(valid[r, c]) - np.uint16(1)))
            maximum = max(maximum, grey[r, c])  # 0 where not valid
    return np.int64(minimum), np.int64(maximum)


@inlined
def sums_from(grey, valid, row, col, bound):  # type: ignore[no-untyped-def]
    """Count and sum the valid pixels of a square whose grey is at least the bound."""
    count, total = np.uint32(0), np.uint32(0)
    for r in range(row, row + np.uintp(NOISE_SIDE)):
        for c in range(col, col + np.uintp(NOISE_SIDE)):
            is_upper = valid[r, c] & np.uint8(grey[r, c] >= bound)
            count += np.uint32(is_upper)
            total += np.uint32(grey[r, c] & (np.uint16(0) - np.uint16(is_upper)))
    return np.int64(count), np.int64(total)


@inlined
def sum_of_squares(grey, row, col):  # type: ignore[no-untyped-def]
    """Square-sum the pixels of a square, which are 0 where not valid."""
    squares = np.int64(0)
    for r in range(row, row + np.uintp(NOISE_SIDE)):
        for c in range(col, col + np.uintp(NOISE_SIDE)):
            squares += np.int64(np.uint32(grey[r, c]) * np.uint32(grey[r, c]))
    return squares


@inlined
def separating_bound(grey, valid, row, col, bounds):  # type: ignore[no-untyped-def]
    """Find the bound that splits a square into the most separate groups, and the difference of their means.

    Both are 0 where no groups are separate.
    """
    best = np.int64(0)
    difference = 0.0
    minimum, maximum = extremes(grey, valid, row, col)
    largest = _SEPARATION * _SEPARATION
    squares, count, total = np.int64(-1), np.int64(0), np.int64(0)
    for k in range(bounds.shape[0]):
        if bounds[k] <= minimum or bounds[k] > maximum:
            continue
        if squares < 0:
            squares = sum_of_squares(grey, row, col)
            count, total = sums_from(grey, valid, row, col, np.uint16(0))
        upper, upper_total = sums_from(grey, valid, row, col, np.uint16(bounds[k]))
        lower, lower_total = count - upper, total - upper_total
        gap = upper_total / upper - lower_total / lower
        spread = squares - lower_total * lower_total / lower - upper_total * upper_total / upper
        within = max(spread / count, 0.0)
        if gap * gap > largest * within:
            largest = gap * gap / max(within, 1e-9)
            best, difference = bounds[k], gap
    return best, difference


@inlined
def store_residuals(grey, valid, row, col, bounds, residuals):  # type: ignore[no-untyped-def]
    """Store the greys of a square, those of the upper of two groups less the difference of the means."""
    bound, difference = separating_bound(grey, valid, row, col, bounds)
    shift = np.int32(difference + 0.5)
    for r in range(np.uintp(NOISE_SIDE)):
        for c in range(col, col + np.uintp(NOISE_SIDE)):
            value = np.int32(grey[row + r, c])
            residuals[r, c] = value - (shift if value >= np.int32(bound) else np.int32(0))


@kernel(
    "void(u2[:,::1], u1[:,::1], u1[:,::1], i8[::1], i4[:,::1], i4[:,::1], u1[::1], i4[:,::1], u1[:,::1],"
    " f8[:,::1], f8[:,::1])"
)
def _measure_squares(  # type: ignore[no-untyped-def]
    grey, valid, needed, bounds, residuals, lines, line, means, all_valid, fine, coarse
):
    sums, total, number = lines[0], lines[1], lines[2]
    side, four = np.uintp(NOISE_SIDE), np.uintp(_COARSE)
    total[:] = 0
    number[:] = 0
    for row in range(np.uintp(needed.shape[0])):
        first, last = extent_of_nonzero(needed[row])
        if last == 0:
            continue
        begin, end = np.uintp(first * NOISE_SIDE), np.uintp(last * NOISE_SIDE)
        inner = valid[row * side : (row + np.uintp(1)) * side]
        for col in range(first, last):
            if needed[row, col]:  # others are not stored below, and no response reaches beyond its square
                store_residuals(grey, valid, row * side, np.uintp(col) * side, bounds, residuals)
        for r in (2, 6, 9, 13):  # the same rows from above and from below
            add_responses(residuals, inner, np.uintp(r), begin, end, sums, line, total, number)
        store_mean_responses(total, number, side, 1, needed[row], fine[row])
        for k in range(four):
            mean_of_4x4(residuals, inner, four * k, begin, end, sums, line, means[k], all_valid[k])
        for r in range(np.uintp(1), four - np.uintp(1)):
            add_responses(means, all_valid, r, begin // four, end // four, sums, line, total, number)
        store_mean_responses(total, number, four, _COARSE, needed[row], coarse[row])


@inlined
def median_of_known(values, row, col, known):  # type: ignore[no-untyped-def]
    """Compute the upper median of the known values in the 3 x 3 squares around; 0 if none is known."""
    count = 0
    for r in range(max(row - 1, 0), min(row + 2, values.shape[0])):
        for c in range(max(col - 1, 0), min(col + 2, values.shape[1])):
            value = values[r, c]
            if value >= 0.0:
                k = count
                while k > 0 and known[k - 1] > value:
                    known[k] = known[k - 1]
                    k -= 1
                known[k] = value
                count += 1
    return known[count // 2] if count else 0.0


@inlined
def median_of_three(a, b, c):  # type: ignore[no-untyped-def]
    """Compute the median of three values."""
    return max(min(a, b), min(max(a, b), c))


@inlined
def medians_of_nine(above, line, below, minimum, median):  # type: ignore[no-untyped-def]
    """Compute median and minimum of 3 x 3 values: columns of three are sorted first."""
    cols = np.uintp(line.shape[0])
    one = np.uintp(1)
    for c in range(one, cols - one):
        a, b, d = c - one, c, c + one
        low_a, low_b = min(above[a], line[a], below[a]), min(above[b], line[b], below[b])
        low_d = min(above[d], line[d], below[d])
        minimum[c] = min(low_a, low_b, low_d)
        high = min(
            max(above[a], line[a], below[a]),
            max(above[b], line[b], below[b]),
            max(above[d], line[d], below[d]),
        )
        middles = median_of_three(
            median_of_three(above[a], line[a], below[a]),
            median_of_three(above[b], line[b], below[b]),
            median_of_three(above[d], line[d], below[d]),
        )
        median[c] = median_of_three(max(low_a, low_b, low_d), middles, high)


@kernel("void(f8[:,::1], u1[:,::1], f8[::1], f8[:,::1], f8[:,::1])")
def _take_medians(values, needed, known, lines, medians):  # type: ignore[no-untyped-def]
    # Where all nine values are known, whole rows are computed at once.
    rows, cols = needed.shape
    minimum, median = lines[0], lines[1]
    for row in range(rows):
        minimum[:] = -1.0
        if 0 < row < rows - 1:
            medians_of_nine(values[row - 1], values[row], values[row + 1], minimum, median)
        for col in range(cols):
            if needed[row, col]:
                medians[row, col] = (
                    median[col] if minimum[col] >= 0.0 else median_of_known(values, row, col, known)
                )
