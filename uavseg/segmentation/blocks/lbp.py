"""LBP/C texture: local binary pattern and contrast of each pixel, at two scales.

Ojala and Pietikäinen, "Unsupervised texture segmentation using feature distributions", Pattern
Recognition 32 (1999) 477-486. A pixel is *counted* where its whole 3x3 neighbourhood is valid. Everything
is integer arithmetic on 16-bit grey.

The coarse scale is that of means of 2 x 2 pixels: texture several pixels wide survives them, while the noise
of single pixels is halved (multiresolution LBP: Ojala, Pietikäinen and Mäenpää, IEEE Transactions on Pattern
Analysis and Machine Intelligence 24 (2002) 971-987).
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Integers, Uint8s, Uint16s
from uavseg.units import GREY_LEVELS

CONTRAST_BINS = 8
SYMBOLS = 256 * CONTRAST_BINS  # pairs of LBP code and contrast bin
UNCOUNTED = 0xFFFF  # sentinel in place of a symbol
COARSE_HALO = 3  # pixels: largest distance from a pixel to a pixel of its means


def contrast_histogram(grey: Uint16s, valid: Uint8s | None = None) -> Integers:
    """Count the contrasts of the counted pixels of an image: (65536,) int64; those of tiles merge by adding.

    `grey` and `valid` are (M + 2, N + 2) arrays with a border of one pixel, which is read but not counted;
    `valid` is 1 where a pixel is valid, None where all are.

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
        _count_contrasts(grey, or_empty(valid), valid is None, line, counts)
    return counts.astype(np.int64)


def contrast_bin_edges(histogram: Integers) -> NDArray[np.int32]:
    """Return the seven edges of eight bins of contrast with equal counts, as far as ties allow.

    Edge k, from 1, is the smallest contrast with at least ceil(k N / 8) of the N counted pixels of the
    (65536,) histogram at or below it; a pixel's bin is the number of edges strictly below its contrast. The
    edges are (7,) int32, ascending; zeros where no pixel is counted.
    """
    cumulative = np.cumsum(histogram)
    ranks = [-(-k * int(cumulative[-1]) // CONTRAST_BINS) for k in range(1, CONTRAST_BINS)]
    return np.searchsorted(cumulative, ranks).astype(np.int32)


def lbp_symbols(grey: Uint16s, valid: Uint8s | None, bin_edges: NDArray[np.int32]) -> Uint16s:
    """Compute the LBP code and contrast bin of every pixel, as ``8 * code + bin``.

    `grey` and `valid` are those of `contrast_histogram`, `bin_edges` from `contrast_bin_edges`. The symbols
    are (M, N), 0 to 2047; 65535 where a pixel is not counted.
    """
    rows, cols = grey.shape[0] - 2, grey.shape[1] - 2
    symbols = np.empty((rows, cols), np.uint16)
    _lbp_symbols(grey, or_empty(valid), valid is None, bin_edges, symbols)
    return symbols


def or_empty(valid: Uint8s | None) -> Uint8s:
    """Return the array, or an empty one in place of None: kernel arguments have one type."""
    return np.empty((0, 0), np.uint8) if valid is None else valid


@inlined
def is_counted(valid, r, c):  # type: ignore[no-untyped-def]
    """Return 1 where the 3 x 3 pixels around (r, c) are all valid."""
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
    """Compute the mean of the neighbours >= the centre less that of the others, rounded down."""
    # It is 0 if either group is empty. Computed as one fraction, (hi m - lo n) / (n m): both integers are
    # exact in float32, and the quotient rounds to an integer only where it is one, so the floor is exact. The
    # numerator is 0 for an empty group.
    g = np.int32(grey[r, c])
    n, total, high = np.int32(0), np.int32(0), np.int32(0)
    for k in range(9):
        q = np.int32(grey[r - 1 + k // 3, c - 1 + k % 3])
        above = np.int32(q >= g)
        n += above
        high += q * above
        total += q
    n -= np.int32(1)  # the centre itself
    high -= g
    m = np.int32(8) - n
    low = total - g - high
    over = np.float32(high * m - low * n)
    return np.int32(over / np.float32(max(n * m, np.int32(1))))


@inlined
def lbp_code(grey, r, c):  # type: ignore[no-untyped-def]
    """Compute the local binary pattern: a bit for each of the eight neighbours that is >= the centre."""
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
def contrast_bin(value, edges):  # type: ignore[no-untyped-def]
    """Count the edges strictly below a contrast; a tuple of edges lets the compiler unroll the loop."""
    index = np.int32(0)
    for edge in edges:
        index += np.int32(edge < value)
    return index


@kernel("void(u2[:,::1], u1[:,::1], b1, i4[::1], u4[::1])")
def _count_contrasts(grey, valid, all_valid, line, counts):  # type: ignore[no-untyped-def]
    for r in range(1, grey.shape[0] - 1):
        for c in range(line.shape[0]):
            line[c] = contrast(grey, r, c + 1)
        if all_valid:
            for c in range(line.shape[0]):
                counts[line[c]] += 1
        else:
            for c in range(line.shape[0]):
                counts[line[c]] += is_counted(valid, r, c + 1)


@kernel("void(u2[:,::1], u1[:,::1], b1, i4[::1], u2[:,::1])")
def _lbp_symbols(grey, valid, all_valid, bin_edges, symbols):  # type: ignore[no-untyped-def]
    edges = (bin_edges[0], bin_edges[1], bin_edges[2], bin_edges[3], bin_edges[4], bin_edges[5], bin_edges[6])
    for r in range(symbols.shape[0]):
        for c in range(symbols.shape[1]):
            bin_index = contrast_bin(contrast(grey, r + 1, c + 1), edges)
            symbols[r, c] = lbp_code(grey, r + 1, c + 1) * CONTRAST_BINS + bin_index
        if not all_valid:
            for c in range(symbols.shape[1]):
                if not is_counted(valid, r + 1, c + 1):
                    symbols[r, c] = UNCOUNTED


def coarse_symbols(grey: Uint16s, valid: Uint8s | None, bin_edges: NDArray[np.int32]) -> Uint16s:
    """Compute the LBP code and contrast bin of the mean of each pixel with those above and left of it.

    The neighbours of a mean are the eight means of 2 x 2 pixels that touch it, so a pixel is counted where
    the 6 x 6 pixels around it are valid. `grey` and `valid` are (M + 6, N + 6), with a border of three
    pixels; otherwise all is as of `lbp_symbols`.
    """
    rows, cols = (max(length - 2 * COARSE_HALO, 0) for length in grey.shape)
    symbols = np.empty((rows, cols), np.uint16)
    pairs = grey[:-1].astype(np.uint32) + grey[1:]
    means = ((pairs[:, :-1] + pairs[:, 1:]) >> 2).astype(np.uint16)
    whole = None if valid is None else valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1] & valid[1:, 1:]
    for row, col in np.ndindex(2, 2):  # means that touch each other are two pixels apart
        every_other = symbols[row::2, col::2]
        if every_other.size:
            rows, cols = every_other.shape
            part = np.s_[row : row + 2 * rows + 3 : 2, col : col + 2 * cols + 3 : 2]
            mask = None if whole is None else np.ascontiguousarray(whole[part])
            every_other[:] = lbp_symbols(np.ascontiguousarray(means[part]), mask, bin_edges)
    return symbols
