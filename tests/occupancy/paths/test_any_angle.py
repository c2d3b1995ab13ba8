"""String pulling: no longer than the path, with the same ends, over passable cells only."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from tests.occupancy.paths.sight import is_visible, path_length
from uavseg.errors import PathError
from uavseg.occupancy.paths.any_angle import pull_string
from uavseg.occupancy.paths.astar import shortest_path

Cell = tuple[int, int]
MASKS = arrays(
    bool,
    array_shapes(min_dims=2, max_dims=2, max_side=14),
    elements=st.sampled_from([True, True, True, False]),
)


def touched(one: Cell, other: Cell) -> set[Cell]:
    """Every cell whose closed square the leg between two centres touches, by clipping; exact."""
    found = set()
    (a, b), (c, d) = one, other
    for row in range(min(a, c), max(a, c) + 1):
        for col in range(min(b, d), max(b, d) + 1):
            low, high = Fraction(0), Fraction(1)
            for begin, move, centre in ((a, c - a, row), (b, d - b, col)):
                near, far = Fraction(2 * centre - 1, 2) - begin, Fraction(2 * centre + 1, 2) - begin
                if move:
                    low = max(low, min(near / move, far / move))
                    high = min(high, max(near / move, far / move))
                elif not near <= 0 <= far:
                    low, high = Fraction(1), Fraction(0)
            if low <= high:
                found.add((row, col))
    return found


@pytest.mark.slow
@given(MASKS, st.data())
@settings(max_examples=300)
def test_a_leg_is_allowed_if_all_cells_that_it_touches_are_passable(
    mask: np.ndarray, data: st.DataObject
) -> None:
    cells = st.tuples(*(st.integers(0, path_length - 1) for path_length in mask.shape))
    one, other = data.draw(cells), data.draw(cells)
    assert is_visible(mask, one, other) == all(mask[cell] for cell in touched(one, other))
    assert is_visible(mask, other, one) == is_visible(mask, one, other)


def check(mask: np.ndarray, start: Cell, goal: Cell) -> tuple[float, float] | None:
    """Cost of a path, and its length after string pulling; checks every leg."""
    try:
        path = shortest_path(mask, start, goal)
    except PathError:
        return None
    corners = pull_string(mask, path.cells)
    line = [tuple(corner) for corner in corners.tolist()]
    assert line[0] == start and line[-1] == goal
    assert all(is_visible(mask, *leg) for leg in pairwise(line))
    assert path_length(corners) <= path.cost + 1e-9
    assert path_length(corners) >= np.hypot(goal[0] - start[0], goal[1] - start[1]) - 1e-9
    return path.cost, path_length(corners)


@pytest.mark.slow
@given(MASKS, st.data())
@settings(max_examples=200)
def test_any_small_map(mask: np.ndarray, data: st.DataObject) -> None:
    free = [tuple(cell) for cell in np.argwhere(mask).tolist()]
    if free:
        check(mask, data.draw(st.sampled_from(free)), data.draw(st.sampled_from(free)))


def test_on_an_open_field_the_string_is_straight() -> None:
    cost, tight = check(np.ones((60, 90), bool), (3, 2), (50, 80)) or (0, 0)
    assert tight == pytest.approx(np.hypot(47, 78)) and cost > tight


def test_around_a_wall_the_string_touches_its_two_corners() -> None:
    mask = np.ones((41, 61), bool)
    mask[:30, 30] = False
    mask[10:, 45] = False
    path = shortest_path(mask, (0, 0), (40, 60))
    corners = pull_string(mask, path.cells).tolist()
    assert corners == [[0, 0], [30, 29], [30, 31], [9, 44], [9, 46], [40, 60]]


@pytest.mark.parametrize("seed", range(20))
def test_the_shortest_string_over_all_corners_is_hardly_shorter(seed: int) -> None:
    """Compared with the shortest path in the visibility graph of all cells, on small maps."""
    from scipy.sparse.csgraph import dijkstra

    rng = np.random.default_rng(seed)
    mask = np.repeat(np.repeat(rng.random((5, 7)) < 0.7, 3, 0), 3, 1)
    mask[0, 0] = mask[-1, -1] = True
    found = check(mask, (0, 0), (14, 20))
    if found is None:
        return
    cells = [tuple(cell) for cell in np.argwhere(mask).tolist()]
    graph = np.zeros((len(cells), len(cells)))
    for i, one in enumerate(cells):
        for j, other in enumerate(cells[:i]):
            if is_visible(mask, one, other):
                graph[i, j] = np.hypot(one[0] - other[0], one[1] - other[1])
    best = dijkstra(graph, directed=False, indices=0)[-1]
    assert best - 1e-9 <= found[1] <= 1.1 * best
