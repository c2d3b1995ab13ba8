"""Division into flights: every piece once and in order, each flight within its limits, and the least time."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.flight.small_regions import box, flights, waypoints
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import LimitParams
from uavseg.flight.planning.split import FlightLimits, RegionRoute, split_route

HOME = np.zeros(2)


def leg_seconds(xy: np.ndarray) -> np.ndarray:
    """One metre a second, and stops."""
    return np.hypot(*np.diff(xy, axis=0).T)


def route(points: np.ndarray) -> RegionRoute:
    pieces = [Track.of_path(np.array([point])) for point in points]
    ways = [Track.transit(np.array(pair)) for pair in itertools.pairwise(points)]
    return RegionRoute(HOME, tuple(pieces), tuple(ways), FreeSpace())


def limits(seconds: float, items: float = math.inf) -> FlightLimits:
    return FlightLimits(seconds, items, 10.0, 4, leg_seconds)


def seconds_of(flight: np.ndarray) -> float:
    return float(leg_seconds(np.concatenate([HOME[None], flight, HOME[None]])).sum()) + 10


def least_by_trying(points: np.ndarray, most: float) -> float:
    """All ways to cut, plainly."""
    best = math.inf
    for cuts in itertools.product([False, True], repeat=len(points) - 1):
        ends = [0, *(k + 1 for k, cut in enumerate(cuts) if cut), len(points)]
        spent = [seconds_of(points[a:b]) for a, b in itertools.pairwise(ends)]
        if max(spent) <= most:
            best = min(best, sum(spent))
    return best


@given(st.integers(0, 10**6), st.integers(1, 8))
@settings(max_examples=60)
def test_flights_take_the_least_time_of_all_ways_to_cut(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-100, 100, (count, 2))
    most = rng.uniform(1, 3) * (2 * np.hypot(*points.T).max() + 10)
    found = split_route(route(points), limits(most))
    assert np.array_equal(np.concatenate([flight.xy for flight in found]), points)
    total = sum(seconds_of(flight.xy) for flight in found)
    assert max(seconds_of(flight.xy) for flight in found) <= most * 1.001
    assert total <= least_by_trying(points, most / 1.001) * 1.001 or len(found) == 1


def test_items_divide_as_time_does() -> None:
    points = np.column_stack([np.arange(1.0, 31.0), np.zeros(30)])
    found = split_route(route(points), limits(math.inf, 14))
    assert [len(flight.xy) for flight in found] == [10, 10, 10]


def test_a_line_that_is_longer_than_a_flight_is_flown_in_parts() -> None:
    line = Track(np.array([[500.0, -1000.0], [500.0, 1000.0]]), np.array([25.0]), np.array([True]))
    long = RegionRoute(HOME, (line,), (), FreeSpace())
    found = split_route(long, limits(3000))
    covered = shapely.union_all([shapely.LineString(flight.xy) for flight in found])
    assert len(found) > 1 and covered.length == pytest.approx(2000)
    assert all(set(flight.trigger_m[flight.is_line].tolist()) == {25} for flight in found)


def test_what_fits_into_no_flight_is_refused() -> None:
    far = route(np.array([[10.0, 0.0], [900.0, 0.0]]))
    with pytest.raises(MissionError, match=r"needs more than 30\.2 min, .* 20\.0 min .* --endurance"):
        split_route(far, limits(1200))


def test_a_mission_is_divided_by_endurance_and_by_items() -> None:
    regions = [box(200 * k, 150, 150, 150) for k in range(4)]
    survey = {"pattern": "survey", "spacing_m": 15.0}
    (whole,) = flights(regions, **survey)
    assert whole.duration_s > 700
    by_time = flights(regions, **survey, limits=LimitParams(10, 30))
    by_items = flights(regions, **survey, limits=LimitParams(max_items=30))
    assert all(mission.duration_s <= 420 for mission in by_time) and len(by_time) >= 2
    assert all(len(mission.items) <= 30 for mission in by_items) and len(by_items) >= 3
    for parts in (by_time, by_items):
        assert {place for mission in parts for place in waypoints(mission)} >= set(waypoints(whole))
        assert any("divided into" in text for text in parts[0].warnings)


def test_an_endurance_that_is_too_short_for_any_region_is_refused() -> None:
    with pytest.raises(MissionError, match="--endurance"):
        flights([box(2000, 0, 50, 50)], limits=LimitParams(5))


@pytest.mark.parametrize(
    "wrong", [{"endurance_min": 0.0}, {"endurance_min": math.nan}, {"reserve": 100.0}, {"max_items": 3}]
)
def test_limits_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ParameterError):
        LimitParams(**wrong)  # type: ignore[arg-type]
