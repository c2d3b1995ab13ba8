"""Tours: as short as any permutation for few stops, near the exact one for more, and always the same."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.flight.order.tour import Stops, exact_tour, local_search_tour, short_tour


def random_stops(seed: int, count: int, classes: int) -> tuple[Stops, np.ndarray, int]:
    """Stops with pairs of points and their reverses; the last point is home."""
    rng = np.random.default_rng(seed)
    points = rng.random((2 * classes * count + 1, 2)) * 100
    options, costs = [], []
    for stop in range(count):
        pairs = np.arange(2 * classes * stop, 2 * classes * (stop + 1)).reshape(-1, 2)
        options.append(np.concatenate([pairs, pairs[:, ::-1]]))
        spent = rng.random(classes) * 20
        costs.append(np.concatenate([spent, spent]))
    distances = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    return Stops.of(options, costs), distances, len(points) - 1


def cost(stops: Stops, distances: np.ndarray, options: np.ndarray, start: int, end: int) -> float:
    total = float(stops.costs[options].sum())
    total += sum(distances[stops.leaves[a], stops.enters[b]] for a, b in itertools.pairwise(options.tolist()))
    total += distances[start, stops.enters[options[0]]] if start >= 0 else 0
    return total + (distances[stops.leaves[options[-1]], end] if end >= 0 else 0)


def brute_force(stops: Stops, distances: np.ndarray, start: int, end: int) -> float:
    ranges = [range(a, b) for a, b in itertools.pairwise(stops.first.tolist())]
    return min(
        cost(stops, distances, np.array([chosen[k] for k in order]), start, end)
        for order in itertools.permutations(range(len(stops)))
        for chosen in itertools.product(*ranges)
    )


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 2), st.booleans(), st.booleans())
@settings(max_examples=40)
def test_few_stops_get_the_shortest_tour(
    seed: int, count: int, classes: int, from_home: bool, to: bool
) -> None:
    stops, distances, home = random_stops(seed, count, classes)
    start, end = (home if from_home else -1), (home if to else -1)
    expected = brute_force(stops, distances, start, end)
    exact = exact_tour(stops, distances, start, end)
    assert cost(stops, distances, exact, start, end) == pytest.approx(expected)


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(5, 9))
@settings(max_examples=25)
def test_the_search_comes_near_the_exact_tour_of_few_stops(seed: int, count: int) -> None:
    stops, distances, home = near_stops(seed, count, 20)
    exact, searched = (
        cost(stops, distances, find(stops, distances, home, home), home, home)
        for find in (exact_tour, local_search_tour)
    )
    assert exact - 1e-9 <= searched <= 1.02 * exact


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(1, 60), st.booleans())
@settings(max_examples=25)
def test_a_tour_visits_every_stop_once_and_is_always_the_same(seed: int, count: int, from_home: bool) -> None:
    stops, distances, home = random_stops(seed, count, 1)
    start = home if from_home else -1
    tour = short_tour(stops, distances, start, start, rounds=300)
    assert sorted(stop for stop, _ in tour) == list(range(count))
    assert all(0 <= option < stops.first[stop + 1] - stops.first[stop] for stop, option in tour)
    assert tour == short_tour(stops, distances, start, start, rounds=300)


def near_stops(seed: int, count: int, size: float) -> tuple[Stops, np.ndarray, int]:
    """Stops whose points lie around places, as those of regions do."""
    rng = np.random.default_rng(seed)
    places = rng.random((count, 1, 2)) * 1000
    points = np.concatenate([(places + rng.normal(0, size, (count, 4, 2))).reshape(-1, 2), [[500, 500]]])
    pairs = np.arange(4 * count).reshape(count, 2, 2)
    distances = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    return Stops.of([np.concatenate([one, one[:, ::-1]]) for one in pairs]), distances, 4 * count


@pytest.mark.slow
@pytest.mark.parametrize("size", [5, pytest.param(30, marks=pytest.mark.thorough)])
def test_fifty_stops_are_within_two_per_cent_of_a_long_search(size: float) -> None:
    for seed in range(3):
        stops, distances, home = near_stops(seed, 50, size)
        quick, long = (local_search_tour(stops, distances, home, home, rounds) for rounds in (4000, 20_000))
        found = cost(stops, distances, quick, home, home)
        assert found <= 1.02 * cost(stops, distances, long, home, home)


def test_no_stops_are_no_tour() -> None:
    none = np.zeros(0, np.int64)
    assert short_tour(Stops(np.zeros(1, np.int64), none, none, np.zeros(0), none), np.zeros((1, 1))) == []
