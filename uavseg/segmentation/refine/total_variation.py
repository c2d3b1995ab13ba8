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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Integers, Uint8s, Uint16s
from uavseg.segmentation.blocks.dilation import dilate
from uavseg.segmentation.refine.noise import NOISE_SIDE, estimate_noise
from uavseg.segmentation.refine.specks import drop_specks
from uavseg.units import CELL, GREY_LEVELS

Arrays = tuple[NDArray[Any], ...]

SWEEPS = 5
TV_HALO = 32  # columns, whole cells: a sweep reaches six columns, two along rows, two in each pair of rows
MAX_WEIGHT = 16000  # in units of half a grey: difference plus flow fit 16 bits
_DIAGONAL = 45  # weight of a diagonal pair, in 64ths
_PANEL = 2304  # columns: the active lines fit the cache
_LINES = 2 * SWEEPS + 2  # active lines
_VECTOR = 64  # pixels: loops over a multiple of it need no remainder loop
_CHUNK = 32  # even columns: what has no weight is left out by so many
_GROUPS = 8  # groups of pairs of neighbours: two within a line, two vertical, four diagonal
_GAP = 16  # pixels of weight 0 behind those of the even and of the odd columns
_WEIGHT_PER_NOISE = 0.34  # weight of a pair of neighbours / standard deviation of the noise


def _classify_panels(
    grey: Uint16s, valid: Uint8s, weights: NDArray[np.int16], table: Uint8s, classes: Uint8s
) -> None:
    """Classify pixels by the class of their denoised grey, in place; unchanged pixels keep their class."""
    # M is even, N a multiple of 8. A cell has one weight, in units of half a grey, 0 to `MAX_WEIGHT`; between
    # cells the smaller one holds.
    half_greys = np.ascontiguousarray(table[::2])
    for panel, buffers in _panels(weights, grey.shape[1]):
        _classify_tv(grey, valid, *panel, half_greys, *buffers, classes)


