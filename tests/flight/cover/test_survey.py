"""Surveys: swaths cover the region, lines and legs stay near it, and the path is one piece."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from shapely.affinity import rotate

from tests.flight.cover.cover_fields import fields
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.cover.lines import LEEWAY
from uavseg.flight.cover.survey import CoverParams, Survey, surveys


def spiral() -> shapely.Polygon:
    turn = np.linspace(0, 6 * np.pi, 200)
    radius = 8 + 5.5 * turn
    return shapely.LineString(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])).buffer(9)


SHAPES = {
    "comb": shapely.union_all(
        [shapely.box(0, 0, 160, 10), *(shapely.box(x, 0, x + 6, 80) for x in range(0, 160, 14))]
    ),
    "ring": shapely.Point(0, 0).buffer(100) - shapely.Point(10, 0).buffer(60),
    "spiral": spiral(),
    "E": shapely.union_all(
        [shapely.box(0, 0, 20, 100), *(shapely.box(0, y, 70, y + 20) for y in (0, 40, 80))]
    ),
    "U": shapely.box(0, 0, 90, 90) - shapely.box(30, 30, 60, 91),
    "holes": shapely.box(0, 0, 120, 90)
    - shapely.union_all([shapely.Point(x, y).buffer(9) for x in (25, 60, 95) for y in (25, 65)]),
}


def survey(region: shapely.Polygon, params: CoverParams, obstacles: Sequence[object] = ()) -> Survey:
    return surveys(region, params, obstacles)[0]


def farthest_m(region: shapely.Polygon, paths: Sequence[np.ndarray]) -> float:
    """Greatest distance of paths to a region, at places every half metre."""
    dense = shapely.segmentize([shapely.LineString(path) for path in paths], 0.5)
    return float(shapely.distance(region, shapely.points(shapely.get_coordinates(dense))).max())


def check(region: shapely.Polygon, flown: Survey, params: CoverParams) -> None:
    """The laws of every survey."""
    unit = np.array([math.sin(math.radians(flown.angle_deg)), math.cos(math.radians(flown.angle_deg))])
    along = np.sign(((flown.lines[:, 1] - flown.lines[:, 0]) @ unit) + 1e-12)[:, None]
    longer = flown.lines.copy()
    longer[:, 0] -= along * unit * (params.reach_m + 1e-6)
    longer[:, 1] += along * unit * (params.reach_m + 1e-6)
    swaths = shapely.buffer(shapely.linestrings(longer), params.spacing_m / 2 + 1e-6, cap_style="flat")
    assert shapely.difference(region, shapely.union_all(swaths)).area <= 1e-3 * region.area
    near_m = LEEWAY * params.spacing_m
    assert farthest_m(region, flown.lines) <= near_m + 1e-3
    assert farthest_m(region, [*flown.outer, *flown.legs]) <= near_m + params.lead_m + 1e-3
    assert len(flown.legs) == len(flown.lines) - 1
    for k, leg in enumerate(flown.legs):
        assert leg[0].tolist() == flown.outer[k, 1].tolist()
        assert leg[-1].tolist() == flown.outer[k + 1, 0].tolist()


@pytest.mark.slow
@given(fields(), st.floats(6, 40), st.sampled_from([0.0, 0.5, 1.1]), st.none() | st.floats(0, 180))
@settings(max_examples=40)
def test_random_fields_with_holes(
    field: shapely.Polygon, spacing: float, reach: float, angle: float | None
) -> None:
    params = CoverParams(spacing, angle, reach * spacing)
    flown = survey(field, params)
    check(field, flown, params)
    assert angle is None or flown.angle_deg == pytest.approx(angle % 180)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("turn", [0, 20])
def test_shapes_that_are_hard_to_cover(name: str, turn: float) -> None:
    region = rotate(SHAPES[name], turn)
    params = CoverParams(7)
    check(region, survey(region, params), params)


@pytest.mark.parametrize("turn", [0.0, 30.0, 77.0])
def test_a_rectangle_is_flown_along_its_long_side(turn: float) -> None:
    flown = survey(rotate(shapely.box(0, 0, 60, 300), -turn), CoverParams(20))
    assert flown.angle_deg == pytest.approx(turn, abs=0.01) or flown.angle_deg == pytest.approx(180, abs=0.01)
    assert (len(flown.lines), flown.cells, flown.turns) == (3, 1, 4)
    assert flown.length_m == pytest.approx(3 * 300 + 2 * 20)


@pytest.mark.slow
def test_large_fields_are_flown_in_little_more_than_their_area_by_the_spacing() -> None:
    for region, most in (
        (SHAPES["U"], 1.15),
        (SHAPES["holes"], 1.15),
        (SHAPES["ring"], 1.15),
        (SHAPES["E"], 1.15),
        (shapely.box(0, 0, 100, 140), 1.05),
    ):
        large = shapely.affinity.scale(region, 8, 8)
        flown = survey(large, CoverParams(20, None, 22))
        assert flown.length_m <= most * large.area / 20


def test_legs_go_around_obstacles() -> None:
    region = shapely.box(0, 0, 100, 100) - shapely.box(40, 20, 60, 80)
    zone = shapely.box(41, 21, 59, 79)
    flown = survey(region, CoverParams(30, 90), [zone])
    assert not any(shapely.LineString(leg).intersection(zone.buffer(-0.01)).length for leg in flown.legs)


@pytest.mark.slow
def test_the_same_region_gives_the_same_survey() -> None:
    one, other = (survey(SHAPES["holes"], CoverParams(9)) for _ in range(2))
    assert np.array_equal(one.lines, other.lines)
    assert all(np.array_equal(a, b) for a, b in zip(one.legs, other.legs, strict=True))


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_an_angle_that_is_none_is_refused(angle: float) -> None:
    with pytest.raises(ParameterError, match="azimuth"):
        survey(shapely.box(0, 0, 9, 9), CoverParams(3, angle))


def test_more_lines_than_a_mission_holds_are_refused() -> None:
    with pytest.raises(MissionError, match="wider spacing"):
        survey(shapely.box(0, 0, 1000, 1000), CoverParams(0.01))


@pytest.mark.slow
@given(fields(), st.floats(8, 40), st.none() | st.floats(0, 180))
@settings(max_examples=15)
def test_a_crosshatch_covers_twice_at_a_right_angle(
    field: shapely.Polygon, spacing: float, angle: float | None
) -> None:
    params = CoverParams(spacing, angle, crosshatch=True)
    flown = survey(field, params)
    step = flown.lines[:, 1] - flown.lines[:, 0]
    azimuth = np.radians(flown.angle_deg)
    along = np.abs(step @ [np.sin(azimuth), np.cos(azimuth)]) > np.hypot(*step.T) / 2
    assert angle is None or flown.angle_deg == pytest.approx(angle % 180)
    for chosen in (along, ~along):
        swaths = shapely.buffer(
            shapely.linestrings(flown.lines[chosen]), spacing / 2 + 1e-6, cap_style="flat"
        )
        assert shapely.difference(field, shapely.union_all(swaths)).area <= 1e-3 * field.area


@pytest.mark.slow
@given(fields(), st.floats(8, 40), st.floats(5, 60))
@settings(max_examples=15)
def test_turnarounds_are_straight_and_stay_near(field: shapely.Polygon, spacing: float, lead: float) -> None:
    params = CoverParams(spacing, lead_m=lead)
    flown = survey(field, params)
    check(field, flown, params)
    for line, outer in zip(flown.lines, flown.outer, strict=True):
        longer = np.hypot(*(outer[1] - outer[0])) - np.hypot(*(line[1] - line[0]))
        assert longer == pytest.approx(2 * lead) and shapely.LineString(outer).distance(
            shapely.points(line)
        ).max() == pytest.approx(0, abs=1e-6)


def test_turnarounds_are_shorter_where_an_obstacle_is_near() -> None:
    field, wall = shapely.box(0, 0, 100, 40), shapely.box(110, -100, 112, 140)
    flown = survey(field, CoverParams(20, 90, lead_m=30), [wall])
    assert not any(shapely.LineString(outer).crosses(wall) for outer in flown.outer)
    assert flown.outer[..., 0].min() == pytest.approx(-30) and 100 < flown.outer[..., 0].max() <= 110
