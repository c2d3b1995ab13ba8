"""Pending updates: free observations are counted per cell before they are added to the log-odds.

Most observations along a beam are that a cell is free. They are counted in one byte per cell, up to the count
that leads from any log-odds to the minimum. Where a beam observes anything else, the log-odds are updated at
once and the byte says that they are up to date. `apply_pending` adds the counts, and log-odds, probability
and grey of each cell change together.
"""

from dataclasses import field
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Float32s, Integers, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.occupancy.mapping.log_odds import add_one_free, free_only_values, grey_of_probability, logistic
from uavseg.raster.grid.tiling import Window, whole_blocks
from uavseg.segmentation.blocks.block_map import cell_sums
from uavseg.units import BLOCK

MAX_FREE_COUNT = 6  # free observations that lead from any log-odds to -6; more are not counted
UP_TO_DATE = 128  # the byte of a cell whose log-odds include every observation

PendingUpdates = NDArray[np.uint8]

_CACHE_LINE = 64  # bytes

NEIGHBOURS = 9  # bits of a changed block: the 3 x 3 blocks around it that the change affects, by rows
SELF = 4  # the block itself, in the middle
_ALL = (1 << NEIGHBOURS) - 1


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class ChangeLog:
    """Changes of a grey map that one observer has not read yet."""

    changed: Uint16s  # (B, C) uint16; as in `GreyMap`

    def pop(self) -> tuple[Bools, Bools]:
        """Read and clear changes: blocks (B, C) whose grey changed, and those with a change in or beside."""
        rows, cols = self.changed.shape
        around = np.zeros((rows + 2, cols + 2), bool)
        if self.changed.any():
            for k in range(NEIGHBOURS):
                around[k // 3 : k // 3 + rows, k % 3 : k % 3 + cols] |= (self.changed >> k & 1) > 0
        changed = (self.changed >> SELF & 1) > 0
        self.changed[:] = 0
        return changed, around[1:-1, 1:-1]


@dataclass(frozen=True, slots=True, eq=False)
class GreyMap:
    """The grey of a map that changes."""

    shape: tuple[int, int]  # rows and columns of the map in pixels
    # (M + 2, N + 2) uint16; padded to whole blocks of 64, with a border of one pixel; 0 outside the map.
    grey: Uint16s
    valid: Uint8s  # (M + 2, N + 2) uint8; 1 in the map
    sums: Uint32s  # (8 B, 8 C); valid grey of cells of 8 x 8, as in a `BlockMap`
    counts: Uint8s  # (8 B, 8 C)
    # (B, C) uint16; changes of each block since they were last copied to the change logs. A bit is set for
    # each of the 3 x 3 blocks around, in raster order, in which or next to which a pixel has changed its
    # grey.
    changed: Uint16s
    _logs: "WeakSet[ChangeLog]" = field(default_factory=WeakSet, repr=False)

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> "GreyMap":
        """Make a map of a number of rows and columns, 0 everywhere."""
        rows, cols = (whole_blocks(length) for length in shape)
        valid = np.zeros((rows + 2, cols + 2), np.uint8)
        valid[1 : shape[0] + 1, 1 : shape[1] + 1] = 1
        changed = np.zeros((rows // BLOCK, cols // BLOCK), np.uint16)
        grey = np.zeros(valid.shape, np.uint16)
        sums, counts = cell_sums(grey, valid, 1)
        return cls(shape=shape, grey=grey, valid=valid, sums=sums, counts=counts, changed=changed)

    def set_grey(self, grey: Uint16s) -> None:
        """Set the grey of the whole map, a (rows, cols) array; all blocks count as changed."""
        self.grey[1 : self.shape[0] + 1, 1 : self.shape[1] + 1] = grey
        self.sums[:] = cell_sums(self.grey, self.valid, 1)[0]
        self.changed[:] = _ALL

    def new_log(self) -> ChangeLog:
        """Return a log of the changes from now on, kept as long as the caller holds it."""
        self.flush_changes()
        log = ChangeLog(np.zeros(self.changed.shape, np.uint16))
        self._logs.add(log)
        return log

    def flush_changes(self) -> None:
        """Copy the changes to all logs and clear them here."""
        for log in self._logs:
            log.changed[:] |= self.changed
        self.changed[:] = 0


def empty_pending(shape: tuple[int, int]) -> PendingUpdates:
    """Allocate the pending updates (B, C, 8, 8, 8, 8) of a map without observations: all zero.

    The axes are block, 8 x 8 pixels within it, pixel within these. Neighbouring pixels share a cache line, so
    a beam in any direction touches few of them.
    """
    rows, cols = (-(-length // BLOCK) for length in shape)
    storage = np.zeros(rows * cols * BLOCK * BLOCK + _CACHE_LINE, np.uint8)
    first = -storage.ctypes.data % _CACHE_LINE
    return storage[first : len(storage) - _CACHE_LINE + first].reshape(rows, cols, 8, 8, 8, 8)


def mark_up_to_date(pending: PendingUpdates, row: Integers, col: Integers) -> None:
    """Mark cells whose log-odds were set, so that `apply_pending` brings probability and grey up to date."""
    pending[row >> 6, col >> 6, row >> 3 & 7, col >> 3 & 7, row & 7, col & 7] = UP_TO_DATE


@inlined
def row_offset(row, cols):  # type: ignore[no-untyped-def]
    """Return the offset of a row in the flat pending updates, see `empty_pending`; add that of the column."""
    return (row >> 6) * ((cols + 63) >> 6) * 4096 + ((row & 56) << 6) + ((row & 7) << 3)


@inlined
def col_offset(col):  # type: ignore[no-untyped-def]
    """Return the offset of a column in the flat pending updates."""
    return (col >> 6) * 4096 + ((col & 56) << 3) + (col & 7)


@inlined
def cell_at_offset(i, cols):  # type: ignore[no-untyped-def]
    """Return the flat index of the cell (row * cols + col) whose pending update has offset i."""
    blocks = (cols + 63) >> 6
    row = (i >> 12) // blocks * 64 + ((i >> 9) & 7) * 8 + ((i >> 3) & 7)
    return row * cols + (i >> 12) % blocks * 64 + ((i >> 6) & 7) * 8 + (i & 7)


@inlined
def _pop_row(words, block, row, line):  # type: ignore[no-untyped-def]
    """Move the pending updates of one row of a block to `line`, by words; return their bitwise or."""
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


def apply_pending(
    pending: PendingUpdates,
    log_odds: Float32s,
    probabilities: Float32s | None,
    grey_map: GreyMap,
    window: Window,
) -> None:
    """Bring all cells with a pending update up to date, in place, and clear the pending updates.

    `pending` is from `empty_pending`, filled by `beams.merge_beams`; the window holds all cells with a
    pending update. `probabilities` are (rows, cols), as the log-odds; None where they are not kept. Grey,
    sums and changes of the grey map follow.
    """
    if window.rows:
        first = (window.row, window.col // BLOCK)
        end = (window.row + window.rows, -(-(window.col + window.cols) // BLOCK))
        line, total = np.empty(BLOCK, np.uint8), np.empty(BLOCK, np.uint8)
        is_kept = probabilities is not None
        p = probabilities if probabilities is not None else np.empty((0, 0), np.float32)
        cells = (pending.reshape(-1).view(np.uint64), log_odds, p, is_kept)
        grey = (grey_map.grey, grey_map.sums, grey_map.changed)
        scratch = (line, line.view(np.uint64), np.empty(BLOCK, np.uint32), total)
        _apply(*cells, *grey, *first, *end, *free_only_values(), *scratch)


@inlined
def _add_free_counts(counts, odds, largest):  # type: ignore[no-untyped-def]
    """Add the counted free observations, `largest` at most, to the log-odds of a line of pixels."""
    for k in range(largest):
        for c in range(odds.size):
            old = odds[c]
            odds[c] = add_one_free(old) if (counts[c] & np.uint8(UP_TO_DATE - 1)) > np.uint8(k) else old


@inlined
def _count_free_only(odds, counts, free_odds, total, n):  # type: ignore[no-untyped-def]
    """Write the observations of each of n pixels to `total`, at most 3; False if some are not free ones."""
    # The log-odds of such a pixel are one of four numbers, see `log_odds.free_only_values`.
    others = np.int32(0)
    for c in range(n):
        one, two, three = odds[c] == free_odds[1], odds[c] == free_odds[2], odds[c] == free_odds[3]
        others |= np.int32(not ((odds[c] == free_odds[0]) | one | two | three))
        known = np.uint8(one) + np.uint8(two) * np.uint8(2) + np.uint8(three) * np.uint8(3)
        total[c] = min(np.uint8(known + (counts[c] & np.uint8(UP_TO_DATE - 1))), np.uint8(3))
    return others == 0


@inlined
def _value_of_count(total, values):  # type: ignore[no-untyped-def]
    """Select the value that belongs to 0, 1, 2 or 3 free observations."""
    value = values[3]
    value = values[2] if total == np.uint8(2) else value
    value = values[1] if total == np.uint8(1) else value
    return values[0] if total == np.uint8(0) else value


@inlined
def _update_free_only(odds, grey, total, free_odds, free_grey, n):  # type: ignore[no-untyped-def]
    """Set log-odds and grey of n pixels of a line from their free observations; True if a grey changed."""
    change = np.uint16(0)
    for c in range(n):
        odds[c] = _value_of_count(total[c], free_odds)
    for c in range(n):
        after = _value_of_count(total[c], free_grey)
        change |= grey[c] ^ after
        grey[c] = after
    return change != 0


@inlined
def _update_grey(odds, grey):  # type: ignore[no-untyped-def]
    """Set the grey of a line of pixels from their log-odds; True if it has changed."""
    change = np.uint16(0)
    for c in range(odds.size):
        after = grey_of_probability(logistic(np.float64(odds[c])))
        change |= grey[c] ^ after
        grey[c] = after
    return change != 0


@inlined
def _update_probabilities(odds, probabilities, total, free_p, free_only):  # type: ignore[no-untyped-def]
    """Set the probabilities of a line of pixels from their free observations, or from their log-odds."""
    if free_only:
        for c in range(odds.size):
            probabilities[c] = _value_of_count(total[c], free_p)
    else:
        for c in range(odds.size):
            probabilities[c] = logistic(np.float64(odds[c]))


@inlined
def _affected_blocks(row, first, last):  # type: ignore[no-untyped-def]
    """Return bits of the 3 x 3 blocks that a change in a row of the middle one affects, or at its ends."""
    across = np.int64(2) | np.int64(first) | np.int64(last) << 2
    affected = across << 3
    if row == 0:
        affected |= across
    if row == BLOCK - 1:
        affected |= across << 6
    return np.uint16(affected)


@inlined
def _sum_cells(grey, row, col, column, sums):  # type: ignore[no-untyped-def]
    """Sum the grey of the 8 x 8 cells of one block; `column` is scratch."""
    for cell in range(8):
        for c in range(BLOCK):
            column[c] = 0
        for r in range(8):
            line = grey[BLOCK * row + 8 * cell + r + 1, BLOCK * col + 1 :]
            for c in range(BLOCK):
                column[c] += np.uint32(line[c])
        for k in range(8):
            total = np.uint32(0)
            for c in range(8):
                total += column[8 * k + c]
            sums[8 * row + cell, 8 * col + k] = total


@kernel(
    "void(u8[::1], f4[:,::1], f4[:,::1], b1, u2[:,::1], u4[:,::1], u2[:,::1], i8, i8, i8, i8, "
    "f4[::1], f4[::1], u2[::1], u1[::1], u8[::1], u4[::1], u1[::1])"
)
def _apply(  # type: ignore[no-untyped-def]
    words, log_odds, probabilities, is_kept, grey, sums, changed, top, left, bottom, right,
    odds, p, greys, counts, line, column, total,
):  # fmt: skip
    free_odds = (odds[0], odds[1], odds[2], odds[3])
    free_p = (p[0], p[1], p[2], p[3])
    free_grey = (greys[0], greys[1], greys[2], greys[3])
    for band in range(top // BLOCK, (bottom - 1) // BLOCK + 1):  # one row of blocks stays in the cache
        for row in range(max(top, BLOCK * band), min(bottom, BLOCK * band + BLOCK)):
            for block in range(left, right):
                combined = _pop_row(words, band * changed.shape[1] + block, row % BLOCK, line)
                if combined == 0:
                    continue
                start = BLOCK * block
                stop = min(start + BLOCK, log_odds.shape[1])
                row_odds, row_grey = log_odds[row, start:stop], grey[row + 1, start + 1 : stop + 1]
                full = stop - start == BLOCK  # loops of a length that is known take half the time
                if full:
                    free_only = _count_free_only(row_odds, counts, free_odds, total, BLOCK)
                else:
                    free_only = _count_free_only(row_odds, counts, free_odds, total, stop - start)
                first, last = row_grey[0], row_grey[-1]
                if free_only:
                    if full:
                        is_changed = _update_free_only(row_odds, row_grey, total, free_odds, free_grey, BLOCK)
                    else:
                        is_changed = _update_free_only(
                            row_odds, row_grey, total, free_odds, free_grey, stop - start
                        )
                else:
                    _add_free_counts(counts, row_odds, combined & np.uint8(UP_TO_DATE - 1))
                    is_changed = _update_grey(row_odds, row_grey)
                if is_changed:
                    changed[band, block] |= _affected_blocks(
                        row % BLOCK, row_grey[0] != first, row_grey[-1] != last
                    )
                if is_kept:
                    _update_probabilities(row_odds, probabilities[row, start:stop], total, free_p, free_only)
        for block in range(left, right):
            if changed[band, block] >> SELF & 1:
                _sum_cells(grey, max(band, 0), max(block, 0), column, sums)
