"""Surveys: every piece once, short legs, cells flown one after another."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.affinity import rotate

from tests.flight.survey_regions import HOLES, RING, U
from uavseg.flight.legs import leaving_hull, legs_between, lengths_m, outside_m
from uavseg.flight.survey import reverse_path, survey
from uavseg.flight.sweep import sweep

COMB = shapely.union_all(
    [shapely.box(0, 0, 260, 40), *(shapely.box(x, 0, x + 30, 150) for x in range(0, 260, 57))]
)


SHAPES = [U, COMB, RING, HOLES, shapely.box(0, 0, 50, 400)]


def rows(segments: NDArray[np.float64]) -> list[list[float]]:
    """Pieces without direction, in one order."""
    ends = np.sort(segments.round(6).reshape(-1, 2).view("f8,f8").reshape(-1, 2), axis=1)
    return sorted(ends.view("f8").reshape(-1, 4).tolist())


@given(st.sampled_from(SHAPES), st.floats(5, 60), st.none() | st.floats(0, 180))
@settings(max_examples=40, deadline=None)
def test_every_piece_is_flown_once_and_no_leg_leaves_the_hull(
    region: shapely.Polygon, spacing_m: float, angle_deg: float | None
) -> None:
    flown = survey(region, spacing_m, angle_deg)
    for path in flown.paths:
        assert rows(path) == rows(sweep(region, spacing_m, flown.angle_deg).segments)
        assert len(leaving_hull(region, legs_between(path), spacing_m)) == 0


def test_a_convex_region_is_flown_to_and_fro() -> None:
    first, second = (path.round(6) for path in survey(shapely.box(0, 0, 100, 35), 10, 90).paths)
    assert first[:, :, 0].tolist() == [[0, 100], [100, 0], [0, 100], [100, 0]]
    assert first[:, 0, 1].tolist() == second[:, 0, 1].tolist()
    assert (np.diff(first[:, 0, 1]) == np.diff(first[:, 0, 1])[0]).all()
    assert second[:, :, 0].tolist() == [[100, 0], [0, 100], [100, 0], [0, 100]]


@pytest.mark.parametrize("turn_deg", [0, 17, 101.5])
@pytest.mark.parametrize(("region", "most"), [(U, 0.0), (COMB, 0.0), (RING, 120.0), (HOLES, 130.0)])
def test_little_is_flown_between_pieces_and_hardly_outside(
    region: shapely.Polygon, most: float, turn_deg: float
) -> None:
    turned = rotate(region, turn_deg, origin=(0, 0))
    path = survey(turned, 15, -turn_deg).paths[0]
    assert outside_m(turned, legs_between(path)).sum() <= most + 1e-6
    least = 15 * (len(path) - 1)
    assert lengths_m(legs_between(path)).sum() <= 2 * least


def test_a_long_step_to_the_next_line_is_avoided() -> None:
    """Flying the arms to and fro with the bottom would step from the top of an arm down to the bottom."""
    wide = shapely.box(0, 0, 200, 200) - shapely.box(50, 60, 150, 200)
    path = survey(wide, 20, 0).paths[0]
    assert lengths_m(legs_between(path)).sum() <= 20 * len(path) + 25


def test_the_arms_of_a_u_are_flown_one_after_the_other() -> None:
    """Lines across the arms are cut; each arm is flown whole before the other one."""
    path = survey(U, 15, 90).paths[0]
    left = path[:, :, 0].max(axis=1) <= 60.1
    right = path[:, :, 0].min(axis=1) >= 139.9
    assert left.any() and right.any()
    for arm in (left, right):
        where = np.flatnonzero(arm)
        assert (np.diff(where) == 1).all()


def test_a_small_hole_does_not_split_a_survey() -> None:
    region = shapely.box(0, 0, 200, 100) - shapely.box(96, 0.5, 104, 99.5)
    flown = survey(region, 10, 90)
    assert flown.cells == 1
    assert len(flown.paths[0]) == 20


def test_a_survey_is_the_same_every_time() -> None:
    assert np.array_equal(survey(HOLES, 7).paths[0], survey(HOLES, 7).paths[0])


def test_a_path_reversed_twice_is_the_path() -> None:
    path = survey(U, 15).paths[0]
    assert np.array_equal(reverse_path(reverse_path(path)), path)
    assert np.array_equal(reverse_path(path)[0], path[-1, ::-1])
