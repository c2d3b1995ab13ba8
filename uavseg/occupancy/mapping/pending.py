"""Pending updates: free observations that are counted per cell before they are added to the log-odds.

Most observations along a beam are that a cell is free. They are counted in one byte per cell, up to the count
that leads from any log-odds to the minimum. Where a beam observes anything else, the log-odds are updated at
once and the byte says that they are up to date.
"""

from math import log

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined
from uavseg.units import BLOCK

P_MIN = 0.1
FREE_LOG_ODDS = log(P_MIN / (1 - P_MIN))
MAX_LOG_ODDS = 6.0
MAX_FREE_COUNT = 6  # free observations that lead from any log-odds to -6; more are not counted
UP_TO_DATE = 128  # the byte of a cell whose log-odds include every observation

PendingUpdates = NDArray[np.uint8]

_CACHE_LINE = 64  # bytes


def empty_pending(shape: tuple[int, int]) -> PendingUpdates:
    """Pending updates of a map without observations: all zero.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the map.

    Returns
    -------
    pending : (B, C, 8, 8, 8, 8) uint8 array
        Block, 8 x 8 pixels within it, pixel within these. Neighbouring pixels share a cache line, so a beam
        in any direction touches few of them.
    """
    rows, cols = (-(-length // BLOCK) for length in shape)
    storage = np.zeros(rows * cols * BLOCK * BLOCK + _CACHE_LINE, np.uint8)
    first = -storage.ctypes.data % _CACHE_LINE
    return storage[first : len(storage) - _CACHE_LINE + first].reshape(rows, cols, 8, 8, 8, 8)


@inlined
def add_one_free(odds):  # type: ignore[no-untyped-def]
    """Log-odds of a cell after one more free observation."""
    return np.float32(max(np.float64(odds) + FREE_LOG_ODDS, -MAX_LOG_ODDS))


@inlined
def row_offset(row, cols):  # type: ignore[no-untyped-def]
    """Offset of a row in the flat pending updates, see `empty_pending`; add that of the column."""
    return (row >> 6) * ((cols + 63) >> 6) * 4096 + ((row & 56) << 6) + ((row & 7) << 3)


@inlined
def col_offset(col):  # type: ignore[no-untyped-def]
    """Offset of a column in the flat pending updates."""
    return (col >> 6) * 4096 + ((col & 56) << 3) + (col & 7)


@inlined
def cell_at_offset(i, cols):  # type: ignore[no-untyped-def]
    """Flat index of the cell (row * cols + col) whose pending update has offset i."""
    blocks = (cols + 63) >> 6
    row = (i >> 12) // blocks * 64 + ((i >> 9) & 7) * 8 + ((i >> 3) & 7)
    return row * cols + (i >> 12) % blocks * 64 + ((i >> 6) & 7) * 8 + (i & 7)


@inlined
def pop_row(words, block, row, line):  # type: ignore[no-untyped-def]
    """Copy the pending updates of one row of a block to `line` and clear them, 8 bytes at a time.

    Returns the bitwise or of all of them.
    """
    combined = np.uint64(0)
    start = np.uint64(block) * np.uint64(512) + np.uint64(row // 8 * 64 + row % 8)
    for k in range(np.uint64(8)):
        word = words[start + k * np.uint64(8)]
        line[k] = word
        combined |= word
    if combined:
        for k in range(np.uint64(8)):
            words[start + k * np.uint64(8)] = np.uint64(0)
    combined |= combined >> np.uint64(32)
    combined |= combined >> np.uint64(16)
    combined |= combined >> np.uint64(8)
    return np.uint8(combined)
