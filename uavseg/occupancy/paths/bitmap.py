"""Masks with 64 cells to a word: what a search scans a word at a time, and what it need not look at.

A bitmap has a frame of cells that cannot be entered. Cell (row, col) of the mask is bit col + 1, counted from
the lowest, of the words of line row + 1.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

Bits = NDArray[np.uint64]


def packed(mask: NDArray[np.bool_]) -> Bits:
    """The bitmap of a mask.

    Parameters
    ----------
    mask : (M, N) bool array

    Returns
    -------
    bits : (M + 2, w) uint64 array, w = ceil((N + 2) / 64)

    Examples
    --------
    >>> packed(np.array([[True, False, True]])).tolist()
    [[0], [10], [0]]
    """
    rows, cols = mask.shape
    framed = np.zeros((rows + 2, -(-(cols + 2) // 64) * 64), np.bool_)
    framed[1:-1, 1 : cols + 1] = mask
    return np.packbits(framed, axis=1, bitorder="little").view("<u8").astype(np.uint64, copy=False)


def transposed(bits: Bits, cols: int) -> Bits:
    """The bitmap of the transposed mask, whose lines are the `cols` columns with their frame."""
    turned = np.zeros((bits.shape[1] * 64, -(-len(bits) // 64)), np.uint64)
    _transpose(bits, np.empty(64, np.uint64), turned)
    return turned[: cols + 2]


def fill_dead_ends(bits: Bits, start: tuple[int, int], goal: tuple[int, int]) -> None:
    """Take away, again and again, every cell with at most one neighbour that shares an edge.

    No diagonal step touches such a cell, for that needs two, so that a path between others cannot lead
    through it. Start and goal (framed row and column) stay.
    """
    _fill_dead_ends(bits, *start, *goal)


@inlined
def is_open(bits, line, at):  # type: ignore[no-untyped-def]
    """1 where a cell is passable."""
    return (bits[line, at >> 6] >> np.uint64(at & 63)) & np.uint64(1)


@inlined
def ones(word):  # type: ignore[no-untyped-def]
    """How many bits are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@inlined
def lowest(word):  # type: ignore[no-untyped-def]
    """Index of the lowest bit that is set; a word of 0 has none."""
    return ones(~word & (word - np.uint64(1)))


@inlined
def highest(word):  # type: ignore[no-untyped-def]
    """Index of the highest bit that is set."""
    for shift in (1, 2, 4, 8, 16, 32):
        word |= word >> np.uint64(shift)
    return ones(word) - 1


@inlined
def stop_after(bits, line, at):  # type: ignore[no-untyped-def]
    """Where a run along a line, towards larger positions, first meets an edge.

    That is a blocked cell (its position comes negative), or a cell beside which the line above or below
    opens: passable there, blocked one position before.
    """
    word = (at + 1) >> 6
    wanted = ~np.uint64(0) << np.uint64((at + 1) & 63)
    before = word - 1 if word > 0 else 0  # bit 0 of a line is frame, so what comes before it does not count
    above_before = bits[line - 1, before]
    below_before = bits[line + 1, before]
    while True:
        own = bits[line, word]
        above = bits[line - 1, word]
        below = bits[line + 1, word]
        opens = above & ~(above << np.uint64(1) | above_before >> np.uint64(63))
        opens |= below & ~(below << np.uint64(1) | below_before >> np.uint64(63))
        stops = (opens | ~own) & wanted
        if stops:
            bit = lowest(stops)
            found = (word << 6) + bit
            return found if (own >> np.uint64(bit)) & np.uint64(1) else -found
        above_before = above
        below_before = below
        wanted = ~np.uint64(0)
        word += 1


@inlined
def stop_before(bits, line, at):  # type: ignore[no-untyped-def]
    """The same towards smaller positions; 0, the frame, where the run ends at it."""
    word = (at - 1) >> 6
    wanted = ~np.uint64(0) >> np.uint64(63 - ((at - 1) & 63))
    after = word + 1 if word + 1 < bits.shape[1] else word
    above_after = bits[line - 1, after] if after > word else np.uint64(0)
    below_after = bits[line + 1, after] if after > word else np.uint64(0)
    while True:
        own = bits[line, word]
        above = bits[line - 1, word]
        below = bits[line + 1, word]
        opens = above & ~(above >> np.uint64(1) | above_after << np.uint64(63))
        opens |= below & ~(below >> np.uint64(1) | below_after << np.uint64(63))
        stops = (opens | ~own) & wanted
        if stops:
            bit = highest(stops)
            found = (word << 6) + bit
            return found if (own >> np.uint64(bit)) & np.uint64(1) else -found
        above_after = above
        below_after = below
        wanted = ~np.uint64(0)
        word -= 1


@inlined
def _follow(bits, row, col, start_row, start_col, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Take away a dead end from its tip to where the way forks."""
    while is_open(bits, row, col):
        if (row == start_row and col == start_col) or (row == goal_row and col == goal_col):
            return
        north = np.int64(is_open(bits, row - 1, col))
        south = np.int64(is_open(bits, row + 1, col))
        east = np.int64(is_open(bits, row, col + 1))
        west = np.int64(is_open(bits, row, col - 1))
        if north + south + east + west > 1:
            return
        bits[row, col >> 6] &= ~(np.uint64(1) << np.uint64(col & 63))
        row += south - north
        col += east - west


@kernel("void(u8[:,::1], i8, i8, i8, i8)")
def _fill_dead_ends(bits, start_row, start_col, goal_row, goal_col):  # type: ignore[no-untyped-def]
    words = bits.shape[1]
    for row in range(1, bits.shape[0] - 1):
        for word in range(words):
            own = bits[row, word]
            if own == np.uint64(0):
                continue
            north = bits[row - 1, word]
            south = bits[row + 1, word]
            east = own >> np.uint64(1)
            west = own << np.uint64(1)
            if word + 1 < words:
                east |= bits[row, word + 1] << np.uint64(63)
            if word > 0:
                west |= bits[row, word - 1] >> np.uint64(63)
            dead = own & ~((north & south) | ((north | south) & (east | west)) | (east & west))
            while dead:
                col = (word << 6) + lowest(dead)
                dead &= dead - np.uint64(1)
                _follow(bits, row, col, start_row, start_col, goal_row, goal_col)


@kernel("void(u8[:,::1], u8[::1], u8[:,::1])")
def _transpose(bits, block, turned):  # type: ignore[no-untyped-def]
    # Blocks of 64 x 64, by exchanging ever smaller squares (Warren, Hacker's Delight, 7-3).
    lines = bits.shape[0]
    for top in range(0, lines, 64):
        for word in range(bits.shape[1]):
            for k in range(64):
                block[k] = bits[top + k, word] if top + k < lines else np.uint64(0)
            half = 32
            mask = np.uint64(0xFFFFFFFF)
            while half:
                shift = np.uint64(half)
                k = 0
                while k < 64:
                    swapped = ((block[k] >> shift) ^ block[k + half]) & mask
                    block[k] ^= swapped << shift
                    block[k + half] ^= swapped
                    k = (k + half + 1) & ~half
                half >>= 1
                mask ^= mask << np.uint64(half)
            for k in range(64):
                turned[(word << 6) + k, top >> 6] = block[k]
