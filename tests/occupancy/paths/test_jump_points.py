"""The heuristic of the search: the octile cost is exact without obstacles, and consistent."""

import numpy as np
from hypothesis import given, strategies as st

from uavseg.occupancy.paths.astar import DIAGONAL, STRAIGHT, octile_cost, shortest_path

CELLS = st.tuples(st.integers(0, 30), st.integers(0, 40))
OPEN = np.ones((31, 41), bool)


@given(CELLS, CELLS)
def test_without_obstacles_the_octile_cost_is_that_of_the_path(
    start: tuple[int, int], goal: tuple[int, int]
) -> None:
    path = shortest_path(OPEN, start, goal)
    assert octile_cost(*start, *goal) == STRAIGHT * path.straight + DIAGONAL * path.diagonal


@given(CELLS, CELLS, st.integers(-1, 1), st.integers(-1, 1))
def test_no_step_comes_nearer_than_it_costs(
    cell: tuple[int, int], goal: tuple[int, int], down: int, right: int
) -> None:
    step = DIAGONAL if down and right else STRAIGHT
    after = octile_cost(cell[0] + down, cell[1] + right, *goal)
    assert abs(after - octile_cost(*cell, *goal)) <= step
    assert octile_cost(*cell, *goal) == octile_cost(*goal, *cell)


def test_a_diagonal_step_costs_the_square_root_of_two() -> None:
    assert abs(DIAGONAL**2 - 2 * STRAIGHT**2) == 1  # as near as integers come
