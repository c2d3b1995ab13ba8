"""Inverse sensor model of range beams, applied by ray traversal to each cell that a beam crosses.

The model has the shape of Elfes': a cell at distance d along a beam that returned range r, with standard
deviation σ, has P(d) = clip(0.5 Φ((d - r)/σ) + (p_peak - 0.25) exp(-(d - r)²/2σ²), p_min, p_max) for d <= r +
3σ and does not change behind. A beam without a return observes p_min up to the maximum range. The crossed
cells are found by Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.
That goes from cell to cell, and each step waits for the one before. But the row in which a beam enters a
column follows from the beam's origin; so where a beam observes only free cells, all columns are computed
together, vectorised. The result is equal to the last bit.

Most observations are p_min. These are only counted here, see `pending`, and added once for each cell. Where a
beam observes anything else, the counted ones are added first, so updates are applied in beam order.
"""

from math import erf, exp, floor, inf, log, sqrt

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Float32s, Floats
from uavseg.occupancy.mapping.log_odds import MAX_LOG_ODDS, P_MIN, add_one_free
from uavseg.occupancy.mapping.pending import (
    MAX_FREE_COUNT,
    UP_TO_DATE,
    PendingUpdates,
    cell_at_offset,
    col_offset,
    row_offset,
)
from uavseg.raster.grid.tiling import Window

P_PEAK, P_MAX = 0.9, 0.95
REACH_SIGMAS = 3.0  # σ behind a return up to which a beam updates cells
FREE_SIGMAS = -2.5  # nearer than this, the model is p_min: the clip is already reached at -2σ

_MIN_STEP = 1e-100  # the inverse of a smaller number may be infinite
_NO_STOP = -9  # a row or column that no beam enters
_MIN_COLUMNS = 4  # fewer columns are not worth a loop of their own


def merge_beams(log_odds: Float32s, pending: PendingUpdates, beams: Floats, sigma: float) -> Window:
    """Update cells by beams, in beam order; return the smallest window with all of them, which may be empty.

    Both arrays are changed in place: `log_odds`, (rows, cols), where a beam observes something other than
    p_min, clamped to -6..6; `pending`, see `pending.empty_pending`, by the updates that `apply_pending` has
    yet to apply.

    `beams`, (n, 6), have steps in columns and in rows of one metre along the beam, the returned range in
    metres (infinite for none), the distance in metres up to which the beam updates cells, and column and row
    of the sensor, in cells from the grid's outer corner; `sigma` is the standard deviation of ranges in
    metres.
    """
    rows, cols = log_odds.shape
    box = np.array([rows, cols, -1, -1], np.int64)
    beams = np.ascontiguousarray(np.where(np.abs(beams) < _MIN_STEP, 0.0, beams))
    offsets = np.empty((3, 2 * max(rows, cols) + 2), np.uint64)
    _merge_each(log_odds.reshape(-1), pending.reshape(-1), rows, cols, beams, sigma, offsets, box)
    top, left, bottom, right = (int(edge) for edge in box)
    return Window(top, left, bottom - top + 1, right - left + 1) if bottom >= 0 else Window(0, 0, 0, 0)


@inlined
def _model(x):  # type: ignore[no-untyped-def]
    """Compute P(d) of the beam model, x = (d - r) / sigma."""
    p = 0.25 * (1.0 + erf(x / sqrt(2.0))) + (P_PEAK - 0.25) * exp(-0.5 * x * x)
    return min(max(p, P_MIN), P_MAX)


@inlined
def _update_cell(odds, pending, row, col, cols, d, measured, sigma):  # type: ignore[no-untyped-def]
    """Update a cell at distance d along a beam; no logarithm where the model is p_min."""
    i = row_offset(row, cols) + col_offset(col)
    update = pending[i]
    if d <= measured + FREE_SIGMAS * sigma and update < UP_TO_DATE:  # without a return, the former is true
        pending[i] = update + np.uint8(update < MAX_FREE_COUNT)
        return
    cell = row * cols + col
    before = odds[cell]
    if d <= measured + FREE_SIGMAS * sigma:
        odds[cell] = add_one_free(before)
        return
    for _ in range(update & np.uint8(UP_TO_DATE - 1)):
        before = add_one_free(before)
    p = _model((d - measured) / sigma)
    odds[cell] = np.float32(min(max(before + log(p / (1.0 - p)), -MAX_LOG_ODDS), MAX_LOG_ODDS))
    pending[i] = UP_TO_DATE


