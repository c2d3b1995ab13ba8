"""What beams say about cells: the beam model, along every cell that a beam crosses once.

The beam model is Elfes-shaped: a cell at distance d along a beam that returned range r, with standard
deviation σ, has P(d) = clip(0.5 Φ((d - r)/σ) + (p_peak - 0.25) exp(-(d - r)²/2σ²), p_min, p_max) for d <= r +
3σ and is left as it was beyond. A beam without a return says p_min as far as the sensor sees. The cells that
a beam crosses are found by Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing",
Eurographics 1987.

Most of what beams say is p_min. That is only counted here, see `evidence`, and added once for each cell;
where a beam says anything else, what was counted before is added first, so that every cell hears its beams in
their order.
"""

from math import erf, exp, floor, inf, log, sqrt

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.occupancy.evidence import MAX_LOG_ODDS, OFTEN, P_MIN, TOLD, Marks, free_once
from uavseg.raster.tiling import Window

P_PEAK, P_MAX = 0.9, 0.95
REACH_SIGMAS = 3.0  # how far behind a return a beam still says something
FREE_SIGMAS = -2.5  # nearer than this, the model is p_min: the clip is already reached at -2σ

_NOTHING = 1e-100  # one divided by less than this may be infinite
_FEW = 4  # columns: fewer are not worth a loop of their own
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
        See `evidence.marks_of`. What remains to be done for `evidence.take`; 0 where that is nothing.
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
def _mark_of_row(row, cols):  # type: ignore[no-untyped-def]
    """Where the marks of a row begin; see `evidence.marks_of`."""
    return (row >> 6) * ((cols + 63) >> 6) * 4096 + ((row & 56) << 6) + ((row & 7) << 3)


@inlined
def _mark_of_col(col):  # type: ignore[no-untyped-def]
    """How far from there the mark in a column is."""
    return (col >> 6) * 4096 + ((col & 56) << 3) + (col & 7)


@inlined
def _cell_of_mark(i, cols):  # type: ignore[no-untyped-def]
    """Row times the number of columns, plus column, of the cell to which a mark belongs."""
    blocks = (cols + 63) >> 6
    row = (i >> 12) // blocks * 64 + ((i >> 9) & 7) * 8 + ((i >> 3) & 7)
    return row * cols + (i >> 12) % blocks * 64 + ((i >> 6) & 7) * 8 + (i & 7)


@inlined
def _tell(odds, marks, row, col, cols, d, measured, sigma):  # type: ignore[no-untyped-def]
    """Tell a cell what a beam says about it at distance d; no logarithm where the model is p_min."""
    i = _mark_of_row(row, cols) + _mark_of_col(col)
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
def _walk(odds, marks, rows, cols, u0, v0, beam, sigma, t_end, stop, state, ends):  # type: ignore[no-untyped-def]
    """Walk along a beam from a cell, to the beam's end or until a column or row in `stop` is entered.

    `state` is (column, row, how far along the beam it is entered); `ends` are the first and the last cell
    that were told something, -1 for none. Both come back, and whether the beam goes on.
    """
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


@inlined
def _mark_free(odds, marks, cols, lines, many):  # type: ignore[no-untyped-def]
    """Tell once that they are free the cells in which columns are entered and left, from `_lines`."""
    along, across, visited = lines[0], lines[1], lines[2]
    visits = np.uintp(0)
    for k in range(many):  # each cell once: what was stored a moment ago is slow to load again
        visited[visits] = along[k] + across[k]
        visited[visits + np.uintp(1)] = along[k] + across[k + 1]
        visits += np.uintp(1) + np.uintp(across[k] != across[k + 1])
    for k in range(visits):
        i = visited[k]
        mark = marks[i]
        if mark < TOLD:
            marks[i] = mark + np.uint8(mark < OFTEN)
        else:
            cell = _cell_of_mark(np.int64(i), cols)
            odds[cell] = free_once(odds[cell])


