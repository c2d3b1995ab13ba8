"""Route order: compared with all permutations, and invariances."""

from itertools import permutations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.flight import route

coordinates = st.tuples(st.floats(-100, 100), st.floats(-100, 100))


def length(points: np.ndarray, legs: list[tuple[int, int]]) -> float:
    return float(sum(np.hypot(*(points[a] - points[b])) for a, b in legs))


def flown(options: list[np.ndarray], tour: list[tuple[int, int]], home: int) -> list[tuple[int, int]]:
    pairs = [tuple(options[stop][k]) for stop, k in tour]
    return list(
        zip([home, *(leave for _, leave in pairs)], [*(entry for entry, _ in pairs), home], strict=True)
    )


@given(st.lists(coordinates, min_size=3, max_size=6, unique=True))
@settings(max_examples=40, deadline=None)
def test_few_stops_are_ordered_nearly_as_well_as_by_trying_all(places: list[tuple[float, float]]) -> None:
    points = np.array(places)
    stops = [np.array([[n, n]]) for n in range(1, len(points))]
    tour = route.order_stops(stops, route.straight_distance(points), home=0)
    assert sorted(stop for stop, _ in tour) == list(range(len(stops)))
    best = min(
        length(points, flown(stops, [(stop, 0) for stop in trial], 0))
        for trial in permutations(range(len(stops)))
    )
    assert length(points, flown(stops, tour, 0)) <= 1.15 * best + 1e-6


@given(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=12))
@settings(max_examples=40, deadline=None)
def test_every_stop_is_flown_once_and_turning_one_round_does_not_help(lines: list) -> None:
    points = np.array([(0.0, 0.0), *(end for line in lines for end in line)])
    options = [np.array([[2 * n + 1, 2 * n + 2], [2 * n + 2, 2 * n + 1]]) for n in range(len(lines))]
    tour = route.order_stops(options, route.straight_distance(points), home=0)
    assert sorted(stop for stop, _ in tour) == list(range(len(lines)))
    ours = length(points, flown(options, tour, 0))
    for n in range(len(tour)):
        other = [(stop, 1 - k if n == place else k) for place, (stop, k) in enumerate(tour)]
        assert ours <= length(points, flown(options, other, 0)) + 1e-6


def test_stops_on_a_circle_are_flown_around_it() -> None:
    turns = np.random.default_rng(1).permutation(24) * (2 * np.pi / 24)
    points = np.vstack(([0.0, 0.0], 100 * np.column_stack((np.cos(turns), np.sin(turns)))))
    tour = route.order_stops(
        [np.array([[n, n]]) for n in range(1, 25)], route.straight_distance(points), home=0
    )
    steps = np.diff(turns[[stop for stop, _ in tour]]) % (2 * np.pi)
    assert np.allclose(np.minimum(steps, 2 * np.pi - steps), 2 * np.pi / 24)


def test_without_home_a_row_is_flown_from_one_end() -> None:
    points = np.array([[x, 0.0] for x in (5, 1, 4, 0, 3, 2)])
    tour = route.order_stops([np.array([[n, n]]) for n in range(6)], route.straight_distance(points))
    row = points[[stop for stop, _ in tour], 0].tolist()
    assert row in ([0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0])


def test_equal_input_gives_an_equal_tour() -> None:
    points = np.random.default_rng(2).random((40, 2))
    stops = [np.array([[n, n]]) for n in range(1, 40)]
    cost = route.straight_distance(points)
    assert route.order_stops(stops, cost, 0) == route.order_stops(stops, cost, 0)


def test_nothing_to_order_is_no_tour() -> None:
    assert route.order_stops([], route.straight_distance(np.empty((0, 2)))) == []
