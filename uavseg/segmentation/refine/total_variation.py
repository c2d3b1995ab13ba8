"""Total-variation denoising (Rudin-Osher-Fatemi) and thresholding of its result.

u minimises sum (u - grey)^2 / 2 plus, for each pair of neighbours, a weight times |difference of u| (Rudin,
Osher and Fatemi, Physica D 60, 1992). The set where u is above a threshold then balances the distance from
grey with the length of the boundary (Chambolle, J. Math. Imaging Vis. 20, 2004). With eight neighbours, the
diagonal ones weighted by 0.7, that length hardly depends on direction (Boykov and Kolmogorov, ICCV 2003). The
dual problem is a flow between the two pixels of each pair, bounded by their weight. It is solved pair by pair
in a fixed number of sweeps, so that a result depends on a bounded neighbourhood only. A pair never exchanges
more than half its difference, so u stays between the minimum and the maximum of grey and, in units of half a
grey, fits 16 bits.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

SWEEPS = 5
TV_HALO = 32  # columns, whole cells: a sweep reaches six columns, two along rows, two in each pair of rows
MAX_WEIGHT = 16000  # in units of half a grey: difference plus flow fit 16 bits
_DIAGONAL = 45  # weight of a diagonal pair, in 64ths
_PANEL = 2304  # columns: the active lines fit the cache
_LINES = 2 * SWEEPS + 2  # active lines
_VECTOR = 64  # pixels: loops over a multiple of it need no remainder loop
_GROUPS = 8  # groups of pairs of neighbours: two within a line, two vertical, four diagonal
_GAP = 16  # pixels of weight 0 behind those of the even and of the odd columns


def threshold_tv(
    grey: NDArray[np.uint16],
    valid: NDArray[np.uint8],
    weights: NDArray[np.int16],
    greys: tuple[int, int],
    inside: NDArray[np.uint8],
) -> None:
    """Classify pixels by whether denoised grey lies in a range; unchanged pixels keep their side.

    Parameters
    ----------
    grey : (M, N) uint16 array
        M is even, N a multiple of 8.
    valid : (M, N) uint8 array
    weights : (M / 8, N / 8) int16 array
        Weight of the pixel pairs of each cell, in units of half a grey, 0 to `MAX_WEIGHT`; between cells the
        smaller one holds.
    greys : (int, int)
        The range.
    inside : (M, N) uint8 array
        1 where in range; changed in place.
    """
    low, high = (greys[0] + 1) // 2, greys[1] // 2  # in units of half a grey
    for begin, end in _panels(grey.shape[1]):
        found = _Panel.of(weights, begin, end, grey.shape[1])
        if found is not None:
            _threshold_tv(grey, valid, *found, low, high, *_line_buffers(found.half), inside)


def classify_tv(
    grey: NDArray[np.uint16],
    valid: NDArray[np.uint8],
    weights: NDArray[np.int16],
    table: NDArray[np.uint8],
    kinds: NDArray[np.uint8],
) -> None:
    """Classify pixels by the kind of their denoised grey; unchanged pixels keep their kind.

    Parameters
    ----------
    grey, valid, weights
        As of `threshold_tv`.
    table : (65536,) uint8 array
        The kind of each grey.
    kinds : (M, N) uint8 array
        Changed in place.
    """
    half_greys = np.ascontiguousarray(table[::2])
    for begin, end in _panels(grey.shape[1]):
        found = _Panel.of(weights, begin, end, grey.shape[1])
        if found is not None:
            _classify_tv(grey, valid, *found, half_greys, *_line_buffers(found.half), kinds)


def _panels(cols: int) -> Iterator[tuple[int, int]]:
    """First column of each panel, and the column after its last."""
    for begin in range(0, cols, _PANEL):
        yield begin, min(begin + _PANEL, cols)


class _Panel(NamedTuple):
    """Weights of the even columns of a panel with its halo, and of the odd; active rows of cells; columns."""

    weights: NDArray[np.int16]
    active: NDArray[np.uint8]
    columns: NDArray[np.int64]

    @classmethod
    def of(cls, weights: NDArray[np.int16], begin: int, end: int, cols: int) -> "_Panel | None":
        """The panel of some columns; None where no cell is active."""
        first, last = max(begin - TV_HALO, 0), min(end + TV_HALO, cols)
        column_weights = weights[:, first // 8 : last // 8].repeat(4, axis=1)
        active = np.asarray(column_weights.any(axis=1)).view(np.uint8)
        return cls(column_weights, active, np.array([first, begin, end])) if active.any() else None

    @property
    def half(self) -> int:
        """Number of the even columns."""
        return int(self.weights.shape[1])


def _line_buffers(half: int) -> tuple[NDArray[Any], ...]:
    """Buffers of the active lines: u, weights, diagonal weights, and flows of the eight groups of pairs.

    In a line, the pixels of even columns come first. A group touches no pixel twice. The last array, (8, 2),
    holds the first pixel of each group in the upper and in the lower line. The two diagonals of a square of
    2 x 2 pixels follow each other: they share no pixel, so a mirrored image is denoised alike.
    """
    length = -(-half // _VECTOR) * _VECTOR
    even, odd, right = 0, length + _GAP, 1
    within = [(even, odd), (odd, even + right)]
    down = [(even, even), (odd, odd)]
    from_even = [(even, odd), (odd, even)]  # falling, rising
    from_odd = [(odd, even + right), (even + right, odd)]
    pixels = np.zeros((3, _LINES * 2 * (length + _GAP)), np.int16)
    flows = np.zeros(_LINES * _GROUPS * length, np.int16)
    return *pixels, flows, np.array(within + down + from_even + from_odd)


@inlined
def load_row(grey, valid, cell_weights, first, u, weights, diagonals, even, odd):  # type: ignore[no-untyped-def]
    """Load a row of pixels into a line."""
    one, two = np.uintp(1), np.uintp(2)
    for k in range(np.uintp(cell_weights.shape[0])):
        u[even + k] = grey[first + two * k] >> 1
        u[odd + k] = grey[first + two * k + one] >> 1
    for k in range(np.uintp(cell_weights.shape[0])):
        weights[even + k] = cell_weights[k] * valid[first + two * k]
        weights[odd + k] = cell_weights[k] * valid[first + two * k + one]
    for k in range(even, odd + np.uintp(cell_weights.shape[0])):
        diagonals[k] = np.int16(np.int32(weights[k]) * np.int32(_DIAGONAL) >> 6)


@inlined
def relax_pairs(u, weights, a, b, flows, at, length):  # type: ignore[no-untyped-def]
    """Move half of the difference between the pixels of each pair, bounded by the smaller weight."""
    for k in range(length):
        difference = np.int16(u[b + k] - u[a + k])
        half = np.int16(np.int16(difference - (difference >> 15)) >> 1)  # rounded towards 0
        flow = np.int16(flows[at + k] + half)
        limit = min(weights[a + k], weights[b + k])
        bounded = max(min(flow, limit), np.int16(-limit))
        change = np.int16(bounded - flows[at + k])
        flows[at + k] = bounded
        u[a + k] = np.int16(u[a + k] + change)
        u[b + k] = np.int16(u[b + k] - change)


@inlined
def relax_groups(begin, end, groups, u, weights, flows, upper, lower, length):  # type: ignore[no-untyped-def]
    """Relax the pairs of some groups between two lines."""
    for k in range(begin, end):
        a = np.uintp(upper * 2 * (length + _GAP) + groups[k, 0])
        b = np.uintp(lower * 2 * (length + _GAP) + groups[k, 1])
        relax_pairs(u, weights, a, b, flows, np.uintp((upper * _GROUPS + k) * length), np.uintp(length))


@inlined
def threshold_pixel(value, grey, valid, low, high, inside):  # type: ignore[no-untyped-def]
    """1 where the denoised grey of a pixel is in range; an unchanged pixel keeps its side."""
    found = np.uint8(low <= value) & np.uint8(value <= high) & valid
    return found if value != np.int16(grey >> 1) else inside


@inlined
def threshold_row(u, even, odd, grey, valid, low, high, begin, half, inside):  # type: ignore[no-untyped-def]
    """Classify a row of pixels."""
    for k in range(half):
        c = begin + np.uintp(2) * k
        d = c + np.uintp(1)
        inside[c] = threshold_pixel(u[even + k], grey[c], valid[c], low, high, inside[c])
        inside[d] = threshold_pixel(u[odd + k], grey[d], valid[d], low, high, inside[d])


@inlined
def classify_row(u, even, odd, grey, valid, table, begin, half, kinds):  # type: ignore[no-untyped-def]
    """The kinds of a row of pixels by their denoised grey; an unchanged pixel keeps its kind."""
    for k in range(half):
        c = begin + np.uintp(2) * k
        d = c + np.uintp(1)
        if u[even + k] != np.int16(grey[c] >> 1):
            kinds[c] = table[u[even + k]] * valid[c]
        if u[odd + k] != np.int16(grey[d] >> 1):
            kinds[d] = table[u[odd + k]] * valid[d]


@inlined
def relax_step(  # type: ignore[no-untyped-def]
    step, grey, valid, cell_weights, active, first, u, weights, diagonals, flows, groups, length
):
    """Load two rows, and run each sweep on two rows, a pair of rows behind the sweep before."""
    rows = grey.shape[0]
    width = length + _GAP
    for row in range(2 * step, min(2 * step + 2, rows)):
        if active[row // 8]:
            line = row % _LINES
            even, odd = np.uintp(2 * line * width), np.uintp((2 * line + 1) * width)
            load_row(grey[row], valid[row], cell_weights[row // 8], first, u, weights, diagonals, even, odd)
            flows[line * _GROUPS * length : (line + 1) * _GROUPS * length] = 0
    for sweep in range(SWEEPS):
        row = 2 * (step - sweep)
        if 0 <= row < rows and active[row // 8]:
            above, line, below = (row - 1) % _LINES, row % _LINES, (row + 1) % _LINES
            relax_groups(0, 2, groups, u, weights, flows, line, line, length)
            relax_groups(0, 2, groups, u, weights, flows, below, below, length)
            relax_groups(2, 4, groups, u, weights, flows, line, below, length)
            relax_groups(4, 8, groups, u, diagonals, flows, line, below, length)
            if row > 0 and active[(row - 1) // 8]:
                relax_groups(2, 4, groups, u, weights, flows, above, line, length)
                relax_groups(4, 8, groups, u, diagonals, flows, above, line, length)


@kernel(
    "void(u2[:,::1], u1[:,::1], i2[:,::1], u1[::1], i8[::1], i2, i2, i2[::1], i2[::1], i2[::1], i2[::1],"
    " i8[:,::1], u1[:,::1])"
)
def _threshold_tv(  # type: ignore[no-untyped-def]
    grey, valid, cell_weights, active, panel, low, high, u, weights, diagonals, flows, groups, inside
):
    # All sweeps run over the rows together, each a pair of rows behind the one before: few lines are active.
    rows = grey.shape[0]
    length = flows.shape[0] // (_LINES * _GROUPS)
    width = length + _GAP
    first, begin, half = np.uintp(panel[0]), np.uintp(panel[1]), np.uintp(panel[2] - panel[1]) // np.uintp(2)
    for step in range(rows // 2 + SWEEPS):
        relax_step(
            step, grey, valid, cell_weights, active, first, u, weights, diagonals, flows, groups, length
        )
        done = 2 * (step - SWEEPS + 1)
        for row in range(max(done - 1, 0), min(done + 1, rows)):
            if active[row // 8]:
                even = np.uintp(2 * (row % _LINES) * width) + (begin - first) // np.uintp(2)
                odd = even + np.uintp(width)
                threshold_row(u, even, odd, grey[row], valid[row], low, high, begin, half, inside[row])


@kernel(
    "void(u2[:,::1], u1[:,::1], i2[:,::1], u1[::1], i8[::1], u1[::1], i2[::1], i2[::1], i2[::1], i2[::1],"
    " i8[:,::1], u1[:,::1])"
)
def _classify_tv(  # type: ignore[no-untyped-def]
    grey, valid, cell_weights, active, panel, table, u, weights, diagonals, flows, groups, kinds
):
    # As _threshold_tv, with a table of kinds in place of a range.
    rows = grey.shape[0]
    length = flows.shape[0] // (_LINES * _GROUPS)
    width = length + _GAP
    first, begin, half = np.uintp(panel[0]), np.uintp(panel[1]), np.uintp(panel[2] - panel[1]) // np.uintp(2)
    for step in range(rows // 2 + SWEEPS):
        relax_step(
            step, grey, valid, cell_weights, active, first, u, weights, diagonals, flows, groups, length
        )
        done = 2 * (step - SWEEPS + 1)
        for row in range(max(done - 1, 0), min(done + 1, rows)):
            if active[row // 8]:
                even = np.uintp(2 * (row % _LINES) * width) + (begin - first) // np.uintp(2)
                odd = even + np.uintp(width)
                classify_row(u, even, odd, grey[row], valid[row], table, begin, half, kinds[row])