@inlined
def _clip_axis(origin, step, length):  # type: ignore[no-untyped-def]
    """Compute where a beam enters and leaves a grid along one axis; (inf, -inf) if it misses it."""
    if step == 0.0:
        return (-inf, inf) if 0.0 <= origin < length else (inf, -inf)
    first, last = -origin / step, (length - origin) / step
    return min(first, last), max(first, last)


@inlined
def _traverse(cells, beam, sigma, t_end, stop, state, ends):  # type: ignore[no-untyped-def]
    """Traverse a beam by cells until it enters a column or row in `stop`; return whether it goes on, too."""
    # `state` is column, row and distance at which a cell is entered, `ends` the first and last updated cell.
    odds, pending, rows, cols, u0, v0 = cells
    du, dv, measured, reach = beam
    col, row, t_in = state
    first, last = ends
    # The next edges are doubles, so the loop converts no integer. Along an axis on which the beam does not
    # move, the next edge is infinitely far.
    step_u, step_v = -1.0 if du < 0.0 else 1.0, -1.0 if dv < 0.0 else 1.0
    per_col, per_row = 1.0 / du if du != 0.0 else inf, 1.0 / dv if dv != 0.0 else inf
    edge_u, edge_v = np.float64(col + (du >= 0.0)), np.float64(row + (dv >= 0.0))
    t_col, t_row = (edge_u - u0) * per_col, (edge_v - v0) * per_row
    while True:
        if col == stop[0] or row == stop[1]:
            return (col, row, t_in), (first, last), True
        t_out = min(t_col, t_row)
        if t_out > t_in:  # a cell that the beam only touches at a corner or an edge is not crossed
            d = 0.5 * (t_in + t_out)
            if d > reach:
                break
            last = row * cols + col
            first = last if first < 0 else first
            _update_cell(odds, pending, row, col, cols, d, measured, sigma)
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


