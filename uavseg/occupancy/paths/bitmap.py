"""Bitmaps: masks with 64 cells per word, which a search scans by words; dead-end filling.

A bitmap has a frame of impassable cells. Cell (row, col) of the mask is bit col + 1, counted from the lowest,
of the words of line row + 1.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools

Bitmap = NDArray[np.uint64]


def pack_mask(mask: Bools) -> Bitmap:
    """Pack a mask (M, N) into a bitmap (M + 2, w), w = ceil((N + 2) / 64).

    Examples
    --------
    >>> pack_mask(np.array([[True, False, True]])).tolist()
    [[0], [10], [0]]
    """
    rows, cols = mask.shape
    framed = np.zeros((rows + 2, -(-(cols + 2) // 64) * 64), np.bool_)
    framed[1:-1, 1 : cols + 1] = mask
    return np.packbits(framed, axis=1, bitorder="little").view("<u8").astype(np.uint64, copy=False)


def transpose_bitmap(bits: Bitmap, cols: int) -> Bitmap:
    """Transpose a bitmap (M + 2, w) of a mask of `cols` columns to (cols + 2, ceil((M + 2) / 64))."""
    transposed = np.zeros((bits.shape[1] * 64, -(-len(bits) // 64)), np.uint64)
    _transpose(bits, np.empty(64, np.uint64), transposed)
    return transposed[: cols + 2]


def fill_dead_ends(bits: Bitmap, start: tuple[int, int], goal: tuple[int, int]) -> None:
    """Fill dead ends, in place: remove every cell with at most one edge neighbour, until none is left.

    No diagonal step touches such a cell, because that takes two edge neighbours, so no path between other
    cells leads through it. Start and goal (row and column with the frame) stay.
    """
    _fill_dead_ends(bits, *start, *goal)


@inlined
def is_open(bits, line, at):  # type: ignore[no-untyped-def]
    """Return 1 if a cell is passable, else 0."""
    return (bits[line, at >> 6] >> np.uint64(at & 63)) & np.uint64(1)


@inlined
def _popcount(word):  # type: ignore[no-untyped-def]
    """Count the bits that are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@inlined
def _lowest_bit(word):  # type: ignore[no-untyped-def]
    """Return the index of the lowest bit that is set; the word is not 0."""
    return _popcount(~word & (word - np.uint64(1)))


@inlined
def _highest_bit(word):  # type: ignore[no-untyped-def]
    """Return the index of the highest bit that is set; the word is not 0."""
    for shift in (1, 2, 4, 8, 16, 32):
        word |= word >> np.uint64(shift)
    return _popcount(word) - 1


@inlined
def next_stop(bits, line, at):  # type: ignore[no-untyped-def]
    """Find the first position after `at` where a jump along a line stops."""
    # That is an impassable cell (returned negative), or a cell beside which the line above or below opens:
    # passable there, impassable one position before.
    word = (at + 1) >> 6
    selected = ~np.uint64(0) << np.uint64((at + 1) & 63)
    before = word - 1 if word > 0 else 0  # bit 0 of a line is frame, so what comes before it does not count
    above_before, below_before = bits[line - 1, before], bits[line + 1, before]
    while True:
        own = bits[line, word]
        above, below = bits[line - 1, word], bits[line + 1, word]
        opens = above & ~(above << np.uint64(1) | above_before >> np.uint64(63))
        opens |= below & ~(below << np.uint64(1) | below_before >> np.uint64(63))
        stops = (opens | ~own) & selected
        if stops:
            bit = _lowest_bit(stops)
            position = (word << 6) + bit
            return position if (own >> np.uint64(bit)) & np.uint64(1) else -position
        above_before, below_before = above, below
        selected = ~np.uint64(0)
        word += 1


@inlined
def previous_stop(bits, line, at):  # type: ignore[no-untyped-def]
    """Find the same before `at`, towards smaller positions; 0 if the frame stops the jump."""
    word = (at - 1) >> 6
    selected = ~np.uint64(0) >> np.uint64(63 - ((at - 1) & 63))
    after = word + 1 if word + 1 < bits.shape[1] else word
    above_after = bits[line - 1, after] if after > word else np.uint64(0)
    below_after = bits[line + 1, after] if after > word else np.uint64(0)
    while True:
        own = bits[line, word]
        above, below = bits[line - 1, word], bits[line + 1, word]
        opens = above & ~(above >> np.uint64(1) | above_after << np.uint64(63))
        opens |= below & ~(below >> np.uint64(1) | below_after << np.uint64(63))
        stops = (opens | ~own) & selected
        if stops:
            bit = _highest_bit(stops)
            position = (word << 6) + bit
            return position if (own >> np.uint64(bit)) & np.uint64(1) else -position
        above_after, below_after = above, below
        selected = ~np.uint64(0)
        word -= 1


@inlined
def _fill_dead_end(bits, row, col, start_row, start_col, goal_row, goal_col):  # type: ignore[no-untyped-def]
    """Remove a dead end from its tip to the next fork."""
    while is_open(bits, row, col):
        if (row == start_row and col == start_col) or (row == goal_row and col == goal_col):
            return
        north, south = np.int64(is_open(bits, row - 1, col)), np.int64(is_open(bits, row + 1, col))
        east, west = np.int64(is_open(bits, row, col + 1)), np.int64(is_open(bits, row, col - 1))
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
            north, south = bits[row - 1, word], bits[row + 1, word]
            east = own >> np.uint64(1)
            west = own << np.uint64(1)
            if word + 1 < words:
                east |= bits[row, word + 1] << np.uint64(63)
            if word > 0:
                west |= bits[row, word - 1] >> np.uint64(63)
            dead = own & ~((north & south) | ((north | south) & (east | west)) | (east & west))
            while dead:
                col = (word << 6) + _lowest_bit(dead)
                dead &= dead - np.uint64(1)
                _fill_dead_end(bits, row, col, start_row, start_col, goal_row, goal_col)


@kernel("void(u8[:,::1], u8[::1], u8[:,::1])")
def _transpose(bits, block, transposed):  # type: ignore[no-untyped-def]
    # Blocks of 64 x 64 bits, by swapping ever smaller squares (Warren, Hacker's Delight, 7-3).
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
                transposed[(word << 6) + k, top >> 6] = block[k]
