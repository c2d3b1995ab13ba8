"""Apply pending updates of an occupancy map: log-odds, probability and grey of each cell change together.

The beams leave a pending update on each cell that they cross, see `pending`: a count of free observations, or
the note that the log-odds are up to date. Here the pending updates are cleared, the cells follow, and the
blocks of the segmentation that a changed grey affects are recorded.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.occupancy.mapping.grey_map import SELF, GreyMap
from uavseg.occupancy.mapping.log_odds import Float32s, free_only_values, grey_of_probability, logistic
from uavseg.occupancy.mapping.pending import UP_TO_DATE, PendingUpdates, add_one_free, pop_row
from uavseg.raster.grid.tiling import Window
from uavseg.units import BLOCK


def apply_pending(
    pending: PendingUpdates,
    log_odds: Float32s,
    probabilities: Float32s | None,
    grey_map: GreyMap,
    window: Window,
) -> None:
    """Bring all cells with a pending update up to date, in place, and clear the pending updates.

    Parameters
    ----------
    pending : (B, C, 8, 8, 8, 8) uint8 array
        See `pending.empty_pending`; filled by `beams.merge_beams`.
    log_odds : (rows, cols) float32 array
    probabilities : (rows, cols) float32 array or None
        None where they are not kept.
    grey_map : GreyMap
        Its grey, sums and changes follow.
    window : Window
        Holds all cells with a pending update.
    """
    if window.rows:
        first = (window.row, window.col // BLOCK)
        end = (window.row + window.rows, -(-(window.col + window.cols) // BLOCK))
        line, column = np.empty(BLOCK, np.uint8), np.empty(BLOCK, np.uint32)
        total = np.empty(BLOCK, np.uint8)
        is_kept = probabilities is not None
        p = probabilities if probabilities is not None else np.empty((0, 0), np.float32)
        state = (
            pending.reshape(-1).view(np.uint64),
            log_odds,
            p,
            is_kept,
            grey_map.grey,
            grey_map.sums,
            grey_map.changed,
        )
        _apply(*state, *first, *end, *free_only_values(), line, line.view(np.uint64), column, total)


@inlined
def add_free_counts(counts, odds, largest):  # type: ignore[no-untyped-def]
    """Add the counted free observations, `largest` at most, to the log-odds of a line of pixels."""
    for k in range(largest):
        for c in range(odds.size):
            old = odds[c]
            odds[c] = add_one_free(old) if (counts[c] & np.uint8(UP_TO_DATE - 1)) > np.uint8(k) else old


@inlined
def count_free_only(odds, counts, free_odds, total, n):  # type: ignore[no-untyped-def]
    """Number of observations of each of n pixels of a line, at most 3, if all of them are free ones.

    The log-odds of such a pixel are one of four numbers, see `log_odds.free_only_values`; the pending counts
    are added. Writes the numbers to `total`, and returns whether every pixel is one of these.
    """
    others = np.int32(0)
    for c in range(n):
        one, two, three = odds[c] == free_odds[1], odds[c] == free_odds[2], odds[c] == free_odds[3]
        others |= np.int32(not ((odds[c] == free_odds[0]) | one | two | three))
        known = np.uint8(one) + np.uint8(two) * np.uint8(2) + np.uint8(three) * np.uint8(3)
        total[c] = min(np.uint8(known + (counts[c] & np.uint8(UP_TO_DATE - 1))), np.uint8(3))
    return others == 0


@inlined
def value_of_count(total, values):  # type: ignore[no-untyped-def]
    """The value that belongs to 0, 1, 2 or 3 free observations."""
    value = values[3]
    value = values[2] if total == np.uint8(2) else value
    value = values[1] if total == np.uint8(1) else value
    return values[0] if total == np.uint8(0) else value


@inlined
def update_free_only(odds, grey, total, free_odds, free_grey, n):  # type: ignore[no-untyped-def]
    """Set log-odds and grey of n pixels of a line from their free observations; True if a grey changed."""
    change = np.uint16(0)
    for c in range(n):
        odds[c] = value_of_count(total[c], free_odds)
    for c in range(n):
        after = value_of_count(total[c], free_grey)
        change |= grey[c] ^ after
        grey[c] = after
    return change != 0


@inlined
def update_grey(odds, grey):  # type: ignore[no-untyped-def]
    """Set the grey of a line of pixels from their log-odds; True if it has changed."""
    change = np.uint16(0)
    for c in range(odds.size):
        after = grey_of_probability(logistic(np.float64(odds[c])))
        change |= grey[c] ^ after
        grey[c] = after
    return change != 0


@inlined
def update_probabilities(odds, probabilities, total, free_p, free_only):  # type: ignore[no-untyped-def]
    """Set the probabilities of a line of pixels from their free observations, or from their log-odds."""
    if free_only:
        for c in range(odds.size):
            probabilities[c] = value_of_count(total[c], free_p)
    else:
        for c in range(odds.size):
            probabilities[c] = logistic(np.float64(odds[c]))


@inlined
def affected_blocks(row, first, last):  # type: ignore[no-untyped-def]
    """Bits of the 3 x 3 blocks that a change in one row of the middle block affects, see `GreyMap`.

    `first` and `last` say whether the first and the last column of the row have changed.
    """
    across = np.int64(2) | np.int64(first) | np.int64(last) << 2
    affected = across << 3
    if row == 0:
        affected |= across
    if row == BLOCK - 1:
        affected |= across << 6
    return np.uint16(affected)


@inlined
def sum_cells(grey, row, col, column, sums):  # type: ignore[no-untyped-def]
    """Grey sums of the 8 x 8 cells of one block; `column` is scratch."""
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


_APPLY = (
    "void(u8[::1], f4[:,::1], f4[:,::1], b1, u2[:,::1], u4[:,::1], u2[:,::1], i8, i8, i8, i8, "
    "f4[::1], f4[::1], u2[::1], u1[::1], u8[::1], u4[::1], u1[::1])"
)


@kernel(_APPLY)
def _apply(  # type: ignore[no-untyped-def]
    words,
    log_odds,
    probabilities,
    is_kept,
    grey,
    sums,
    changed,
    top,
    left,
    bottom,
    right,
    odds,
    p,
    greys,
    counts,
    line,
    column,
    total,
):
    free_odds = (odds[0], odds[1], odds[2], odds[3])
    free_p = (p[0], p[1], p[2], p[3])
    free_grey = (greys[0], greys[1], greys[2], greys[3])
    for band in range(top // BLOCK, (bottom - 1) // BLOCK + 1):  # one row of blocks stays in the cache
        for row in range(max(top, BLOCK * band), min(bottom, BLOCK * band + BLOCK)):
            for block in range(left, right):
                combined = pop_row(words, band * changed.shape[1] + block, row % BLOCK, line)
                if combined == 0:
                    continue
                start = BLOCK * block
                stop = min(start + BLOCK, log_odds.shape[1])
                own, own_grey = log_odds[row, start:stop], grey[row + 1, start + 1 : stop + 1]
                full = stop - start == BLOCK  # loops of a length that is known take half the time
                if full:
                    free_only = count_free_only(own, counts, free_odds, total, BLOCK)
                else:
                    free_only = count_free_only(own, counts, free_odds, total, stop - start)
                first, last = own_grey[0], own_grey[-1]
                if free_only:
                    if full:
                        is_changed = update_free_only(own, own_grey, total, free_odds, free_grey, BLOCK)
                    else:
                        is_changed = update_free_only(
                            own, own_grey, total, free_odds, free_grey, stop - start
                        )
                else:
                    add_free_counts(counts, own, combined & np.uint8(UP_TO_DATE - 1))
                    is_changed = update_grey(own, own_grey)
                if is_changed:
                    changed[band, block] |= affected_blocks(
                        row % BLOCK, own_grey[0] != first, own_grey[-1] != last
                    )
                if is_kept:
                    update_probabilities(own, probabilities[row, start:stop], total, free_p, free_only)
        for block in range(left, right):
            if changed[band, block] >> SELF & 1:
                sum_cells(grey, max(band, 0), max(block, 0), column, sums)