@kernel("void(f4[::1], u1[::1], i8, i8, f8[:,::1], f8, u8[:,::1], i8[::1])")
def _merge_each(odds, pending, rows, cols, beams, sigma, offsets, box):  # type: ignore[no-untyped-def]
    for i in range(beams.shape[0]):
        beam = (beams[i, 0], beams[i, 1], beams[i, 2], beams[i, 3])
        u0, v0 = beams[i, 4], beams[i, 5]
        du, dv, _, reach = beam
        in_col, out_col = _clip_axis(u0, du, cols)
        in_row, out_row = _clip_axis(v0, dv, rows)
        t_in = max(0.0, in_col, in_row)
        t_end = min(reach, out_col, out_row)
        if not t_in < t_end:
            continue
        col = min(max(np.int64(floor(u0 + t_in * du)), 0), cols - 1)
        row = min(max(np.int64(floor(v0 + t_in * dv)), 0), rows - 1)
        cells = (odds, pending, rows, cols, u0, v0)
        state, ends, goes_on = (col, row, t_in), (np.int64(-1), np.int64(-1)), True
        if can_step_by_column(u0, v0, du, dv):
            steep = abs(dv) > abs(du)
            # Two columns step by step, so that the position of the sensor within its cell does not matter.
            stop = (col + (2 if du > 0.0 else -2), _NO_STOP)
            if steep:
                stop = (_NO_STOP, row + (2 if dv > 0.0 else -2))
            state, ends, goes_on = _traverse(cells, beam, sigma, t_end, stop, state, ends)
            if goes_on:
                t_sure = min(t_end, beams[i, 2] + FREE_SIGMAS * sigma) - 1e-6 / max(abs(du), abs(dv))
                state, ends = _mark_free_columns(cells, beam, steep, t_sure, offsets, state, ends)
        if goes_on:
            stop = (_NO_STOP, _NO_STOP)
            _, ends, _ = _traverse(cells, beam, sigma, t_end, stop, state, ends)
        for end in ends:  # a beam is straight, so its first and last cells bound it
            if end >= 0:
                box[0], box[1] = min(box[0], end // cols), min(box[1], end % cols)
                box[2], box[3] = max(box[2], end // cols), max(box[3], end % cols)


@inlined
def can_step_by_column(u0, v0, du, dv):  # type: ignore[no-untyped-def]
    """Return whether `_mark_free_columns` may follow a beam: two rows per column at most, safely."""
    along, across = max(abs(du), abs(dv)), min(abs(du), abs(dv))
    return across > 1e-9 * along and across < (1.0 - 1e-9) * along and abs(u0) + abs(v0) < 1e6


@inlined
def _mark_free_columns(cells, beam, steep, t_sure, offsets, state, ends):  # type: ignore[no-untyped-def]
    """Count free observations as `_traverse` does up to `t_sure`; of a steep beam, columns are rows."""
    odds, pending, _, cols, u0, v0 = cells
    du, dv, _, _ = beam
    col, row, t_in = state
    first, last = ends
    if steep:
        origin, step, major, minor = (v0, u0), (dv, du), row, col
    else:
        origin, step, major, minor = (u0, v0), (du, dv), col, row
    count = _count_whole_columns(origin[0], step[0], major, t_sure)
    if count < _MIN_COLUMNS:
        return state, ends
    if _fill_offsets(origin[0], origin[1], step[0], step[1], major, minor, count, cols, steep, offsets):
        return state, ends
    _count_free(odds, pending, cols, offsets, count)
    direction = np.int64(1 if step[0] > 0.0 else -1)
    first = cell_at_offset(np.int64(offsets[0, 0] + offsets[1, 0]), cols) if first < 0 else first
    last = cell_at_offset(np.int64(offsets[0, count - 1] + offsets[1, count]), cols)
    cell = cell_at_offset(np.int64(offsets[0, count] + offsets[1, count]), cols)
    t_in = (np.float64(major + direction * count + np.int64(step[0] < 0.0)) - origin[0]) * (1.0 / step[0])
    return (cell % cols, cell // cols, t_in), (first, last)


@inlined
def _count_whole_columns(u0, du, major, t_sure):  # type: ignore[no-untyped-def]
    """Count the columns that a beam crosses from `major` on before t_sure."""
    step = np.int64(1 if du > 0.0 else -1)
    count = (np.int64(floor(u0 + t_sure * du)) - major) * step
    while count > 0 and not (np.float64(major + step * count + np.int64(du < 0.0)) - u0) / du < t_sure:
        count -= 1
    return count


@inlined
def _fill_offsets(u0, v0, du, dv, major, minor, count, cols, steep, offsets):  # type: ignore[no-untyped-def]
    """Write offsets of columns along a beam, and of the rows in which it enters them, to `offsets`."""
    # The rows are exactly those of `_traverse`, which has crossed the edges whose t is smaller than the
    # column's. Returns True if the beam passes through the corner of a cell, where `_traverse` decides.
    step_u, step_v = np.int64(1 if du > 0.0 else -1), np.int64(1 if dv > 0.0 else -1)
    per_u, per_v = 1.0 / du, 1.0 / dv
    ahead = np.int64(dv > 0.0)
    edge = major + np.int64(du < 0.0)
    t_first = (np.float64(edge) - u0) * per_u
    corners = np.int64((np.float64(minor + ahead) - v0) * per_v <= t_first)
    offsets[1, 0] = col_offset(minor) if steep else row_offset(minor, cols)
    for k in range(1, count + 1):
        t = (np.float64(edge + step_u * k) - u0) * per_u
        near = np.int64(v0 + t * dv + 1.0) - 1
        t_next, t_last = (np.float64(near + ahead) - v0) * per_v, (np.float64(near + 1 - ahead) - v0) * per_v
        corners |= np.int64(t_next == t) | np.int64(t_last == t)
        row = near + step_v * (np.int64(t_next < t) - np.int64(t_last > t))
        row = max(row, minor) if step_v > 0 else min(row, minor)
        offsets[1, k] = col_offset(row) if steep else row_offset(row, cols)
    for k in range(count + 1):
        column = major + step_u * k
        offsets[0, k] = row_offset(column, cols) if steep else col_offset(column)
    return corners != 0


@inlined
def _count_free(odds, pending, cols, offsets, count):  # type: ignore[no-untyped-def]
    """Count one free observation for each cell in which a column is entered or left."""
    along, across, visited = offsets[0], offsets[1], offsets[2]
    visits = np.uintp(0)
    for k in range(count):  # each cell once: loading right after storing is slow
        visited[visits] = along[k] + across[k]
        visited[visits + np.uintp(1)] = along[k] + across[k + 1]
        visits += np.uintp(1) + np.uintp(across[k] != across[k + 1])
    for k in range(visits):
        i = visited[k]
        update = pending[i]
        if update < UP_TO_DATE:
            pending[i] = update + np.uint8(update < MAX_FREE_COUNT)
        else:
            cell = cell_at_offset(np.int64(i), cols)
            odds[cell] = add_one_free(odds[cell])
