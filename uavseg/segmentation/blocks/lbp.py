"""Texture of a pixel: which neighbours are as bright (LBP) and how strongly they differ (contrast).

After Ojala and Pietikäinen, "Unsupervised texture segmentation using feature distributions", Pattern
Recognition 32 (1999) 477-486. A pixel is *counted* where its whole 3x3 neighbourhood is valid. Everything
is integer arithmetic on 16-bit grey.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.units import GREY_LEVELS

BINS = 8  # bins of contrast
SYMBOLS = 256 * BINS  # pairs of LBP code and bin of contrast
UNCOUNTED = 0xFFFF


def contrast_histogram(grey: NDArray[np.uint16], valid: NDArray[np.uint8] | None = None) -> NDArray[np.int64]:
    """How often each contrast occurs among the counted pixels of an image.

    Parameters
    ----------
    grey : (M + 2, N + 2) uint16 array
        Image with a border of one pixel, which is looked at but not counted itself.
    valid : (M + 2, N + 2) uint8 array, optional
        1 where a pixel is valid; all are, if left out.

    Returns
    -------
    histogram : (65536,) int64 array
        Histograms of tiles add up to the histogram of the whole.

    Examples
    --------
    >>> image = np.array([[9, 9, 9], [9, 5, 1], [9, 9, 9]], np.uint16)
    >>> np.flatnonzero(contrast_histogram(image))  # seven nines, less one
    array([8])
    """
    rows, cols = grey.shape[0] - 2, grey.shape[1] - 2
    counts = np.zeros(GREY_LEVELS, np.uint32)
    if rows > 0 and cols > 0:
        line = np.empty(cols, np.int32)
        _count_contrasts(grey, given(valid), valid is None, line, counts)
    return counts.astype(np.int64)


def contrast_cuts(histogram: NDArray[np.int64]) -> NDArray[np.int32]:
    """The seven values that cut counted pixels into eight bins of contrast, as even as ties allow.

    Cut k is the smallest contrast with at least ceil(k N / 8) of the N counted pixels at or below it; a
    pixel's bin is the number of cuts strictly below its contrast.

    Parameters
    ----------
    histogram : (65536,) int64 array

    Returns
    -------
    cuts : (7,) int32 array, ascending; zeros where nothing was counted
    """
    below = np.cumsum(histogram)
    ranks = [-(-k * int(below[-1]) // BINS) for k in range(1, BINS)]
    return np.searchsorted(below, ranks).astype(np.int32)


def symbols(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8] | None, cuts: NDArray[np.int32]
) -> NDArray[np.uint16]:
    """LBP code and bin of contrast of every pixel, as ``8 * code + bin``.

    Parameters
    ----------
    grey : (M + 2, N + 2) uint16 array
        Image with a border of one pixel.
    valid : (M + 2, N + 2) uint8 array or None
    cuts : (7,) int32 array, from `contrast_cuts`

    Returns
    -------
    symbols : (M, N) uint16 array
        0 to 2047; 65535 where a pixel is not counted.
    """
    rows, cols = grey.shape[0] - 2, grey.shape[1] - 2
    found = np.empty((rows, cols), np.uint16)
    _symbols(grey, given(valid), valid is None, cuts, found)
    return found


def given(valid: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
    """The array, or an empty one in its place: kernels want a value of one type."""
    return np.empty((0, 0), np.uint8) if valid is None else valid


@inlined
def counted(valid, r, c):  # type: ignore[no-untyped-def]
    """1 where the 3x3 pixels around (r, c) are all valid."""
    return (
        valid[r - 1, c - 1]
        & valid[r - 1, c]
        & valid[r - 1, c + 1]
        & valid[r, c - 1]
        & valid[r, c]
        & valid[r, c + 1]
        & valid[r + 1, c - 1]
        & valid[r + 1, c]
        & valid[r + 1, c + 1]
    )


@inlined
def contrast(grey, r, c):  # type: ignore[no-untyped-def]
    """Mean of the neighbours >= the centre less mean of the others, rounded down; 0 if either group is empty.

    As one fraction, (hi m - lo n) / (n m): both integers fit float32 exactly and the quotient rounds to
    an integer only where it is one, so that this is the exact floor. Where a group is empty the numerator is
    0.
    """
    g = np.int32(grey[r, c])
    n = np.int32(0)
    total = np.int32(0)
    high = np.int32(0)
    for k in range(9):
        q = np.int32(grey[r - 1 + k // 3, c - 1 + k % 3])
        above = np.int32(q >= g)
        n += above
        high += q * above
        total += q
    n -= np.int32(1)  # the centre met itself
    high -= g
    m = np.int32(8) - n
    low = total - g - high
    over = np.float32(high * m - low * n)
    return np.int32(over / np.float32(max(n * m, np.int32(1))))


@inlined
def lbp_code(grey, r, c):  # type: ignore[no-untyped-def]
    """Eight bits: which neighbours are at least as bright as the centre."""
    g = grey[r, c]
    return (
        np.int32(grey[r - 1, c - 1] >= g)
        | np.int32(grey[r - 1, c] >= g) << 1
        | np.int32(grey[r - 1, c + 1] >= g) << 2
        | np.int32(grey[r, c + 1] >= g) << 3
        | np.int32(grey[r + 1, c + 1] >= g) << 4
        | np.int32(grey[r + 1, c] >= g) << 5
        | np.int32(grey[r + 1, c - 1] >= g) << 6
        | np.int32(grey[r, c - 1] >= g) << 7
    )


@inlined
def contrast_bin(value, cuts):  # type: ignore[no-untyped-def]
    """The number of cuts strictly below a contrast; `cuts` as seven numbers, which keeps the loop
    straight.
    """
    found = np.int32(0)
    for cut in cuts:
        found += np.int32(cut < value)
    return found


@kernel("void(u2[:,::1], u1[:,::1], b1, i4[::1], u4[::1])")
def _count_contrasts(grey, valid, every, line, counts):  # type: ignore[no-untyped-def]
    for r in range(1, grey.shape[0] - 1):
        for c in range(line.shape[0]):
            line[c] = contrast(grey, r, c + 1)
        if every:
            for c in range(line.shape[0]):
                counts[line[c]] += 1
        else:
            for c in range(line.shape[0]):
                counts[line[c]] += counted(valid, r, c + 1)


@kernel("void(u2[:,::1], u1[:,::1], b1, i4[::1], u2[:,::1])")
def _symbols(grey, valid, every, cuts, found):  # type: ignore[no-untyped-def]
    seven = (cuts[0], cuts[1], cuts[2], cuts[3], cuts[4], cuts[5], cuts[6])
    for r in range(found.shape[0]):
        for c in range(found.shape[1]):
            level = contrast_bin(contrast(grey, r + 1, c + 1), seven)
            found[r, c] = lbp_code(grey, r + 1, c + 1) * BINS + level
        if not every:
            for c in range(found.shape[1]):
                if not counted(valid, r + 1, c + 1):
                    found[r, c] = UNCOUNTED
