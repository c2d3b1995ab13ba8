"""How noisy an image is around each cell of 8 x 8 pixels, by Immerkaer's estimate.

J. Immerkaer, Fast noise variance estimation, Comput. Vis. Image Underst. 64 (1996) 300-302: the mean
|response| to second differences across of second differences down is 6 sqrt(2 / pi) times the deviation of
the noise.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

_AROUND = 2  # cells on every side whose median is taken


def grown(cells: NDArray[np.uint8], by: int) -> NDArray[np.uint8]:
    """The largest value within `by` cells of each, in a square."""
    for axis in (0, 1):
        around = np.pad(cells, [(by, by) if k == axis else (0, 0) for k in (0, 1)])
        cells = np.max(
            [around.take(range(k, k + cells.shape[axis]), axis) for k in range(2 * by + 1)], axis=0
        )
    return cells


def noise_of_cells(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], active: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """Deviation of the noise around each active cell, in grey; 0 elsewhere.

    The larger of two: the noise of pixels, and that of means of 4 x 4 pixels as it would be in pixels that
    know nothing of each other. Grain and crowns of trees are seen in the second alone. Each is the median
    over the 5 x 5 cells around, so that an edge counts for little.

    Parameters
    ----------
    grey : (M, N) uint16 array
        M and N are multiples of 8.
    valid : (M, N) uint8 array
    active : (M / 8, N / 8) uint8 array

    Returns
    -------
    noise : (M / 8, N / 8) float64 array
    """
    wanted = grown(active, _AROUND)
    found = np.full((2, *active.shape), -1.0)
    _respond(grey, valid, wanted, 2, found[0])
    fours = grey.shape[0] // 4, grey.shape[1] // 4
    means, whole = np.empty(fours, np.uint16), np.empty(fours, np.uint8)
    _mean_of_fours(grey, valid, means, whole)
    _respond(means, whole, wanted, 1, found[1])
    found[1] *= 4
    noise = np.zeros(active.shape)
    _take_medians(found, active, np.empty((2 * _AROUND + 1) ** 2), noise)
    return math.sqrt(math.pi / 2) / 6 * noise


@kernel("void(u2[:,::1], u1[:,::1], u2[:,::1], u1[:,::1])")
def _mean_of_fours(grey, valid, means, whole):  # type: ignore[no-untyped-def]
    for row in range(means.shape[0]):
        for col in range(means.shape[1]):
            total = np.uint32(8)
            every = np.uint8(1)
            for r in range(4 * row, 4 * row + 4):
                for c in range(4 * col, 4 * col + 4):
                    total += np.uint32(grey[r, c])
                    every &= valid[r, c]
            means[row, col] = total // np.uint32(16)
            whole[row, col] = every


@inlined
def response(grey, r, c):  # type: ignore[no-untyped-def]
    """Of Immerkaer's operator: second differences across of second differences down."""
    left = np.int64(grey[r - 1, c - 1]) - 2 * np.int64(grey[r, c - 1]) + np.int64(grey[r + 1, c - 1])
    here = np.int64(grey[r - 1, c]) - 2 * np.int64(grey[r, c]) + np.int64(grey[r + 1, c])
    right = np.int64(grey[r - 1, c + 1]) - 2 * np.int64(grey[r, c + 1]) + np.int64(grey[r + 1, c + 1])
    return left - 2 * here + right


@inlined
def is_whole(valid, r, c):  # type: ignore[no-untyped-def]
    """1 where a pixel and all eight around it are valid."""
    whole = np.uint8(1)
    for down in range(r - 1, r + 2):
        whole &= valid[down, c - 1] & valid[down, c] & valid[down, c + 1]
    return whole


@kernel("void(u2[:,::1], u1[:,::1], u1[:,::1], i8, f8[:,::1])")
def _respond(grey, valid, wanted, every, mean):  # type: ignore[no-untyped-def]
    """The mean |response| in some rows of each wanted cell, where all that it looks at is valid."""
    side = grey.shape[0] // wanted.shape[0]
    for row in range(wanted.shape[0]):
        for col in range(wanted.shape[1]):
            total = np.int64(0)
            number = np.int64(0)
            if wanted[row, col]:
                for r in range(
                    max(side * row + every // 2, 1), min(side * row + side, grey.shape[0] - 1), every
                ):
                    for c in range(max(side * col, 1), min(side * col + side, grey.shape[1] - 1)):
                        whole = np.int64(is_whole(valid, r, c))
                        total += abs(response(grey, r, c)) * whole
                        number += whole
            if number > 0:
                mean[row, col] = total / number


@inlined
def median_around(values, row, col, some):  # type: ignore[no-untyped-def]
    """The upper median of what is known of the cells around; 0 if nothing is."""
    many = 0
    for r in range(max(row - _AROUND, 0), min(row + _AROUND + 1, values.shape[0])):
        for c in range(max(col - _AROUND, 0), min(col + _AROUND + 1, values.shape[1])):
            value = values[r, c]
            if value >= 0.0:
                k = many
                while k > 0 and some[k - 1] > value:
                    some[k] = some[k - 1]
                    k -= 1
                some[k] = value
                many += 1
    return some[many // 2] if many else 0.0


@kernel("void(f8[:,:,::1], u1[:,::1], f8[::1], f8[:,::1])")
def _take_medians(found, active, some, noise):  # type: ignore[no-untyped-def]
    for row in range(active.shape[0]):
        for col in range(active.shape[1]):
            if active[row, col]:
                fine = median_around(found[0], row, col, some)
                coarse = median_around(found[1], row, col, some)
                noise[row, col] = max(fine, coarse)
