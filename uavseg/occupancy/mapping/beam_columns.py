"""Beam traversal by whole columns, vectorised, for the part of a beam that only observes free cells.

The traversal of Amanatides and Woo goes from cell to cell, and each step waits for the one before. But the
row in which a beam enters a column follows from the beam's origin, so all columns are computed together. The
result is equal to the last bit.
"""

from math import floor

import numpy as np

from uavseg._jit import inlined
from uavseg.occupancy.mapping.pending import (
    MAX_FREE_COUNT,
    UP_TO_DATE,
    add_one_free,
    cell_at_offset,
    col_offset,
    row_offset,
)

_MIN_COLUMNS = 4  # fewer columns are not worth a loop of their own


@inlined
def can_step_by_column(u0, v0, du, dv):  # type: ignore[no-untyped-def]
    """Whether `mark_free_columns` may follow a beam: two rows per column at most, whatever the rounding."""
    along, across = max(abs(du), abs(dv)), min(abs(du), abs(dv))
    return across > 1e-9 * along and across < (1.0 - 1e-9) * along and abs(u0) + abs(v0) < 1e6


@inlined
def mark_free_columns(cells, beam, steep, t_sure, offsets, state, ends):  # type: ignore[no-untyped-def]
    """Count free observations along a beam up to `t_sure`, as the traversal from cell to cell does.

    A column is a line of cells across the major axis of the beam: a row of the map if the beam is steep.
    """
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
    """Number of columns that a beam crosses from `major` on before t_sure."""
    step = np.int64(1 if du > 0.0 else -1)
    count = (np.int64(floor(u0 + t_sure * du)) - major) * step
    while count > 0 and not (np.float64(major + step * count + np.int64(du < 0.0)) - u0) / du < t_sure:
        count -= 1
    return count


@inlined
def _fill_offsets(u0, v0, du, dv, major, minor, count, cols, steep, offsets):  # type: ignore[no-untyped-def]
    """Rows in which a beam along the major axis enters each of `count` columns after that of a cell.

    Writes the offsets of the pending updates: those of columns to the first line of `offsets`, those of rows
    to the second. The rows are exactly those of the traversal from cell to cell, which has crossed the edges
    whose t is smaller than the column's. Returns True if the beam passes through the corner of a cell, where
    that traversal decides.
    """
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
