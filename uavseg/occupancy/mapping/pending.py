"""Marks: what beams have said about cells and what is not in their log-odds yet.

Most of what beams say is that a cell is free. That is counted in a byte for each cell, up to the times that
lead from anywhere to the least log-odds there are; or the byte says that the log-odds are up to date, where
a beam has said something else.
"""

from math import log

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined
from uavseg.units import BLOCK

P_MIN = 0.1
LOG_P_MIN = log(P_MIN / (1 - P_MIN))
MAX_LOG_ODDS = 6.0
OFTEN = 6  # times free lead from anywhere to -6, so that nobody counts further
TOLD = 128  # the mark of a cell whose log-odds are up to date

Marks = NDArray[np.uint8]

_LINE = 64  # bytes


def marks_of(shape: tuple[int, int]) -> Marks:
    """Marks of a map on which nothing was said yet.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the map.

    Returns
    -------
    marks : (B, C, 8, 8, 8, 8) uint8 array
        Block, 8 x 8 pixels within it, pixel within these: what lies side by side shares a line of the
        processor's cache, so that a beam in any direction stays in few of them.
    """
    rows, cols = (-(-length // BLOCK) for length in shape)
    room = np.zeros(rows * cols * BLOCK * BLOCK + _LINE, np.uint8)
    first = -room.ctypes.data % _LINE
    return room[first : len(room) - _LINE + first].reshape(rows, cols, 8, 8, 8, 8)


@inlined
def free_once(odds):  # type: ignore[no-untyped-def]
    """Log-odds of a cell that is said to be free once more."""
    return np.float32(max(np.float64(odds) + LOG_P_MIN, -MAX_LOG_ODDS))


@inlined
def mark_of_row(row, cols):  # type: ignore[no-untyped-def]
    """Where the marks of a row begin; see `evidence.marks_of`."""
    return (row >> 6) * ((cols + 63) >> 6) * 4096 + ((row & 56) << 6) + ((row & 7) << 3)


@inlined
def mark_of_col(col):  # type: ignore[no-untyped-def]
    """How far from there the mark in a column is."""
    return (col >> 6) * 4096 + ((col & 56) << 3) + (col & 7)


@inlined
def cell_of_mark(i, cols):  # type: ignore[no-untyped-def]
    """Row times the number of columns, plus column, of the cell to which a mark belongs."""
    blocks = (cols + 63) >> 6
    row = (i >> 12) // blocks * 64 + ((i >> 9) & 7) * 8 + ((i >> 3) & 7)
    return row * cols + (i >> 12) % blocks * 64 + ((i >> 6) & 7) * 8 + (i & 7)


@inlined
def pick_up(words, block, row, line):  # type: ignore[no-untyped-def]
    """Take up the marks of a row of a block, 8 bytes at a time; gives all of them together, bit by bit."""
    together = np.uint64(0)
    start = np.uint64(block) * np.uint64(512) + np.uint64(row // 8 * 64 + row % 8)
    for k in range(np.uint64(8)):
        word = words[start + k * np.uint64(8)]
        line[k] = word
        together |= word
    if together:
        for k in range(np.uint64(8)):
            words[start + k * np.uint64(8)] = np.uint64(0)
    together |= together >> np.uint64(32)
    together |= together >> np.uint64(16)
    together |= together >> np.uint64(8)
    return np.uint8(together)
