"""Frontiers, what is seen of them, and what a scan is expected to tell, beside plain versions."""

import math
from collections.abc import Iterator
from itertools import accumulate, repeat, takewhile

import numpy as np
from hypothesis import given, settings, strategies as st
from scipy.ndimage import label

from uavseg.occupancy.explore.frontiers import (
    expected_bits,
    find_frontiers,
    rays_for,
    seen_from,
    visible_cells,
)
from uavseg.units import FREE, OCCUPIED, UNKNOWN

STATES = st.integers(0, 10_000).map(
    lambda seed: np.random.default_rng(seed).choice([1, 1, 1, 2, 3], (12, 15)).astype(np.uint8)
)


@settings(max_examples=60, deadline=None)
@given(STATES)
def test_frontiers_are_free_cells_beside_unknown_ones_in_groups(states: np.ndarray) -> None:
    found = find_frontiers(states)
    plain = {
        (r, c)
        for r, c in np.argwhere(states == FREE).tolist()
        for y, x in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1))
        if 0 <= y < 12 and 0 <= x < 15 and states[y, x] == UNKNOWN
    }
    assert set(map(tuple, found.cells.tolist())) == plain and len(found.cells) == len(plain)
    assert np.array_equal(found.index[tuple(found.cells.T)], np.arange(len(plain)))
    assert np.count_nonzero(found.index >= 0) == len(plain)
    groups, _ = label(found.index >= 0, np.ones((3, 3)))
    of_cell = groups[tuple(found.cells.T)]
    assert len(set(of_cell)) == 1 + np.count_nonzero(np.diff(of_cell)) if len(of_cell) else True  # together
    for group in set(of_cell):
        cells = found.cells[of_cell == group]
        assert set(found.widths[of_cell == group]) == {int(np.ptp(cells, axis=0).max()) + 1}


def walked(rays: np.ndarray, row: int, col: int, range_cells: float) -> Iterator[list[tuple[int, int]]]:
    """Yield the cells of each ray in turn, from its crossings of the lines between cells by length."""
    for down, right in rays:
        crossings = []
        for axis, step in enumerate((down, right)):
            if abs(step) > 1e-12:
                lengths = accumulate(repeat(1 / abs(step), 40), initial=1 / abs(step) / 2)
                crossings += [(length, 1 - axis, axis) for length in lengths]
        cell, cells = [row, col], [(row, col)]
        for length, _, axis in sorted(crossings):
            if length > range_cells:
                break
            cell[axis] += 1 if (down, right)[axis] > 0 else -1
            cells.append((cell[0], cell[1]))
        yield [(r, c) for r, c in cells if 0 <= r < 12 and 0 <= c < 15]


@settings(max_examples=40, deadline=None)
@given(STATES, st.integers(0, 11), st.integers(0, 14), st.floats(1, 12))
def test_rays_see_and_mark_what_plain_ones_do(
    states: np.ndarray, row: int, col: int, range_cells: float
) -> None:
    states[row, col] = FREE
    found = find_frontiers(states)
    starts, seen = seen_from(states, found.index, len(found.cells), np.array([[row, col]]), range_cells)
    assert starts.tolist() == [0, len(seen)] and len(set(seen.tolist())) == len(seen)
    beside = set()  # an unknown cell into which a ray goes from free ones
    for cells in walked(rays_for(range_cells), row, col, range_cells):
        entered = next((cell for cell in cells if states[cell] != FREE), (row, col))
        if states[entered] == UNKNOWN:
            beside |= {(entered[0] + y, entered[1] + x) for y, x in ((0, 1), (0, -1), (1, 0), (-1, 0))}
    assert set(map(tuple, found.cells[seen].tolist())) == beside & set(map(tuple, found.cells.tolist()))
    marked = set()
    for cells in walked(rays_for(2 * range_cells), row, col, range_cells):
        before = list(takewhile(lambda cell: states[cell] == FREE, cells))
        marked |= set(cells[: len(before) + 1])
    visible = visible_cells(states != FREE, np.array([[row, col]]), range_cells)
    assert set(map(tuple, np.argwhere(visible).tolist())) == marked


def test_a_frontier_along_a_shadow_is_seen_from_elsewhere() -> None:
    states = np.full((21, 41), FREE, np.uint8)
    states[:10, 20], states[:10, 21:] = OCCUPIED, UNKNOWN  # a wall, and what it hides from below on the left
    for row in range(10, 20):
        states[row, 21 : 21 + (20 - row)] = FREE
    found = find_frontiers(states)
    views = np.array([[9, 19], [15, 22]])
    starts, seen = seen_from(states, found.index, len(found.cells), views, 30.0)
    hidden = set(found.index[10, 22:30].tolist()) - {-1}
    assert (
        hidden and not hidden & set(seen[: starts[1]].tolist()) and hidden <= set(seen[starts[1] :].tolist())
    )


def test_a_long_list_grows() -> None:
    states = np.full((200, 200), FREE, np.uint8)
    states[::4, ::4] = UNKNOWN
    found = find_frontiers(states)
    views = np.argwhere(states == FREE)[:40]
    starts, seen = seen_from(states, found.index, len(found.cells), views, 150.0)
    one = seen_from(states, found.index, len(found.cells), views[7:8], 150.0)[1]
    assert np.array_equal(seen[starts[7] : starts[8]], one)


def test_expected_bits_count_each_cell_once_and_nothing_behind_walls() -> None:
    states = np.full((41, 41), UNKNOWN, np.uint8)
    states[15:26, 15:26] = FREE
    p = np.where(states == FREE, np.float32(0.0), np.float32(0.5))
    open_ = expected_bits(p, states, (20, 20), 12.0)
    assert 0 < open_ <= np.count_nonzero(states == UNKNOWN)
    near = expected_bits(p, states, (20, 20), 4.0)
    assert near < 1e-6  # only free cells are reached
    closed, walls = states.copy(), p.copy()
    closed[14, 14:27] = closed[26, 14:27] = closed[14:27, 14] = closed[14:27, 26] = OCCUPIED
    walls[closed == OCCUPIED] = 1.0
    assert expected_bits(walls, closed, (20, 20), 12.0) < 1e-6
    halves = [expected_bits(p, states, (20, 20), 12.0, angle, math.pi) for angle in (0.0, math.pi)]
    assert all(0.3 * open_ < half < 0.75 * open_ for half in halves)
    more_walls = states.copy()
    more_walls[18:23, 18] = OCCUPIED  # known cells are occupied more often, so unknown ones block more
    assert expected_bits(p, more_walls, (20, 20), 12.0) < open_
