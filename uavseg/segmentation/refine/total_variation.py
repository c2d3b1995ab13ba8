"""Total variation: grey is evened out between neighbours, as far as weights allow, and decided.

u minimises sum (u - grey)^2 / 2 plus, for each pair of neighbours, a weight times |difference of u|: what
Rudin, Osher and Fatemi minimise (Physica D 60, 1992), on pairs of pixels. What lies above a threshold of u is
then the set that balances its distance from grey with the length of its boundary (Chambolle, J. Math. Imaging
Vis. 20, 2004). With eight neighbours, those across a corner counted by 0.7, that length hardly depends on
direction (Boykov and Kolmogorov, ICCV 2003). The dual problem is a flow between the two pixels of each pair,
no larger than their weight; it is solved pair by pair, in a fixed number of sweeps: so what happens to a
pixel depends on its neighbourhood alone. No more flows than there is between two pixels: u stays between the
least and the largest grey, and all of it, in half grey, fits 16 bits.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel

SWEEPS = 5
TV_HALO = 32  # columns, whole cells: a sweep looks six farther, two along rows, two in each pair of rows
MAX_WEIGHT = 16000  # a weight in half grey: gap and flow together stay within 16 bits
_CORNER = 45  # 64ths of a weight across corners
_PANEL = 2304  # columns: lines that are in work stay in the cache
_LINES = 2 * SWEEPS + 2  # that are in work
_VECTOR = 64  # pixels: loops over a multiple of them are over whole vectors
_GROUPS = 8  # of pairs of neighbours: two within a line, two down, four across corners
_GAP = 16  # pixels of no weight behind those of even and of odd columns


def threshold_tv(
    grey: NDArray[np.uint16],
    valid: NDArray[np.uint8],
    weights: NDArray[np.int16],
    greys: tuple[int, int],
    inside: NDArray[np.uint8],
) -> None:
    """Decide pixels by whether grey that is evened out lies in a range; those that do not change stay.

    Parameters
    ----------
    grey : (M, N) uint16 array
        M is even, N a multiple of 8.
    valid : (M, N) uint8 array
    weights : (M / 8, N / 8) int16 array
        Of the pairs of pixels of each cell, in half grey, 0 to `MOST`; the smaller counts between cells.
    greys : (int, int)
        The range.
    inside : (M, N) uint8 array
        1 where in range; changed in place.
    """
    low, high = (greys[0] + 1) // 2, greys[1] // 2  # in half grey
    for begin in range(0, grey.shape[1], _PANEL):
        end = min(begin + _PANEL, grey.shape[1])
        first, last = max(begin - TV_HALO, 0), min(end + TV_HALO, grey.shape[1])
        caps = weights[:, first // 8 : last // 8].repeat(4, axis=1)  # of even columns, and of odd ones
        busy = caps.any(axis=1).view(np.uint8)
        if busy.any():
            panel = np.array([first, begin, end])
            _threshold_tv(
                grey, valid, caps, busy, panel, low, high, *_line_buffers((last - first) // 2), inside
            )


def _line_buffers(half: int) -> tuple[NDArray[Any], ...]:
    """What each line in work has: u and weights of its pixels, weights across corners, what flows between the
    eight groups of pairs of neighbours; then where groups begin.

    In a line, the pixels of even columns come first. A group touches no pixel twice, and begins at one pixel
    of the upper line and at one of the lower, (8, 2).
    """
    length = -(-half // _VECTOR) * _VECTOR
    even, odd, right = 0, length + _GAP, 1
    within = [(even, odd), (odd, even + right)]
    down = [(even, even), (odd, odd)]
    falling = [(even, odd), (odd, even + right)]
    rising = [(even + right, odd), (odd, even)]
    pixels = np.zeros((3, _LINES * 2 * (length + _GAP)), np.int16)
    flows = np.zeros(_LINES * _GROUPS * length, np.int16)
    return *pixels, flows, np.array(within + down + falling + rising)


@inlined
def load_row(grey, valid, weights, first, tones, caps, corners, even, odd):  # type: ignore[no-untyped-def]
    """Take a row of pixels into a line."""
    one, two = np.uintp(1), np.uintp(2)
    for k in range(np.uintp(weights.shape[0])):
        tones[even + k] = grey[first + two * k] >> 1
        tones[odd + k] = grey[first + two * k + one] >> 1
    for k in range(np.uintp(weights.shape[0])):
        caps[even + k] = weights[k] * valid[first + two * k]
        caps[odd + k] = weights[k] * valid[first + two * k + one]
    for k in range(even, odd + np.uintp(weights.shape[0])):
        corners[k] = np.int16(np.int32(caps[k]) * np.int32(_CORNER) >> 6)


@inlined
def relax_pairs(tones, caps, a, b, flows, at, length):  # type: ignore[no-untyped-def]
    """Let half of the gap between two pixels flow, as far as the smaller weight lets it."""
    for k in range(length):
        half = np.int16(np.int16(tones[b + k] - tones[a + k]) >> 1)
        wanted = np.int16(flows[at + k] + half)
        limit = min(caps[a + k], caps[b + k])
        flowing = max(min(wanted, limit), np.int16(-limit))
        more = np.int16(flowing - flows[at + k])
        flows[at + k] = flowing
        tones[a + k] = np.int16(tones[a + k] + more)
        tones[b + k] = np.int16(tones[b + k] - more)


@inlined
def relax_groups(begin, end, groups, tones, caps, flows, upper, lower, length):  # type: ignore[no-untyped-def]
    """Even out some groups of two lines."""
    for k in range(begin, end):
        a = np.uintp(upper * 2 * (length + _GAP) + groups[k, 0])
        b = np.uintp(lower * 2 * (length + _GAP) + groups[k, 1])
        relax_pairs(tones, caps, a, b, flows, np.uintp((upper * _GROUPS + k) * length), np.uintp(length))


@inlined
def threshold_pixel(tone, grey, valid, low, high, inside):  # type: ignore[no-untyped-def]
    """Where a pixel lies, 0 or 1."""
    found = np.uint8(low <= tone) & np.uint8(tone <= high) & valid
    return found if tone != np.int16(grey >> 1) else inside


@inlined
def threshold_row(tones, even, odd, grey, valid, low, high, begin, half, inside):  # type: ignore[no-untyped-def]
    """Decide a row of pixels."""
    for k in range(half):
        c = begin + np.uintp(2) * k
        d = c + np.uintp(1)
        inside[c] = threshold_pixel(tones[even + k], grey[c], valid[c], low, high, inside[c])
        inside[d] = threshold_pixel(tones[odd + k], grey[d], valid[d], low, high, inside[d])


@kernel(
    "void(u2[:,::1], u1[:,::1], i2[:,::1], u1[::1], i8[::1], i2, i2, i2[::1], i2[::1], i2[::1], i2[::1],"
    " i8[:,::1], u1[:,::1])"
)
def _threshold_tv(  # type: ignore[no-untyped-def]
    grey, valid, weights, busy, panel, low, high, tones, caps, corners, flows, groups, inside
):
    # All sweeps go over the rows at once, each a pair of rows behind the one before: few lines are in work.
    rows = grey.shape[0]
    length = flows.shape[0] // (_LINES * _GROUPS)
    width = length + _GAP
    first, begin, half = np.uintp(panel[0]), np.uintp(panel[1]), np.uintp(panel[2] - panel[1]) // np.uintp(2)
    for time in range(rows // 2 + SWEEPS):
        for row in range(2 * time, min(2 * time + 2, rows)):
            if busy[row // 8]:
                line = row % _LINES
                even, odd = np.uintp(2 * line * width), np.uintp((2 * line + 1) * width)
                load_row(grey[row], valid[row], weights[row // 8], first, tones, caps, corners, even, odd)
                flows[line * _GROUPS * length : (line + 1) * _GROUPS * length] = 0
        for sweep in range(SWEEPS):
            row = 2 * (time - sweep)
            if 0 <= row < rows and busy[row // 8]:
                above, line, below = (row - 1) % _LINES, row % _LINES, (row + 1) % _LINES
                relax_groups(0, 2, groups, tones, caps, flows, line, line, length)
                relax_groups(0, 2, groups, tones, caps, flows, below, below, length)
                relax_groups(2, 4, groups, tones, caps, flows, line, below, length)
                relax_groups(4, 8, groups, tones, corners, flows, line, below, length)
                if row > 0 and busy[(row - 1) // 8]:
                    relax_groups(2, 4, groups, tones, caps, flows, above, line, length)
                    relax_groups(4, 8, groups, tones, corners, flows, above, line, length)
        done = 2 * (time - SWEEPS + 1)
        for row in range(max(done - 1, 0), min(done + 1, rows)):
            if busy[row // 8]:
                even = np.uintp(2 * (row % _LINES) * width) + (begin - first) // np.uintp(2)
                odd = even + np.uintp(width)
                threshold_row(tones, even, odd, grey[row], valid[row], low, high, begin, half, inside[row])
