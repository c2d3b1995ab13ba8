"""Fence check: legs against inclusions and exclusions, compared with points along the legs."""

import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.flight.fences import fences
from tests.flight.mission_items import waypoint
from uavseg.flight.mission.items import (
    FRAME_MISSION,
    RETURN,
    Fence,
    FenceCircle,
    FencePolygon,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission
from uavseg.flight.safety.check import fence_problems
from uavseg.raster.geodesy.globe import geod_wgs84

BOX = FencePolygon(((46.99, 7.99), (47.01, 7.99), (47.01, 8.01), (46.99, 8.01)))


def flight(*fence: Fence, lat: float = 47.005) -> Mission:
    back = MissionItem(RETURN, FRAME_MISSION)
    return Mission(HomePosition(47.0, 8.0), (waypoint(lat), back), fence=fence)


def test_a_flight_inside_of_its_fence_has_no_problem() -> None:
    assert fence_problems(flight()) == []
    assert fence_problems(flight(BOX, FenceCircle(47.0, 8.0, 600.0))) == []
    assert fence_problems(flight(FenceCircle(47.002, 8.005, 300.0, False))) == []


@pytest.mark.parametrize(
    ("fence", "words"),
    [
        (BOX, r"leaves the fence \(shape 1\) near 47\.01"),
        (FenceCircle(47.0, 8.0, 500.0), "leaves the fence"),
        (FenceCircle(47.01, 8.0001, 30.0, False), "enters the zone to keep out of"),
        (FencePolygon(((47.005, 7.999), (47.005, 8.001), (47.006, 8.0)), False), r"near 47\.00[56]"),
    ],
)
def test_a_leg_across_a_fence_is_found(fence: Fence, words: str) -> None:
    [problem] = fence_problems(flight(fence, lat=47.02))
    assert re.search(words, problem)


def crossed(shape: Fence, mission: Mission) -> float:
    """Share of points along the legs on the wrong side of a circle, by geodesic distances."""
    assert isinstance(shape, FenceCircle)
    lat, lon, _ = mission.path
    t = np.linspace(0, 1, 400)
    lats = np.concatenate([a + t * (b - a) for a, b in pairwise(lat)])
    lons = np.concatenate([a + t * (b - a) for a, b in pairwise(lon)])
    n = len(lats)
    away = geod_wgs84().inv(np.full(n, shape.lon), np.full(n, shape.lat), lons, lats)[2]
    inside = away < shape.radius_m
    return float((~inside if shape.inclusion else inside).mean())


@pytest.mark.slow
@given(
    fence=fences.map(lambda shapes: [one for one in shapes if isinstance(one, FenceCircle)]),
    spots=st.lists(st.tuples(st.floats(-33.88, -33.82), st.floats(151.15, 151.25)), min_size=1, max_size=4),
)
@settings(max_examples=60)
def test_circles_are_judged_as_by_points_along_the_legs(
    fence: list[FenceCircle], spots: list[tuple[float, float]]
) -> None:
    items = tuple(waypoint(lat, lon) for lat, lon in spots)
    mission = Mission(HomePosition(-33.85, 151.2), items, fence=tuple(fence))
    found = fence_problems(mission)
    for number, shape in enumerate(mission.fence, start=1):
        wrong = any(f"(shape {number})" in one for one in found)
        share = crossed(shape, mission)
        if share > 0.01:
            assert wrong
        if not wrong:
            assert share < 0.01
