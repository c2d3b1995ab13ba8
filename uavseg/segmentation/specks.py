"""Pieces and holes of a few pixels change sides."""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

SPECK = 9  # pixels: smaller pieces, and smaller holes, are drawn by nobody


def drop_specks(
    inside: NDArray[np.uint8], valid: NDArray[np.uint8], runs: NDArray[np.int64], first: NDArray[np.int64]
) -> None:
    """Pieces of fewer than 9 pixels that touch pixels of the other side go over to it, all at once.

    Pieces inside are 4-connected, as regions are; those outside are 8-connected, as holes are.

    Parameters
    ----------
    inside : (M, N) uint8 array
        Changed in place.
    valid : (M, N) uint8 array
    runs : (k, 2) int64 array
        First column and the one after the last of runs of pixels that may change, eight rows high.
    first : (M / 8 + 1,) int64 array
        The first run of each eight rows.
    """
    uneven = np.empty(inside.shape[1], np.uint8)
    _drop_specks(inside.copy(), valid, runs, first, uneven, np.empty((SPECK, 2), np.int64), inside)


@inlined
def unevenness(above, line, below, valid_above, valid, valid_below, result):  # type: ignore[no-untyped-def]
    """0 where the nine pixels around one are valid and on one side: then its piece is no speck."""
    one = np.uintp(1)
    for c in range(np.uintp(result.shape[0])):
        result[c] = (above[c] ^ line[c + one]) | (below[c] ^ line[c + one]) | (line[c] ^ line[c + one])
    for c in range(np.uintp(result.shape[0])):
        result[c] |= (above[c + one] ^ line[c + one]) | (below[c + one] ^ line[c + one])
    two = np.uintp(2)
    for c in range(np.uintp(result.shape[0])):
        result[c] |= (above[c + two] ^ line[c + one]) | (below[c + two] ^ line[c + one])
    for c in range(np.uintp(result.shape[0])):
        result[c] |= (line[c + two] ^ line[c + one]) | (
            valid[c] & valid[c + one] & valid[c + two] ^ np.uint8(1)
        )
    for c in range(np.uintp(result.shape[0])):
        result[c] |= valid_above[c] & valid_above[c + one] & valid_above[c + two] ^ np.uint8(1)
    for c in range(np.uintp(result.shape[0])):
        result[c] |= valid_below[c] & valid_below[c + one] & valid_below[c + two] ^ np.uint8(1)


@inlined
def is_listed(listed, many, r, c):  # type: ignore[no-untyped-def]
    """Whether a pixel is among the first `many`."""
    found = False
    for k in range(many):
        found |= listed[k, 0] == r and listed[k, 1] == c
    return found


@inlined
def is_speck(inside, valid, r, c, listed):  # type: ignore[no-untyped-def]
    """Whether a pixel's piece is smaller than the list is long, and touches the other side."""
    rows, cols = inside.shape
    own = inside[r, c]
    listed[0, 0] = r
    listed[0, 1] = c
    many = 1
    touches = False
    k = 0
    while k < many:
        for down in range(-1, 2):
            for right in range(-1, 2):
                y = listed[k, 0] + down
                x = listed[k, 1] + right
                if y < 0 or x < 0 or y >= rows or x >= cols or not valid[y, x]:
                    continue
                if inside[y, x] != own:
                    touches = True
                elif (own == 0 or down == 0 or right == 0) and not is_listed(listed, many, y, x):
                    if many == listed.shape[0] - 1:
                        return False
                    listed[many, 0] = y
                    listed[many, 1] = x
                    many += 1
        k += 1
    return touches


@kernel("void(u1[:,::1], u1[:,::1], i8[:,::1], i8[::1], u1[::1], i8[:,::1], u1[:,::1])")
def _drop_specks(before, valid, runs, first, uneven, listed, inside):  # type: ignore[no-untyped-def]
    rows, cols = before.shape
    for r in range(rows):
        for k in range(first[r // 8], first[r // 8 + 1]):
            b = max(runs[k, 0], 1)
            e = min(runs[k, 1], cols - 1)
            uneven[runs[k, 0] : runs[k, 1]] = 1
            if r > 0 and r < rows - 1:
                unevenness(
                    before[r - 1, b - 1 : e + 1],
                    before[r, b - 1 : e + 1],
                    before[r + 1, b - 1 : e + 1],
                    valid[r - 1, b - 1 : e + 1],
                    valid[r, b - 1 : e + 1],
                    valid[r + 1, b - 1 : e + 1],
                    uneven[b:e],
                )
            for c in range(runs[k, 0], runs[k, 1]):
                if uneven[c] and valid[r, c] and is_speck(before, valid, r, c, listed):
                    inside[r, c] = np.uint8(1) - before[r, c]
