"""Outlines around areas of many corners: they hold the area, stay within the reach and have fewer corners."""

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.pixel_regions import pixel_region
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing, without_small_holes


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from([1.0, 3.0, 12.0, 60.0]))
@settings(max_examples=10)
def test_an_outline_holds_the_area_within_the_reach(seed: int, reach: float) -> None:
    area = shapely.union_all(pixel_region(160, seed))
    around = enclosing(area, reach)
    assert shapely.covers(around, area)
    corners = shapely.points(shapely.get_coordinates(around))
    assert shapely.distance(area, corners).max() <= reach * 1.001
    assert shapely.get_num_coordinates(area) > MANY_CORNERS
    if reach >= 3:
        assert shapely.get_num_coordinates(around) < 0.7 * shapely.get_num_coordinates(area)


def test_an_area_of_few_corners_is_left_as_it_is() -> None:
    area = shapely.box(0, 0, 9, 9)
    assert enclosing(area, 5) is area


@pytest.mark.parametrize("always", [False, True])
def test_nothing_is_lost_where_simplified_rings_cross_themselves(
    monkeypatch: pytest.MonkeyPatch, always: bool
) -> None:
    area = shapely.union_all(pixel_region(160, 1))
    true = shapely.simplify

    def losing(shapes: Any, tolerance: float, preserve_topology: bool = True) -> Any:
        simple = true(shapes, tolerance, preserve_topology=preserve_topology)
        return simple if preserve_topology and not always else np.full(len(shapes), shapely.Polygon())

    monkeypatch.setattr(shapely, "simplify", losing)
    assert shapely.covers(enclosing(area, 5), area)


def test_small_holes_are_filled() -> None:
    area = shapely.box(0, 0, 90, 90) - shapely.box(10, 10, 14, 15) - shapely.box(20, 20, 25, 25)
    assert without_small_holes(area, 20.0).equals(area)
    assert without_small_holes(area, 25.0).area == 90 * 90 - 25
    assert without_small_holes(area, 26.0).equals(shapely.box(0, 0, 90, 90))