@inlined
def _lines(u0, v0, du, dv, major, minor, many, cols, steep, lines):  # type: ignore[no-untyped-def]
    """In which row a beam along the major axis enters each of `many` columns after that of cell (major, minor).

    Parts of the marks' indices are written to `lines`: of columns into the first, of rows into the second.
    Rows are exactly those of `_walk`, which counts the edges whose t is smaller than the column's. Gives whether
    the beam goes through the corner of a cell on the way, where there is more to think of.
    """
    step_u, step_v = np.int64(1 if du > 0.0 else -1), np.int64(1 if dv > 0.0 else -1)
    per_u, per_v = 1.0 / du, 1.0 / dv
    ahead = np.int64(dv > 0.0)
    edge = major + np.int64(du < 0.0)
    t_first = (np.float64(edge) - u0) * per_u
    corners = np.int64((np.float64(minor + ahead) - v0) * per_v <= t_first)
    lines[1, 0] = _mark_of_col(minor) if steep else _mark_of_row(minor, cols)
    for k in range(1, many + 1):
        t = (np.float64(edge + step_u * k) - u0) * per_u
        near = np.int64(v0 + t * dv + 1.0) - 1
        t_next, t_last = (np.float64(near + ahead) - v0) * per_v, (np.float64(near + 1 - ahead) - v0) * per_v
        corners |= np.int64(t_next == t) | np.int64(t_last == t)
        row = near + step_v * (np.int64(t_next < t) - np.int64(t_last > t))
        row = max(row, minor) if step_v > 0 else min(row, minor)
        lines[1, k] = _mark_of_col(row) if steep else _mark_of_row(row, cols)
    for k in range(many + 1):
        column = major + step_u * k
        lines[0, k] = _mark_of_row(column, cols) if steep else _mark_of_col(column)
    return corners != 0


@inlined
def _whole_columns(u0, du, major, t_sure):  # type: ignore[no-untyped-def]
    """How many columns from `major` on a beam has left before t_sure."""
    step = np.int64(1 if du > 0.0 else -1)
    many = (np.int64(floor(u0 + t_sure * du)) - major) * step
    while many > 0 and not (np.float64(major + step * many + np.int64(du < 0.0)) - u0) / du < t_sure:
        many -= 1
    return many


@inlined
def _stride(odds, marks, cols, u0, v0, beam, steep, t_sure, lines, state, ends):  # type: ignore[no-untyped-def]
    """What `_walk` does, as long as all that a beam says is that cells are free, many columns at a time.

    Columns are those of cells across which the beam runs the longer way: rows of the map if it is steep.
    """
    du, dv, _, _ = beam
    col, row, t_in = state
    first, last = ends
    if steep:
        place, step, major, minor = (v0, u0), (dv, du), row, col
    else:
        place, step, major, minor = (u0, v0), (du, dv), col, row
    many = _whole_columns(place[0], step[0], major, t_sure)
    if many < _FEW:
        return state, ends
    if _lines(place[0], place[1], step[0], step[1], major, minor, many, cols, steep, lines):
        return state, ends
    _mark_free(odds, marks, cols, lines, many)
    forth = np.int64(1 if step[0] > 0.0 else -1)
    first = _cell_of_mark(np.int64(lines[0, 0] + lines[1, 0]), cols) if first < 0 else first
    last = _cell_of_mark(np.int64(lines[0, many - 1] + lines[1, many]), cols)
    cell = _cell_of_mark(np.int64(lines[0, many] + lines[1, many]), cols)
    t_in = (np.float64(major + forth * many + np.int64(step[0] < 0.0)) - place[0]) * (1.0 / step[0])
    return (cell % cols, cell // cols, t_in), (first, last)


@inlined
def _straight(u0, v0, du, dv):  # type: ignore[no-untyped-def]
    """Whether `_lines` may follow a beam: it enters two rows in a column at most, whatever was rounded."""
    along, across = max(abs(du), abs(dv)), min(abs(du), abs(dv))
    return across > 1e-9 * along and across < (1.0 - 1e-9) * along and abs(u0) + abs(v0) < 1e6


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
        steep = abs(dv) > abs(du)
        state, ends, goes_on = (col, row, t_in), (np.int64(-1), np.int64(-1)), True
        if _straight(u0, v0, du, dv):
            stop = (
                (_NOWHERE, row + (2 if dv > 0.0 else -2))
                if steep
                else (col + (2 if du > 0.0 else -2), _NOWHERE)
            )
            state, ends, goes_on = _walk(
                odds, marks, rows, cols, u0, v0, beam, sigma, t_end, stop, state, ends
            )
            if goes_on:
                t_sure = min(t_end, beams[i, 2] + FREE_SIGMAS * sigma) - 1e-6 / max(abs(du), abs(dv))
                state, ends = _stride(odds, marks, cols, u0, v0, beam, steep, t_sure, lines, state, ends)
        if goes_on:
            stop = (_NOWHERE, _NOWHERE)
            _, ends, _ = _walk(odds, marks, rows, cols, u0, v0, beam, sigma, t_end, stop, state, ends)
        for end in ends:  # a beam is straight: its first and last cells bound it
            if end >= 0:
                box[0], box[1] = min(box[0], end // cols), min(box[1], end % cols)
                box[2], box[3] = max(box[2], end // cols), max(box[3], end % cols)
