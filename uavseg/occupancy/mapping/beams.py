"""What beams say about cells: the beam model, along every cell that a beam crosses once.

The beam model is Elfes-shaped: a cell at distance d along a beam that returned range r, with standard
deviation σ, has P(d) = clip(0.5 Φ((d - r)/σ) + (p_peak - 0.25) exp(-(d - r)²/2σ²), p_min, p_max) for d <= r +
3σ and is left as it was beyond. A beam without a return says p_min as far as the sensor sees. The cells that
a beam crosses are found by Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing",
Eurographics 1987.

Most of what beams say is p_min. That is only counted here, see `marks`, and added once for each cell;
where a beam says anything else, what was counted before is added first, so that every cell hears its beams in
their order.
"""

from math import erf, exp, floor, inf, log, sqrt

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.occupancy.mapping.beam_columns import is_straight, stride
from uavseg.occupancy.mapping.pending import (
    MAX_LOG_ODDS,
    OFTEN,
    P_MIN,
    TOLD,
    Marks,
    free_once,
    mark_of_col,
    mark_of_row,
)
from uavseg.raster.tiling import Window

P_PEAK, P_MAX = 0.9, 0.95
REACH_SIGMAS = 3.0  # how far behind a return a beam still says something
FREE_SIGMAS = -2.5  # nearer than this, the model is p_min: the clip is already reached at -2σ

_NOTHING = 1e-100  # one divided by less than this may be infinite
_NOWHERE = -9

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


def merge_beams(
    log_odds: Singles,
    marks: Marks,
    origin: tuple[float, float],
    beams: Floats,
    sigma: float,
) -> Window:
    """Hear what beams from one place say about cells, beam by beam.

    Parameters
    ----------
    log_odds : (rows, cols) float32 array
        Changed in place where a beam says something other than p_min; |log-odds| never leaves 6.
    marks : (B, C, 8, 8, 8, 8) uint8 array
        See `marks.marks_of`. What remains to be done for `evidence.take`; 0 where that is nothing.
    origin : (float, float)
        Column and row of the sensor, in cells from the grid's outer corner.
    beams : (n, 4) float64 array
        Steps in columns and in rows of one metre along the beam, the range returned (infinite for none), and
        how far the beam says something, in metres.
    sigma : float
        Standard deviation of ranges in metres.

    Returns
    -------
    Window
        The smallest one with all cells that were touched; it may be empty.
    """
    rows, cols = log_odds.shape
    box = np.array([rows, cols, -1, -1], np.int64)
    beams = np.where(np.abs(beams) < _NOTHING, 0.0, beams)
    lines = np.empty((3, 2 * max(rows, cols) + 2), np.uint64)
    _merge(
        log_odds.reshape(-1), marks.reshape(-1), rows, cols, origin[0], origin[1], beams, sigma, lines, box
    )
    top, left, bottom, right = (int(edge) for edge in box)
    return Window(top, left, bottom - top + 1, right - left + 1) if bottom >= 0 else Window(0, 0, 0, 0)


@inlined
def _model(x):  # type: ignore[no-untyped-def]
    """P(d) of the beam model, x = (d - r) / sigma."""
    p = 0.25 * (1.0 + erf(x / sqrt(2.0))) + (P_PEAK - 0.25) * exp(-0.5 * x * x)
    return min(max(p, P_MIN), P_MAX)


@inlined
def _tell(odds, marks, row, col, cols, d, measured, sigma):  # type: ignore[no-untyped-def]
    """Tell a cell what a beam says about it at distance d; no logarithm where the model is p_min."""
    i = mark_of_row(row, cols) + mark_of_col(col)
    mark = marks[i]
    if d <= measured + FREE_SIGMAS * sigma and mark < TOLD:  # the former always, where nothing returned
        marks[i] = mark + np.uint8(mark < OFTEN)
        return
    cell = row * cols + col
    said = odds[cell]
    if d <= measured + FREE_SIGMAS * sigma:
        odds[cell] = free_once(said)
        return
    for _ in range(mark & np.uint8(TOLD - 1)):
        said = free_once(said)
    p = _model((d - measured) / sigma)
    odds[cell] = np.float32(min(max(said + log(p / (1.0 - p)), -MAX_LOG_ODDS), MAX_LOG_ODDS))
    marks[i] = TOLD


