"""Columns: many of a beam at a time, as long as all it says is that cells are free.

Amanatides and Woo's traversal goes from cell to cell, each step waiting for the one before. But in which row
a beam enters a column is known from where it begins, so all columns are looked at together; what comes out is
the same, to the last bit.
"""

from math import floor

import numpy as np

from uavseg._jit import inlined
from uavseg.occupancy.mapping.pending import OFTEN, TOLD, cell_of_mark, free_once, mark_of_col, mark_of_row

_FEW = 4  # columns: fewer are not worth a loop of their own


@inlined
def is_straight(u0, v0, du, dv):  # type: ignore[no-untyped-def]
    """Whether `stride` may follow a beam: it enters two rows in a column at most, whatever was rounded."""
    along, across = max(abs(du), abs(dv)), min(abs(du), abs(dv))
    return across > 1e-9 * along and across < (1.0 - 1e-9) * along and abs(u0) + abs(v0) < 1e6


@inlined
def stride(cells, beam, steep, t_sure, lines, state, ends):  # type: ignore[no-untyped-def]
    """What walking from cell to cell does, as long as all that a beam says is that cells are free.

    Columns are those of cells across which the beam runs the longer way: rows of the map if it is steep.
    """
    odds, marks, _, cols, u0, v0 = cells
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
    first = cell_of_mark(np.int64(lines[0, 0] + lines[1, 0]), cols) if first < 0 else first
    last = cell_of_mark(np.int64(lines[0, many - 1] + lines[1, many]), cols)
    cell = cell_of_mark(np.int64(lines[0, many] + lines[1, many]), cols)
    t_in = (np.float64(major + forth * many + np.int64(step[0] < 0.0)) - place[0]) * (1.0 / step[0])
    return (cell % cols, cell // cols, t_in), (first, last)


@inlined
def _whole_columns(u0, du, major, t_sure):  # type: ignore[no-untyped-def]
    """How many columns from `major` on a beam has left before t_sure."""
    step = np.int64(1 if du > 0.0 else -1)
    many = (np.int64(floor(u0 + t_sure * du)) - major) * step
    while many > 0 and not (np.float64(major + step * many + np.int64(du < 0.0)) - u0) / du < t_sure:
        many -= 1
    return many


@inlined
def _lines(u0, v0, du, dv, major, minor, many, cols, steep, lines):  # type: ignore[no-untyped-def]
    """In which row a beam along the major axis enters each of `many` columns after that of a cell.

    Parts of the marks' indices are written to `lines`: of columns into the first, of rows into the second.
    Rows are exactly those of a walk, which has crossed the edges whose t is smaller than the column's. Gives
    whether the beam goes through the corner of a cell on the way, where there is more to think of.
    """
    step_u, step_v = np.int64(1 if du > 0.0 else -1), np.int64(1 if dv > 0.0 else -1)
    per_u, per_v = 1.0 / du, 1.0 / dv
    ahead = np.int64(dv > 0.0)
    edge = major + np.int64(du < 0.0)
    t_first = (np.float64(edge) - u0) * per_u
    corners = np.int64((np.float64(minor + ahead) - v0) * per_v <= t_first)
    lines[1, 0] = mark_of_col(minor) if steep else mark_of_row(minor, cols)
    for k in range(1, many + 1):
        t = (np.float64(edge + step_u * k) - u0) * per_u
        near = np.int64(v0 + t * dv + 1.0) - 1
        t_next, t_last = (np.float64(near + ahead) - v0) * per_v, (np.float64(near + 1 - ahead) - v0) * per_v
        corners |= np.int64(t_next == t) | np.int64(t_last == t)
        row = near + step_v * (np.int64(t_next < t) - np.int64(t_last > t))
        row = max(row, minor) if step_v > 0 else min(row, minor)
        lines[1, k] = mark_of_col(row) if steep else mark_of_row(row, cols)
    for k in range(many + 1):
        column = major + step_u * k
        lines[0, k] = mark_of_row(column, cols) if steep else mark_of_col(column)
    return corners != 0


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
            cell = cell_of_mark(np.int64(i), cols)
            odds[cell] = free_once(odds[cell])
