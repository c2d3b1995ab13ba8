"""Strips: their lines cover the polygon, lines of simple shapes, links, and what is refused."""

import math

import numpy as np
import pytest
import shapely
from tests.flight.cover.cover_fields import fields
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.errors import MissionError, ParameterError
from uavseg.flight.cover.strips import strips


@given(fields(), st.floats(4, 40), st.floats(0, 180))
@settings(deadline=None, max_examples=60)
def test_swaths_of_the_lines_cover_the_polygon(field: shapely.Polygon, spacing: float, angle: float) -> None:
    cut = strips(field, spacing, angle)
    swaths = shapely.buffer(shapely.linestrings(cut.lines), spacing / 2 + 1e-6, cap_style="flat")
    left = shapely.difference(field, shapely.union_all(swaths)).area
    assert left <= 1e-3 * field.area


@given(fields(), st.floats(4, 40), st.floats(0, 180), st.floats(0, 30))
@settings(deadline=None, max_examples=60)
def test_a_reach_beyond_the_ends_shortens_lines_and_still_covers(
    field: shapely.Polygon, spacing: float, angle: float, reach: float
) -> None:
    cut = strips(field, spacing, angle, reach)
    assert cut.length_m <= strips(field, spacing, angle).length_m + 1e-9
    unit = np.array([math.sin(math.radians(cut.angle_deg)), math.cos(math.radians(cut.angle_deg))])
    longer = cut.lines + np.array([-1, 1])[None, :, None] * unit * (reach + 1e-6)
    swaths = shapely.buffer(shapely.linestrings(longer), spacing / 2 + 1e-6, cap_style="flat")
    assert shapely.difference(field, shapely.union_all(swaths)).area <= 1e-3 * field.area


@given(fields(), st.floats(4, 40), st.floats(0, 180))
@settings(deadline=None, max_examples=40)
def test_lines_stay_within_half_a_spacing_of_the_polygon(
    field: shapely.Polygon, spacing: float, angle: float
) -> None:
    cut = strips(field, spacing, angle)
    allowed = shapely.buffer(field, spacing / 2 + 1e-3, quad_segs=32)
    assert shapely.covers(shapely.buffer(allowed, 0.05), shapely.linestrings(cut.lines)).all()


def test_a_tooth_between_two_lines_gets_a_line_of_its_own() -> None:
    comb = shapely.box(0, 0, 100, 20) | shapely.box(41, 20, 44, 60)
    cut = strips(comb, 20, 90)
    assert len(cut) == 3
    swaths = shapely.buffer(shapely.linestrings(cut.lines), 10.01, cap_style="flat")
    assert shapely.difference(comb, shapely.union_all(swaths)).area < 1e-6


def test_links_follow_the_shape_of_a_ring() -> None:
    ring = shapely.box(0, 0, 50, 50) - shapely.box(20, 20, 30, 30)
    cut = strips(ring, 10, 90)
    assert np.bincount(cut.strip).tolist() == [1, 1, 2, 1, 1]
    assert cut.links.tolist() == [[0, 1], [1, 2], [1, 3], [2, 4], [3, 4], [4, 5]]


def test_a_hole_smaller_than_a_strip_is_flown_over() -> None:
    pierced = shapely.box(0, 0, 50, 50) - shapely.box(22, 22, 28, 28)
    assert len(strips(pierced, 10, 90)) == 5


@pytest.mark.parametrize("spacing", [0, -1, math.nan, math.inf])
def test_a_spacing_that_is_none_is_refused(spacing: float) -> None:
    with pytest.raises(ParameterError, match="spacing"):
        strips(shapely.box(0, 0, 1, 1), spacing, 0)


def test_more_lines_than_a_mission_holds_are_refused() -> None:
    with pytest.raises(MissionError, match="wider spacing"):
        strips(shapely.box(0, 0, 1000, 1000), 0.01, 0)