@inlined
def _crossing(place, step, length):  # type: ignore[no-untyped-def]
    """Where along a beam one axis of it enters and leaves a grid; nowhere is (inf, -inf)."""
    if step == 0.0:
        return (-inf, inf) if 0.0 <= place < length else (inf, -inf)
    first, last = -place / step, (length - place) / step
    return min(first, last), max(first, last)


@inlined
def _walk(cells, beam, sigma, t_end, stop, state, ends):  # type: ignore[no-untyped-def]
    """Walk along a beam from a cell, to the beam's end or until a column or row in `stop` is entered.

    `state` is (column, row, how far along the beam it is entered); `ends` are the first and the last cell
    that were told something, -1 for none. Both come back, and whether the beam goes on.
    """
    odds, marks, rows, cols, u0, v0 = cells
    du, dv, measured, reach = beam
    col, row, t_in = state
    first, last = ends
    # The next edges as doubles, so that no integer is converted on the way. Along an axis on which the beam
    # does not move, the next edge is infinitely far.
    step_u, step_v = -1.0 if du < 0.0 else 1.0, -1.0 if dv < 0.0 else 1.0
    per_col, per_row = 1.0 / du if du != 0.0 else inf, 1.0 / dv if dv != 0.0 else inf
    edge_u, edge_v = np.float64(col + (du >= 0.0)), np.float64(row + (dv >= 0.0))
    t_col, t_row = (edge_u - u0) * per_col, (edge_v - v0) * per_row
    while True:
        if col == stop[0] or row == stop[1]:
            return (col, row, t_in), (first, last), True
        t_out = min(t_col, t_row)
        if t_out > t_in:  # not a cell that is only touched at a corner or an edge
            d = 0.5 * (t_in + t_out)
            if d > reach:
                break
            last = row * cols + col
            first = last if first < 0 else first
            _tell(odds, marks, row, col, cols, d, measured, sigma)
            t_in = t_out
        if t_out >= t_end:
            break
        if t_col < t_row:
            col += np.int64(step_u)
            edge_u += step_u
            t_col = (edge_u - u0) * per_col
        else:
            row += np.int64(step_v)
            edge_v += step_v
            t_row = (edge_v - v0) * per_row
        if not (0 <= row < rows and 0 <= col < cols):
            break
    return (col, row, t_in), (first, last), False


@kernel("void(f4[::1], u1[::1], i8, i8, f8, f8, f8[:,::1], f8, u8[:,::1], i8[::1])")
def _merge(odds, marks, rows, cols, u0, v0, beams, sigma, lines, box):  # type: ignore[no-untyped-def]
    for i in range(beams.shape[0]):
        beam = (beams[i, 0], beams[i, 1], beams[i, 2], beams[i, 3])
        du, dv, _, reach = beam
        in_col, out_col = _crossing(u0, du, cols)
        in_row, out_row = _crossing(v0, dv, rows)
        t_in = max(0.0, in_col, in_row)
        t_end = min(reach, out_col, out_row)
        if not t_in < t_end:
            continue
        col = min(max(np.int64(floor(u0 + t_in * du)), 0), cols - 1)
        row = min(max(np.int64(floor(v0 + t_in * dv)), 0), rows - 1)
        cells = (odds, marks, rows, cols, u0, v0)
        state, ends, goes_on = (col, row, t_in), (np.int64(-1), np.int64(-1)), True
        if is_straight(u0, v0, du, dv):
            steep = abs(dv) > abs(
                du
            )  # two columns on foot, so that it does not matter where the sensor stands
            stop = (col + (2 if du > 0.0 else -2), _NOWHERE)
            if steep:
                stop = (_NOWHERE, row + (2 if dv > 0.0 else -2))
            state, ends, goes_on = _walk(cells, beam, sigma, t_end, stop, state, ends)
            if goes_on:
                t_sure = min(t_end, beams[i, 2] + FREE_SIGMAS * sigma) - 1e-6 / max(abs(du), abs(dv))
                state, ends = stride(cells, beam, steep, t_sure, lines, state, ends)
        if goes_on:
            stop = (_NOWHERE, _NOWHERE)
            _, ends, _ = _walk(cells, beam, sigma, t_end, stop, state, ends)
        for end in ends:  # a beam is straight: its first and last cells bound it
            if end >= 0:
                box[0], box[1] = min(box[0], end // cols), min(box[1], end % cols)
                box[2], box[3] = max(box[2], end // cols), max(box[3], end % cols)
