"""Medial axis: in the middle, as many branches as a shape has, bumps pruned."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from uavseg.flight.cover.corridor import medial_axis


def fork(width: float = 20) -> shapely.Polygon:
    arms = [(math.sin(k * 2.1) * 200, math.cos(k * 2.1) * 200) for k in range(3)]
    return shapely.union_all([shapely.LineString([(0, 0), arm]).buffer(width / 2) for arm in arms])


@pytest.mark.slow
@given(st.floats(10, 60), st.floats(150, 600), st.floats(0, 180))
@settings(max_examples=25)
def test_the_axis_of_a_strip_is_its_middle(width: float, length: float, turn: float) -> None:
    strip = shapely.affinity.rotate(shapely.box(0, 0, length, width), turn, origin=(0, 0))
    [branch] = medial_axis(strip, width / 4)
    middle = shapely.affinity.rotate(
        shapely.LineString([(0, width / 2), (length, width / 2)]), turn, origin=(0, 0)
    )
    assert shapely.distance(shapely.points(branch.xy), middle).max() < width / 10
    assert branch.ends_free == (True, True)
    assert shapely.LineString(branch.xy).length == pytest.approx(length - width, abs=width)
    radius = shapely.distance(strip.boundary, shapely.points(branch.xy))
    assert np.allclose(branch.radius_m, radius)


@pytest.mark.slow
def test_a_fork_has_three_branches_that_meet() -> None:
    branches = medial_axis(fork(), 5)
    assert len(branches) == 3
    assert sorted(sum(branch.ends_free) for branch in branches) == [1, 1, 1]
    ends = np.round([branch.xy[0] if branch.ends_free[1] else branch.xy[-1] for branch in branches], 3)
    assert (ends == ends[0]).all() and np.hypot(*ends[0]) < 10


def test_a_ring_has_one_loop() -> None:
    [branch] = medial_axis(shapely.Point(0, 0).buffer(100) - shapely.Point(0, 0).buffer(80), 5)
    assert (branch.xy[0] == branch.xy[-1]).all() and branch.ends_free == (False, False)
    assert np.hypot(*branch.xy.T) == pytest.approx(90, abs=1)


def test_bumps_have_no_branch() -> None:
    bumps = [shapely.box(x, 20, x + 6, 26) for x in range(20, 380, 40)]
    assert len(medial_axis(shapely.union_all([shapely.box(0, 0, 400, 20), *bumps]), 5)) == 1
