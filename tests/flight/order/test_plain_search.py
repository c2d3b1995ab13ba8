"""The search for a tour skips what cannot shorten it, and finds the tour of a search that skips nothing."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.flight.order.test_tour import near_stops, random_stops
from uavseg.flight.order import tour as searched
from uavseg.flight.order.tour import GAIN, LONGEST_PART, Stops, local_search_tour


class PlainSearch:
    """Iterated local search that tries every move, with the moves in the order of `local_search_tour`."""

    def __init__(self, stops: Stops, distances: np.ndarray, start: int, end: int) -> None:
        self.stops, self.distances, self.start, self.end = stops, distances, start, end
        self.stop_of = stops.stop_of
        self.tour = list(searched._nearest_neighbour(stops, distances, start))

    def leg(self, here: int, there: int) -> float:
        return 0.0 if here < 0 or there < 0 else self.distances[here, there]

    def left(self, k: int) -> int:
        return self.start if k == 0 else self.stops.leaves[self.tour[k - 1]]

    def entered(self, k: int) -> int:
        return self.end if k == len(self.tour) else self.stops.enters[self.tour[k]]

    def between(self, here: int, enter: int, leave: int, there: int) -> float:
        return self.leg(here, enter) + self.leg(leave, there) - self.leg(here, there)

    def turned(self, part: list[int]) -> list[int]:
        return [self.stops.reverse[option] for option in part[::-1]]

    def two_opt(self, begin: int, stop_before: int) -> bool:
        gained = False
        for i in range(stop_before):
            for j in range(max(i, begin), stop_before if i < begin else len(self.tour)):
                before, after = self.left(i), self.entered(j + 1)
                now = self.leg(before, self.entered(i)) + self.leg(self.left(j + 1), after)
                turned = self.leg(before, self.left(j + 1)) + self.leg(self.entered(i), after)
                if now - turned > GAIN:
                    self.tour[i : j + 1] = self.turned(self.tour[i : j + 1])
                    gained = True
        return gained

    def or_opt(self, begin: int, stop_before: int) -> bool:
        gained, count = False, len(self.tour)
        for size in range(1, min(LONGEST_PART, count - 1) + 1):
            for i in range(begin, min(stop_before, count - size + 1)):
                first, last = self.entered(i), self.left(i + size)
                saved = self.between(self.left(i), first, last, self.entered(i + size))
                best, place, turned = GAIN, -1, False
                for k in [*range(i), *range(i + size + 1, count + 1)]:
                    for ends, is_turned in (((first, last), False), ((last, first), True)):
                        gain = saved - self.between(self.left(k), *ends, self.entered(k))
                        if gain > best:
                            best, place, turned = gain, k, is_turned
                if place >= 0:
                    part = self.tour[i : i + size]
                    self.move(i, size, place, self.turned(part) if turned else part)
                    gained = True
        return gained

    def reinsert(self, begin: int, stop_before: int) -> bool:
        gained, first = False, self.stops.first
        for i in range(begin, stop_before):
            option, after = self.tour[i], self.entered(i + 1)
            saved = self.between(self.left(i), self.entered(i), self.left(i + 1), after)
            saved += self.stops.costs[option]
            best, place, chosen = GAIN, -1, -1
            stop = self.stop_of[option]
            for k in [*range(i + 1), *range(i + 2, len(self.tour) + 1)]:
                there = after if k == i else self.entered(k)
                for other in range(first[stop], first[stop + 1]):
                    ends = self.stops.enters[other], self.stops.leaves[other]
                    gain = saved - self.between(self.left(k), *ends, there) - self.stops.costs[other]
                    if gain > best:
                        best, place, chosen = gain, k, other
            if place >= 0:
                self.move(i, 1, place, [chosen])
                gained = True
        return gained

    def move(self, i: int, size: int, place: int, part: list[int]) -> None:
        del self.tour[i : i + size]
        place -= size if place > i else 0
        self.tour[place:place] = part

    def best_options(self) -> float:
        stops, widest = self.stops, int(np.diff(self.stops.first).max())
        scratch = np.zeros((2, widest)), np.zeros((len(stops), widest), np.int64)
        options = stops.enters, stops.leaves, stops.reverse, self.stop_of
        problem = self.distances, *options, self.start, self.end
        tour = np.array(self.tour)
        length = searched.best_options(problem, stops.first, stops.costs, tour, *scratch)
        self.tour = list(tour)
        return float(length)

    def improve(self, begin: int, stop_before: int) -> float:
        total, improving = np.inf, True
        while improving:
            moved = [move(begin, stop_before) for move in (self.two_opt, self.or_opt, self.reinsert)]
            improving = any(moved)
            length = self.best_options()
            if length < total - GAIN:
                total, improving = length, True
        return total

    def search(self, rounds: int) -> list[int]:
        count = len(self.tour)
        best, best_tour, kept, current = np.inf, self.tour, self.tour, np.inf
        for turn in range(rounds + 1):
            begin, stop_before = 0, count
            if turn:
                tour = np.array(self.tour)
                with np.errstate(over="ignore"):
                    low, high = searched.double_bridge(tour, tour.copy(), turn)
                self.tour = list(tour)
                if turn % searched.EVERYWHERE:
                    begin, stop_before = max(low - searched.WINDOW, 0), min(high + searched.WINDOW, count)
            total = self.improve(begin, stop_before)
            heat = searched.HEAT * total / count * (rounds - turn) / max(rounds, 1)
            if turn == 0 or total < current + heat:
                current, kept = total, self.tour.copy()
            else:
                self.tour = kept.copy()
            if total < best - GAIN:
                best, best_tour = total, kept
        return best_tour


def on_a_grid(seed: int, count: int) -> tuple[Stops, np.ndarray, int]:
    """Stops on whole numbers, where many moves gain the same."""
    points = np.random.default_rng(seed).integers(0, 6, (count + 1, 2))
    distances = np.abs(points[:, None] - points[None]).sum(axis=2).astype(float)
    return Stops.of([np.array([[n, n]] * 2) for n in range(count)]), distances, count


@pytest.mark.slow
@given(
    st.sampled_from([random_stops, near_stops, on_a_grid]),
    st.integers(0, 10**6),
    st.integers(1, 50),
    st.booleans(),
    st.booleans(),
)
@settings(max_examples=12)
def test_it_is_the_tour_of_a_search_that_skips_nothing(
    make, seed: int, count: int, from_home: bool, to: bool
) -> None:
    extra = {random_stops: (2,), near_stops: (20,)}.get(make, ())
    stops, distances, home = make(seed, count, *extra)
    start, end = home if from_home else -1, home if to else -1
    plain = PlainSearch(stops, distances, start, end).search(4)
    assert local_search_tour(stops, distances, start, end, 4).tolist() == plain


@pytest.mark.slow
def test_so_it_is_after_all_stops_were_improved_once_more() -> None:
    stops, distances, home = near_stops(1, 40, 20)
    rounds = searched.EVERYWHERE + 1
    plain = PlainSearch(stops, distances, home, home).search(rounds)
    assert local_search_tour(stops, distances, home, home, rounds).tolist() == plain
