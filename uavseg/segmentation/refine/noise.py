"""How noisy an image is around each square of 16 x 16 pixels, by Immerkaer's estimate.

J. Immerkaer, Fast noise variance estimation, Comput. Vis. Image Underst. 64 (1996) 300-302: the mean
|response| to second differences across of second differences down is 6 sqrt(2 / pi) times the deviation of
the noise.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

NOISE_SIDE = 16  # pixels of a square
_COARSE = 4  # pixels on a side of a mean, and means on a side of a square


def grown(cells: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The largest value of each three by three cells."""
    found = cells.copy()
    np.maximum(found[1:], cells[:-1], out=found[1:])
    np.maximum(found[:-1], cells[1:], out=found[:-1])
    down = found.copy()
    np.maximum(found[:, 1:], down[:, :-1], out=found[:, 1:])
    np.maximum(found[:, :-1], down[:, 1:], out=found[:, :-1])
    return found


def estimate_noise(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], active: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """Deviation of the noise around each square with active cells, in grey; 0 elsewhere.

    The larger of two: the noise of pixels, and that of means of 4 x 4 pixels as it would be in pixels that
    know nothing of each other. Grain and crowns of trees are seen in the second alone. The median over the
    3 x 3 squares around is taken, so that an edge counts for little.

    Parameters
    ----------
    grey : (M, N) uint16 array
        M and N are multiples of 16.
    valid : (M, N) uint8 array
    active : (M / 8, N / 8) uint8 array, 0 or 1

    Returns
    -------
    noise : (M / 16, N / 16) float64 array
    """
    rows, cols = (n // NOISE_SIDE for n in grey.shape)
    squares = active[::2, ::2] | active[::2, 1::2] | active[1::2, ::2] | active[1::2, 1::2]
    found = np.full((2, rows, cols), -1.0)
    lines, means = np.empty((3, grey.shape[1]), np.int32), np.empty((_COARSE, _COARSE * cols), np.int32)
    flags = np.empty(grey.shape[1], np.uint8), np.empty(means.shape, np.uint8)
    _measure_squares(grey, valid, grown(squares), lines, flags[0], means, flags[1], *found)
    noise = np.zeros((rows, cols))
    _take_medians(found.max(axis=0), squares, np.empty(9), np.empty((2, cols)), noise)
    return math.sqrt(math.pi / 2) / 6 * noise


@inlined
def add_responses(grey, valid, row, begin, end, bend, whole, total, number):  # type: ignore[no-untyped-def]
    """Add |responses| in a row to those of rows before, where all that is looked at is valid."""
    above = row - np.uintp(1)
    below = row + np.uintp(1)
    for c in range(begin, end):
        here = np.int32(grey[row, c])
        bend[c] = (np.int32(grey[above, c]) - here) + (np.int32(grey[below, c]) - here)
    for c in range(begin, end):
        whole[c] = valid[above, c] & valid[row, c] & valid[below, c]
    for c in range(begin + np.uintp(1), end - np.uintp(1)):
        here = bend[c]
        size = abs((bend[c - np.uintp(1)] - here) + (bend[c + np.uintp(1)] - here))
        one = np.int32(whole[c - np.uintp(1)] & whole[c] & whole[c + np.uintp(1)])
        total[c] += size * one
        number[c] += one


@inlined
def store_mean_responses(total, number, side, scale, wanted, found):  # type: ignore[no-untyped-def]
    """Mean |responses| that look at nothing outside their square; and zeros for the next."""
    for col in range(np.uintp(wanted.shape[0])):
        size = np.int32(0)
        many = np.int32(0)
        for c in range(side * col + np.uintp(1), side * col + side - np.uintp(1)):
            size += total[c]
            many += number[c]
        if wanted[col] and many > 0:
            found[col] = scale * (size / many)
    total[:] = 0
    number[:] = 0


@inlined
def mean_of_4x4(grey, valid, row, begin, end, sums, every, means, whole):  # type: ignore[no-untyped-def]
    """Means of 4 x 4 pixels, and which of them are of valid pixels alone."""
    a, b, c, d = row, row + np.uintp(1), row + np.uintp(2), row + np.uintp(3)
    for x in range(begin, end):
        sums[x] = np.int32(grey[a, x]) + np.int32(grey[b, x]) + np.int32(grey[c, x]) + np.int32(grey[d, x])
    for x in range(begin, end):
        every[x] = valid[a, x] & valid[b, x] & valid[c, x] & valid[d, x]
    one, two, three, four = np.uintp(1), np.uintp(2), np.uintp(3), np.uintp(_COARSE)
    for k in range(begin // four, end // four):
        f = four * k
        means[k] = (sums[f] + sums[f + one] + sums[f + two] + sums[f + three] + np.int32(8)) >> np.int32(4)
    for k in range(begin // four, end // four):
        f = four * k
        whole[k] = every[f] & every[f + one] & every[f + two] & every[f + three]


@inlined
def extent_of_nonzero(wanted):  # type: ignore[no-untyped-def]
    """The first of what is wanted, and the one after the last; 0 if nothing is."""
    first = wanted.shape[0]
    last = 0
    for k in range(wanted.shape[0]):
        if wanted[k]:
            first = min(first, k)
            last = k + 1
    return first, last


@kernel(
    "void(u2[:,::1], u1[:,::1], u1[:,::1], i4[:,::1], u1[::1], i4[:,::1], u1[:,::1], f8[:,::1], f8[:,::1])"
)
def _measure_squares(grey, valid, wanted, lines, line, means, whole, fine, coarse):  # type: ignore[no-untyped-def]
    sums, total, number = lines[0], lines[1], lines[2]
    side = np.uintp(NOISE_SIDE)
    four = np.uintp(_COARSE)
    total[:] = 0
    number[:] = 0
    for row in range(np.uintp(wanted.shape[0])):
        first, last = extent_of_nonzero(wanted[row])
        if last == 0:
            continue
        begin, end = np.uintp(first * NOISE_SIDE), np.uintp(last * NOISE_SIDE)
        for r in range(np.uintp(2), side, four):
            add_responses(grey, valid, row * side + r, begin, end, sums, line, total, number)
        store_mean_responses(total, number, side, 1, wanted[row], fine[row])
        for k in range(four):
            mean_of_4x4(grey, valid, row * side + four * k, begin, end, sums, line, means[k], whole[k])
        for r in range(np.uintp(1), four - np.uintp(1)):
            add_responses(means, whole, r, begin // four, end // four, sums, line, total, number)
        store_mean_responses(total, number, four, _COARSE, wanted[row], coarse[row])


@inlined
def median_of_known(values, row, col, some):  # type: ignore[no-untyped-def]
    """The upper median of what is known of the squares around; 0 if nothing is."""
    many = 0
    for r in range(max(row - 1, 0), min(row + 2, values.shape[0])):
        for c in range(max(col - 1, 0), min(col + 2, values.shape[1])):
            value = values[r, c]
            if value >= 0.0:
                k = many
                while k > 0 and some[k - 1] > value:
                    some[k] = some[k - 1]
                    k -= 1
                some[k] = value
                many += 1
    return some[many // 2] if many else 0.0


@inlined
def median_of_three(a, b, c):  # type: ignore[no-untyped-def]
    """The median of three."""
    return max(min(a, b), min(max(a, b), c))


@inlined
def medians_of_nine(above, line, below, least, median):  # type: ignore[no-untyped-def]
    """Median and least of each value and the eight around it: columns of three are sorted first."""
    cols = np.uintp(line.shape[0])
    one = np.uintp(1)
    for c in range(one, cols - one):
        a, b, d = c - one, c, c + one
        low_a = min(above[a], line[a], below[a])
        low_b = min(above[b], line[b], below[b])
        low_d = min(above[d], line[d], below[d])
        least[c] = min(low_a, low_b, low_d)
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
def _take_medians(found, wanted, some, lines, noise):  # type: ignore[no-untyped-def]
    # Where all nine are known, whole rows are done at once.
    rows, cols = wanted.shape
    least, median = lines[0], lines[1]
    for row in range(rows):
        least[:] = -1.0
        if 0 < row < rows - 1:
            medians_of_nine(found[row - 1], found[row], found[row + 1], least, median)
        for col in range(cols):
            if wanted[row, col]:
                noise[row, col] = median[col] if least[col] >= 0.0 else median_of_known(found, row, col, some)
