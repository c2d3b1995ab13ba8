"""Evidence taken into a map: log-odds, probability and grey of each cell, in step.

Beams mark the cells that they touch, see `beams`: with how often a cell was said to be free, or with the word
that its log-odds are up to date already. Here the marks are cleared and everything follows them, and it is
noted which blocks of the segmentation see a change.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.occupancy.mapping.grey_map import SELF, Ground
from uavseg.occupancy.mapping.log_odds import Singles, grey_of, probability, usual
from uavseg.occupancy.mapping.pending import TOLD, Marks, free_once, pick_up
from uavseg.raster.tiling import Window
from uavseg.units import BLOCK


def take(
    marks: Marks,
    log_odds: Singles,
    probabilities: Singles | None,
    ground: Ground,
    window: Window,
) -> None:
    """Bring all cells up to date that are marked, and clear their marks.

    Parameters
    ----------
    marks : (B, C, 8, 8, 8, 8) uint8 array
        See `marks.marks_of`; from `beams.merge_beams`.
    log_odds : (rows, cols) float32 array
    probabilities : (rows, cols) float32 array or None
        None where nobody wants to know them.
    ground : Ground
        Its grey, sums and what has changed follow.
    window : Window
        All marked cells lie in it.
    """
    if window.rows:
        first = (window.row, window.col // BLOCK)
        end = (window.row + window.rows, -(-(window.col + window.cols) // BLOCK))
        line, column = np.empty(BLOCK, np.uint8), np.empty(BLOCK, np.uint32)
        kept = probabilities is not None
        p = probabilities if probabilities is not None else np.empty((0, 0), np.float32)
        state = (
            marks.reshape(-1).view(np.uint64),
            log_odds,
            p,
            kept,
            ground.grey,
            ground.sums,
            ground.changed,
        )
        _take(*state, *first, *end, *usual(), line, line.view(np.uint64), column)


@inlined
def add_free(marks, odds, most):  # type: ignore[no-untyped-def]
    """Add to the log-odds of a line of pixels how often, `most` times, they were said to be free."""
    for k in range(most):
        for c in range(odds.size):
            told = odds[c]
            odds[c] = free_once(told) if (marks[c] & np.uint8(TOLD - 1)) > np.uint8(k) else told


@inlined
def are_usual(odds, usual):  # type: ignore[no-untyped-def]
    """Whether nothing but free was ever said of any pixel of a line."""
    strange = np.int32(0)
    for c in range(odds.size):
        one = (odds[c] == usual[0]) | (odds[c] == usual[1]) | (odds[c] == usual[2]) | (odds[c] == usual[3])
        strange |= np.int32(not one)
    return strange == 0


@inlined
def chosen(odds, usual, values):  # type: ignore[no-untyped-def]
    """What goes with usual log-odds."""
    value = values[3]
    value = values[2] if odds == usual[2] else value
    value = values[1] if odds == usual[1] else value
    return values[0] if odds == usual[0] else value


@inlined
def show(odds, grey, usual, values, plain):  # type: ignore[no-untyped-def]
    """Grey of a line of pixels from their log-odds; gives whether it has changed."""
    change = np.uint16(0)
    if plain:
        for c in range(odds.size):
            after = chosen(odds[c], usual, values)
            change |= grey[c] ^ after
            grey[c] = after
    else:
        for c in range(odds.size):
            after = grey_of(probability(np.float64(odds[c])))
            change |= grey[c] ^ after
            grey[c] = after
    return change != 0


@inlined
def tell(odds, probabilities, usual, values, plain):  # type: ignore[no-untyped-def]
    """Probabilities of a line of pixels from their log-odds."""
    if plain:
        for c in range(odds.size):
            probabilities[c] = chosen(odds[c], usual, values)
    else:
        for c in range(odds.size):
            probabilities[c] = probability(np.float64(odds[c]))


@inlined
def who_sees(row, first, last):  # type: ignore[no-untyped-def]
    """Bits of the blocks that see a change in a row of a block, in its first column or in its last."""
    across = np.int64(2) | np.int64(first) | np.int64(last) << 2
    seen = across << 3
    if row == 0:
        seen |= across
    if row == BLOCK - 1:
        seen |= across << 6
    return np.uint16(seen)


@inlined
def sum_cells(grey, row, col, column, sums):  # type: ignore[no-untyped-def]
    """Sums of the cells of 8 x 8 of one block; `column` is scratch."""
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


_TAKE = (
    "void(u8[::1], f4[:,::1], f4[:,::1], b1, u2[:,::1], u4[:,::1], u2[:,::1], i8, i8, i8, i8, "
    "f4[::1], f4[::1], u2[::1], u1[::1], u8[::1], u4[::1])"
)


@kernel(_TAKE)
def _take(  # type: ignore[no-untyped-def]
    words,
    log_odds,
    probabilities,
    kept,
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
    marks,
    line,
    column,
):
    usual = (odds[0], odds[1], odds[2], odds[3])
    usual_p = (p[0], p[1], p[2], p[3])
    usual_grey = (greys[0], greys[1], greys[2], greys[3])
    for band in range(top // BLOCK, (bottom - 1) // BLOCK + 1):  # while it is in the processor's cache
        for row in range(max(top, BLOCK * band), min(bottom, BLOCK * band + BLOCK)):
            for block in range(left, right):
                together = pick_up(words, band * changed.shape[1] + block, row % BLOCK, line)
                if together == 0:
                    continue
                start = BLOCK * block
                stop = min(start + BLOCK, log_odds.shape[1])
                here, shown = log_odds[row, start:stop], grey[row + 1, start + 1 : stop + 1]
                add_free(marks, here, together & np.uint8(TOLD - 1))
                plain = are_usual(here, usual)
                first, last = shown[0], shown[-1]
                if show(here, shown, usual, usual_grey, plain):
                    changed[band, block] |= who_sees(row % BLOCK, shown[0] != first, shown[-1] != last)
                if kept:
                    tell(here, probabilities[row, start:stop], usual, usual_p, plain)
        for block in range(left, right):
            if changed[band, block] >> SELF & 1:
                sum_cells(grey, max(band, 0), max(block, 0), column, sums)