def _panels(weights: NDArray[np.int16], cols: int) -> Iterator[tuple[Arrays, Arrays]]:
    """Yield the panels with active cells, each with its line buffers."""
    # A panel is the weights of its even columns with its halo, which are those of the odd ones too; its runs
    # of active chunks; its first column in the halo, its first column, and the column after its last.
    for begin in range(0, cols, _PANEL):
        end = min(begin + _PANEL, cols)
        first, last = max(begin - TV_HALO, 0), min(end + TV_HALO, cols)
        column_weights = weights[:, first // 8 : last // 8].repeat(4, axis=1)
        if column_weights.any():
            columns = np.array([first, begin, end])
            yield (column_weights, _runs(column_weights), columns), _line_buffers(column_weights.shape[1])


def _runs(weights: NDArray[np.int16]) -> Integers:
    """Return the runs of active chunks in each row of cells, a (2, M, R, 2) array."""
    # A chunk is active where a weight in it, or in the cell on either side, is not 0: no flow leaves it. Runs
    # are first even columns, and those after the last, of a row of cells, and of it and the row above
    # together; an empty run is behind the last.
    rows, half = weights.shape
    chunks = -(-half // _CHUNK)
    any_weight = np.zeros((rows, (chunks + 2) * _CHUNK // 4), np.bool_)  # of a cell
    any_weight[:, _CHUNK // 4 :][:, : half // 4] = weights[:, ::4] > 0
    wide = np.lib.stride_tricks.sliding_window_view(any_weight, _CHUNK // 4 + 2, axis=1)
    active = np.asarray(wide[:, _CHUNK // 4 - 1 :: _CHUNK // 4][:, :chunks].any(axis=2))
    with_above = active & np.concatenate([active[:1], active[:-1]])
    runs = np.zeros((2, rows, chunks // 2 + 2, 2), np.int64)
    _find_runs(np.stack([active, with_above]).view(np.uint8), runs)
    return runs


@kernel("void(u1[:,:,::1], i8[:,:,:,::1])")
def _find_runs(active, runs):  # type: ignore[no-untyped-def]
    for kind in range(2):
        for row in range(active.shape[1]):
            count = 0
            before = np.uint8(0)
            for chunk in range(active.shape[2]):
                if active[kind, row, chunk] > before:
                    runs[kind, row, count, 0] = chunk * _CHUNK
                if active[kind, row, chunk]:
                    runs[kind, row, count, 1] = (chunk + 1) * _CHUNK
                elif before:
                    count += 1
                before = active[kind, row, chunk]


def _line_buffers(half: int) -> Arrays:
    """Allocate the active lines: u, weights, diagonal weights, and flows of the eight groups of pairs."""
    # In a line, the pixels of even columns come first. A group touches no pixel twice. The last array, (8,
    # 2), holds the first pixel of each group in the upper and in the lower line. The two diagonals of a
    # square of 2 x 2 pixels follow each other: they share no pixel, so mirroring commutes with denoising.
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
def load_row(grey, valid, cell_weights, runs, first, u, weights, diagonals, even, odd):  # type: ignore[no-untyped-def]
    """Load the active runs of a row of pixels into a line; a weight of 0 ends each."""
    one, two = np.uintp(1), np.uintp(2)
    for run in range(runs.shape[0]):
        begin, after = np.uintp(runs[run, 0]), np.uintp(runs[run, 1])
        if begin == after:
            break
        end = min(after, np.uintp(cell_weights.shape[0]))
        for k in range(begin, end):
            u[even + k] = grey[first + two * k] >> 1
            u[odd + k] = grey[first + two * k + one] >> 1
        for k in range(begin, end):
            weights[even + k] = cell_weights[k] * valid[first + two * k]
            weights[odd + k] = cell_weights[k] * valid[first + two * k + one]
        weights[even + after] = 0
        weights[odd + after] = 0
        for k in range(even + begin, even + after + one):
            diagonals[k] = np.int16(np.int32(weights[k]) * np.int32(_DIAGONAL) >> 6)
        for k in range(odd + begin, odd + after + one):
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
def relax_groups(begin, end, groups, runs, u, weights, flows, upper, lower, length):  # type: ignore[no-untyped-def]
    """Relax the pairs of some groups between two lines, in runs of columns."""
    for k in range(begin, end):
        a = np.uintp(upper * 2 * (length + _GAP) + groups[k, 0])
        b = np.uintp(lower * 2 * (length + _GAP) + groups[k, 1])
        at = np.uintp((upper * _GROUPS + k) * length)
        for run in range(runs.shape[0]):
            first, after = np.uintp(runs[run, 0]), np.uintp(runs[run, 1])
            if first == after:
                break
            relax_pairs(u, weights, a + first, b + first, flows, at + first, after - first)


@inlined
def classify_run(u, even, odd, grey, valid, table, first, begin, end, classes):  # type: ignore[no-untyped-def]
    """Classify a run of pixels of a row by their denoised grey; an unchanged pixel keeps its class."""
    for k in range(begin, end):
        c = first + np.uintp(2) * k
        d = c + np.uintp(1)
        if u[even + k] != np.int16(grey[c] >> 1):
            classes[c] = table[u[even + k]] * valid[c]
        if u[odd + k] != np.int16(grey[d] >> 1):
            classes[d] = table[u[odd + k]] * valid[d]


@inlined
def relax_step(  # type: ignore[no-untyped-def]
    step, grey, valid, cell_weights, runs, first, u, weights, diagonals, flows, groups, length
):
    """Load two rows, and run each sweep on two rows, a pair of rows behind the sweep before."""
    rows = grey.shape[0]
    width = length + _GAP
    for row in range(2 * step, min(2 * step + 2, rows)):
        line, here = row % _LINES, runs[0, row // 8]
        even, odd = np.uintp(2 * line * width), np.uintp((2 * line + 1) * width)
        load_row(grey[row], valid[row], cell_weights[row // 8], here, first, u, weights, diagonals, even, odd)
        for k in range(line * _GROUPS, (line + 1) * _GROUPS):
            for run in range(here.shape[0]):
                flows[k * length + here[run, 0] : k * length + here[run, 1]] = 0
    for sweep in range(SWEEPS):
        row = 2 * (step - sweep)
        if 0 <= row < rows:
            above, line, below = (row - 1) % _LINES, row % _LINES, (row + 1) % _LINES
            here = runs[0, row // 8]
            relax_groups(0, 2, groups, here, u, weights, flows, line, line, length)
            relax_groups(0, 2, groups, here, u, weights, flows, below, below, length)
            relax_groups(2, 4, groups, here, u, weights, flows, line, below, length)
            relax_groups(4, 8, groups, here, u, diagonals, flows, line, below, length)
            if row > 0:
                both = runs[int(row % 8 == 0), row // 8]
                relax_groups(2, 4, groups, both, u, weights, flows, above, line, length)
                relax_groups(4, 8, groups, both, u, diagonals, flows, above, line, length)


@kernel(
    "void(u2[:,::1], u1[:,::1], i2[:,::1], i8[:,:,:,::1], i8[::1], u1[::1], i2[::1], i2[::1], i2[::1],"
    " i2[::1], i8[:,::1], u1[:,::1])"
)
def _classify_tv(  # type: ignore[no-untyped-def]
    grey, valid, cell_weights, runs, panel, table, u, weights, diagonals, flows, groups, classes
):
    # All sweeps run over the rows together, each a pair of rows behind the one before: few lines are active.
    rows = grey.shape[0]
    length = flows.shape[0] // (_LINES * _GROUPS)
    width = length + _GAP
    first = np.uintp(panel[0])
    begin, end = (panel[1] - panel[0]) // 2, (panel[2] - panel[0]) // 2
    for step in range(rows // 2 + SWEEPS):
        relax_step(step, grey, valid, cell_weights, runs, first, u, weights, diagonals, flows, groups, length)
        done = 2 * (step - SWEEPS + 1)
        for row in range(max(done - 1, 0), min(done + 1, rows)):
            even, odd = np.uintp(2 * (row % _LINES) * width), np.uintp((2 * (row % _LINES) + 1) * width)
            for run in range(runs.shape[2]):
                low_k = np.uintp(max(runs[0, row // 8, run, 0], begin))
                high_k = np.uintp(max(min(runs[0, row // 8, run, 1], end), begin))
                classify_run(u, even, odd, grey[row], valid[row], table, first, low_k, high_k, classes[row])


def refine_by_tv(
    inside: Uint8s, valid: Uint8s, grey: Uint16s, greys: tuple[int, int], separate: bool = True
) -> Uint8s:
    """Classify the pixels around a bound of a range by denoised v; the weights follow the local noise.

    Cells with pixels on both sides and the cells around them are denoised; all other pixels are decided by
    their own value, as `inside` has them. Then, where there is noise, thin pieces and holes of fewer than
    `specks.MIN_PIECE` pixels change side.

    All arrays are (M, N), multiples of 16: `inside` is 1 where a valid pixel's own grey lies in the range,
    and is refined in place and returned; `grey` is 0 where not valid. `separate` tells whether a step between
    two separate groups of greys is structure, and not noise; see `noise`.
    """
    table = np.zeros(GREY_LEVELS, np.uint8)
    table[greys[0] : greys[1] + 1] = 1
    return refine_classes_by_tv(inside, valid, grey, table, separate)


def refine_classes_by_tv(
    classes: Uint8s, valid: Uint8s, grey: Uint16s, table: Uint8s, separate: bool = True
) -> Uint8s:
    """Classify the pixels around the bounds of several classes by denoised v, in place.

    Each pixel gets the class of its denoised grey, so classes share their borders. With one class the result
    is that of `refine_by_tv`. A small thin piece gets the class of most pixels around it. The arrays are
    those of `refine_by_tv`, with the class of each pixel's own grey, 0 where not valid, in place of its side.
    `table`, (65536,), has the class of each grey, at most `MAX_PIXEL_CLASSES`.
    """
    mixed = np.empty((classes.shape[0] // CELL, classes.shape[1] // CELL), np.uint8)
    _cells_of_two_classes(classes, valid, np.empty((2, classes.shape[1]), np.uint8), mixed)
    if mixed.any():
        active = dilate(mixed)
        bounds = 1 + np.flatnonzero(table[1:] != table[:-1]) if separate else np.empty(0, np.int64)
        noise = estimate_noise(grey, valid, active, bounds)
        weights = np.minimum(np.rint(_WEIGHT_PER_NOISE / 2 * noise), MAX_WEIGHT).astype(np.int16)
        weights = weights.repeat(NOISE_SIDE // 8, axis=0).repeat(NOISE_SIDE // 8, axis=1) * active
        _classify_panels(grey, valid, weights, table, classes)
        drop_specks(classes, valid, (weights > 0).view(np.uint8))
    return classes


@inlined
def add_row(classes, valid, lowest, highest):  # type: ignore[no-untyped-def]
    """Accumulate the lowest and the highest class of valid pixels in each column."""
    for c in range(np.uintp(classes.shape[0])):
        lowest[c] = min(lowest[c], np.uint8(classes[c] | np.uint8(valid[c] - np.uint8(1))))
    for c in range(np.uintp(classes.shape[0])):
        highest[c] = max(highest[c], classes[c])  # 0 where not valid


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1], u1[:,::1])")
def _cells_of_two_classes(classes, valid, lines, mixed):  # type: ignore[no-untyped-def]
    lowest, highest = lines[0], lines[1]
    for row in range(mixed.shape[0]):
        lowest[:] = 255
        highest[:] = 0
        for r in range(8 * row, 8 * row + 8):
            add_row(classes[r], valid[r], lowest, highest)
        for cell in range(mixed.shape[1]):
            low, high = np.uint8(255), np.uint8(0)
            for c in range(8 * cell, 8 * cell + 8):
                low, high = min(low, lowest[c]), max(high, highest[c])
            mixed[row, cell] = np.uint8(low < high)
