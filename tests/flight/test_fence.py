"""Fences and rally points: positions on Earth, simple outlines, winding."""

import math
from dataclasses import replace
from typing import Any

import pytest

from tests.flight.fences import BOX, FENCE, RALLY
from tests.flight.mission_items import waypoint
from uavseg.errors import MissionError
from uavseg.flight.mission.items import FenceCircle, FencePolygon, HomePosition, RallyPoint
from uavseg.flight.mission.mission import Mission

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))  # north, then east: clockwise


def test_vertices_are_stored_clockwise_from_the_same_first_one() -> None:
    assert FencePolygon(SQUARE).vertices == SQUARE
    assert FencePolygon((SQUARE[0], *SQUARE[:0:-1])).vertices == SQUARE


def test_a_closed_ring_is_stored_open() -> None:
    assert FencePolygon((*SQUARE, SQUARE[0])).vertices == SQUARE


def test_a_fence_across_the_antimeridian_is_clockwise_too() -> None:
    square = ((0.0, 179.9), (0.1, 179.9), (0.1, -179.9), (0.0, -179.9))
    assert FencePolygon(square).vertices == square
    assert FencePolygon(square[::-1]).vertices == (square[3], *square[:3])


@pytest.mark.parametrize(
    ("vertices", "words"),
    [
        ((), "three vertices; this one has 0"),
        (SQUARE[:2], "three vertices; this one has 2"),
        ((SQUARE[0], SQUARE[1], SQUARE[0], SQUARE[1]), "three vertices; this one has 2"),
        (((0, 0), (1, 1), (1, 0), (0, 1)), "crosses"),
        (((47, 8), (47.1, 8), (math.nan, 8.1)), "finite"),
        (((47, 8), (47.1, 8), (97, 8.1)), "swapped"),
    ],
)
def test_a_polygon_that_is_no_area_on_earth_is_refused(vertices: Any, words: str) -> None:
    with pytest.raises(MissionError, match=words):
        FencePolygon(vertices)


@pytest.mark.parametrize("radius_m", [0.0, -1.0, 1e6, math.nan, math.inf])
def test_the_radius_of_a_circle_is_positive_and_not_absurd(radius_m: float) -> None:
    with pytest.raises(MissionError, match="radius"):
        FenceCircle(47, 8, radius_m)
    with pytest.raises(MissionError, match=r"-90\.\.90"):
        FenceCircle(97, 8, 10)


@pytest.mark.parametrize("altitude_m", [0.0, -1.0, 1001.0, math.nan])
def test_a_rally_point_is_above_home(altitude_m: float) -> None:
    with pytest.raises(MissionError, match="rally point"):
        RallyPoint(47, 8, altitude_m)
    with pytest.raises(MissionError, match="rally point"):
        RallyPoint(97, 8, 50)


def test_a_mission_has_its_fence_near_home_with_polygons_first() -> None:
    mission = Mission(HomePosition(-33.85, 151.21), (waypoint(-33.85, 151.21),), fence=FENCE, rally=RALLY)
    assert mission.fence == (FENCE[0], FENCE[2], FENCE[1])
    assert mission != replace(mission, fence=()) and mission != replace(mission, rally=())
    with pytest.raises(MissionError, match=r"the fence lies .* km from home"):
        Mission(HomePosition(47, 8), (waypoint(),), fence=(BOX,))
    with pytest.raises(MissionError, match=r"a rally point lies .* km from home"):
        Mission(HomePosition(47, 8), (waypoint(),), rally=RALLY)
