"""Corridors: swaths cover bent strips, rivers with branches and rings, in less way than a survey takes."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from tests.flight.cover.test_axis import fork
from tests.flight.cover.test_survey import SHAPES
from uavseg.flight.cover.corridor import Corridor, corridor, is_long_and_thin
from uavseg.flight.cover.lines import LEEWAY
from uavseg.flight.cover.survey import CoverParams, surveys


@st.composite
def rivers(draw: st.DrawFn) -> shapely.Polygon:
    """A winding river of changing width, sometimes with a side arm."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    turns = np.cumsum(rng.normal(0, 0.25, 30))
    xy = np.cumsum(40 * np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)
    half = 10 + 20 * rng.random(30).cumsum() / 15
    pieces = [shapely.LineString(xy[k : k + 2]).buffer(half[k]) for k in range(29)]
    if draw(st.booleans()):
        pieces.append(shapely.LineString([xy[15], xy[15] + rng.normal(0, 300, 2)]).buffer(12))
    return shapely.union_all(pieces)


def check(region: shapely.Polygon, flown: Corridor, spacing: float) -> None:
    """The laws of every corridor."""
    swaths = [shapely.LineString(line).buffer(spacing / 2 + 1e-5, cap_style="flat") for line in flown.lines]
    assert region.difference(shapely.union_all(swaths)).area <= 1e-3 * region.area
    allowed = region.buffer(LEEWAY * spacing + 1e-3)
    assert all(shapely.covers(allowed, shapely.LineString(path)) for path in (*flown.lines, *flown.legs))
    assert len(flown.legs) == len(flown.lines) - 1
    for k, leg in enumerate(flown.legs):
        assert leg[0].tolist() == flown.lines[k][-1].tolist()
        assert leg[-1].tolist() == flown.lines[k + 1][0].tolist()


@pytest.mark.slow
@given(rivers(), st.floats(12, 60))
@settings(max_examples=15)
def test_rivers(region: shapely.Polygon, spacing: float) -> None:
    check(region, corridor(region, spacing), spacing)


@pytest.mark.slow
@given(fields(), st.floats(8, 40))
@settings(max_examples=20)
def test_other_regions_are_covered_too(region: shapely.Polygon, spacing: float) -> None:
    check(region, corridor(region, spacing), spacing)


@pytest.mark.parametrize("name", ["ring", "spiral", "U", "E"])
def test_shapes(name: str) -> None:
    check(SHAPES[name], corridor(SHAPES[name], 12), 12)


@pytest.mark.slow
def test_long_bent_regions_are_flown_in_less_way_and_turns_than_by_a_survey() -> None:
    river = shapely.LineString([(0, 0), (300, 80), (420, 380), (800, 420), (900, 60)]).buffer(14)
    for region, spacing in ((SHAPES["spiral"], 10), (river, 15), (fork(), 12)):
        one, other = corridor(region, spacing), surveys(region, CoverParams(spacing))[0]
        check(region, one, spacing)
        assert one.length_m < 0.9 * other.length_m and one.turns < other.turns / 2


def test_a_thin_ring_is_one_line() -> None:
    ring = shapely.Point(0, 0).buffer(200) - shapely.Point(0, 0).buffer(185)
    flown = corridor(ring, 20)
    assert len(flown.lines) == 1 and flown.length_m == pytest.approx(2 * np.pi * 192.5, rel=0.03)


def test_straight_and_round_regions_are_not_bent() -> None:
    assert not is_long_and_thin(shapely.box(0, 0, 1000, 30), 20)
    assert not is_long_and_thin(shapely.Point(0, 0).buffer(300), 20)
    assert is_long_and_thin(SHAPES["spiral"], 10)


@pytest.mark.slow
def test_the_same_region_gives_the_same_lines() -> None:
    one, other = corridor(SHAPES["spiral"], 9), corridor(SHAPES["spiral"], 9)
    assert all(np.array_equal(a, b) for a, b in zip(one.lines, other.lines, strict=True))
