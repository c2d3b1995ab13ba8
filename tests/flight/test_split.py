"""Division into flights: every piece once and in order, each flight within its limits, and the least time."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.small_regions import box, flights, waypoints
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import LimitParams
from uavseg.flight.planning.split import FlightLimits, RegionRoute, items_of, split_route

HOME = np.zeros(2)


def leg_seconds(xy: np.ndarray) -> np.ndarray:
    """One metre a second, and stops."""
    return np.hypot(*np.diff(xy, axis=0).T)


def route(points: np.ndarray) -> RegionRoute:
    pieces = [Track.of_path(np.array([point])) for point in points]
    ways = [Track.transit(np.array(pair)) for pair in itertools.pairwise(points)]
    return RegionRoute(HOME, tuple(pieces), tuple(ways), FreeSpace(), np.arange(len(pieces)))


def limits(seconds: float, items: float = math.inf, flights: int | None = None) -> FlightLimits:
    return FlightLimits(
        seconds=seconds,
        items=items,
        fixed_s=10.0,
        fixed_items=4,
        count=items_of,
        costs=lambda track: (leg_seconds(track.xy), np.zeros(len(track.is_line))),
        ways=lambda home, places, lengths: (lengths, lengths),
        flights=flights,
    )


def seconds_of(flight: np.ndarray) -> float:
    return float(leg_seconds(np.concatenate([HOME[None], flight, HOME[None]])).sum()) + 10


def cuts(points: np.ndarray) -> Iterator[list[np.ndarray]]:
    """All ways to cut an order, plainly."""
    for chosen in itertools.product([False, True], repeat=len(points) - 1):
        ends = [0, *(k + 1 for k, cut in enumerate(chosen) if cut), len(points)]
        yield [points[a:b] for a, b in itertools.pairwise(ends)]


def fewest_by_trying(points: np.ndarray, most: float) -> tuple[int, float]:
    """Least number of flights in this order, and the least longest of so many."""
    fits = [(len(some), max(map(seconds_of, some))) for some in cuts(points)]
    return min(pair for pair in fits if pair[1] <= most)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 8))
@settings(max_examples=60)
def test_flights_are_the_fewest_and_of_like_length(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-100, 100, (count, 2))
    most = rng.uniform(1, 3) * (2 * np.hypot(*points.T).max() + 10)
    found = split_route(route(points), limits(most))
    order = np.concatenate([flight.xy for flight in found])
    assert sorted(map(tuple, order)) == sorted(map(tuple, points))
    longest = max(seconds_of(flight.xy) for flight in found)
    number, _ = fewest_by_trying(points, most)
    assert longest <= most * 1.001 and len(found) <= number
    if len(found) > 1:
        _, least = min(
            pair for pair in ((len(s), max(map(seconds_of, s))) for s in cuts(order)) if pair[0] == len(found)
        )
        assert longest <= least * 1.021


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(3, 6))
@settings(max_examples=25)
def test_no_order_needs_fewer_flights(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-100, 100, (count, 2))
    most = rng.uniform(1, 2) * (2 * np.hypot(*points.T).max() + 10)
    found = split_route(route(points), limits(most))
    fewest = min(
        fewest_by_trying(points[list(order)], most)[0] for order in itertools.permutations(range(count))
    )
    assert len(found) == fewest


@pytest.mark.slow
def test_as_many_flights_as_requested_are_of_like_length() -> None:
    points = np.column_stack([np.arange(1.0, 31.0), np.zeros(30)])
    for count in (1, 2, 3, 7, 30):
        found = split_route(route(points), limits(math.inf, flights=count))
        assert len(found) == count and np.array_equal(np.concatenate([one.xy for one in found]), points)
    line = Track(np.array([[500.0, -1000.0], [500.0, 1000.0]]), np.array([25.0]), np.array([True]))
    long = RegionRoute(HOME, (line,), (), FreeSpace(), np.zeros(1, int))
    for count in (2, 3, 5):
        found = split_route(long, limits(math.inf, flights=count))
        spent = [seconds_of(flight.xy) for flight in found]
        assert len(found) == count and max(spent) < 1.3 * min(spent)
    with pytest.raises(MissionError, match="too few parts for 31 flights; give --flights 30"):
        split_route(route(points), limits(math.inf, flights=31))
    with pytest.raises(MissionError, match="give --flights 2"):
        split_route(route(np.array([[30.0, 0.0], [-30.0, 0.0]])), limits(75, flights=1))


def test_items_divide_as_time_does() -> None:
    points = np.column_stack([np.arange(1.0, 31.0), np.zeros(30)])
    found = split_route(route(points), limits(math.inf, 14))
    assert [len(flight.xy) for flight in found] == [10, 10, 10]


def test_a_line_that_is_longer_than_a_flight_is_flown_in_parts() -> None:
    line = Track(np.array([[500.0, -1000.0], [500.0, 1000.0]]), np.array([25.0]), np.array([True]))
    long = RegionRoute(HOME, (line,), (), FreeSpace(), np.zeros(1, int))
    found = split_route(long, limits(3000))
    covered = shapely.union_all([shapely.LineString(flight.xy) for flight in found])
    assert len(found) > 1 and covered.length == pytest.approx(2000)
    assert all(set(flight.trigger_m[flight.is_line].tolist()) == {25} for flight in found)


def test_what_fits_into_no_flight_is_refused() -> None:
    far = route(np.array([[10.0, 0.0], [900.0, 0.0]]))
    with pytest.raises(MissionError, match=r"needs more than 30\.2 min, .* 20\.0 min .* --endurance"):
        split_route(far, limits(1200))


@pytest.mark.slow
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


@pytest.mark.slow
def test_vehicles_in_the_air_at_once_are_apart_in_height_and_take_as_long() -> None:
    regions = [box(200 * k, 150, 150, 150) for k in range(4)]
    survey = {"pattern": "survey", "spacing_m": 15.0}
    (alone,) = flights(regions, **survey)
    for count in (2, 3):
        found = flights(regions, **survey, limits=LimitParams(vehicles=count))
        assert len(found) == count
        tops = [max(item.altitude_m for item in one.items) for one in found]
        assert tops == [60 + 5 * k for k in range(count)]
        assert max(one.duration_s for one in found) < alone.duration_s
        assert min(one.duration_s for one in found) > 0.6 * max(one.duration_s for one in found)
        assert sum(len(waypoints(one)) for one in found) >= len(waypoints(alone))
        assert any(f"{count} vehicles fly at once, 1 flight each" in text for text in found[0].warnings)
    short = flights(regions, **survey, limits=LimitParams(10, 30, vehicles=2))
    assert len(short) % 2 == 0 and all(one.duration_s <= 420 for one in short)
    tops = [max(item.altitude_m for item in one.items) for one in short]
    assert tops == [60.0] * (len(short) // 2) + [65.0] * (len(short) // 2)
    with pytest.raises(ParameterError, match="permit"):
        flights(regions, **survey, altitude_m=118.0, limits=LimitParams(vehicles=2))
    with pytest.raises(ParameterError, match="--flights or --vehicles"):
        LimitParams(flights=2, vehicles=2)


@pytest.mark.slow
def test_flights_have_no_more_waypoints_than_their_program_flies() -> None:
    regions = [box(200 * k, 150, 150, 150) for k in range(4)]
    survey = {"pattern": "survey", "spacing_m": 10.0}
    (whole,) = flights(regions, **survey)
    found = flights(regions, **survey, limits=LimitParams(max_waypoints=40))
    assert len(waypoints(whole)) > 80 and len(found) == math.ceil(len(waypoints(whole)) / 40)
    assert all(len(waypoints(one)) <= 40 for one in found)
