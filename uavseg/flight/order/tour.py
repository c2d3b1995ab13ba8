"""Travelling salesman tours over stops with options: exact for few stops, iterated local search for many.

Few stops: dynamic programming over sets of stops (M. Held and R. M. Karp, 1962). Many stops: 2-opt, Or-opt
and the best options, repeated after small perturbations (H. R. Lourenco, O. C. Martin and T. Stuetzle,
Iterated local search, 2003) with the double bridge of Martin, Otto and Felten. The random numbers are always
the same: so is the tour.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.flight.order.moves import GAIN, best_options, double_bridge, or_opt, reinsert, two_opt

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_STOPS, MAX_STEPS = 12, 3e7  # of an exact tour, which then takes a fraction of a second
ROUNDS = 4000
EFFORT = 400_000  # rounds times stops, at most
WINDOW = 10  # stops on either side of those parts that are improved after a perturbation
EVERYWHERE = 100  # rounds after which all stops are improved
HEAT = 0.5  # mean legs by which a tour may be longer than the last one, at first
AT_ONCE = 1e7  # pairs of stops for one call of the kernel, about 0.1 s: Ctrl-C takes effect between calls


@dataclass(frozen=True, slots=True, eq=False)
class Stops:
    """Stops 0..n - 1; each is flown in one of several options, which enter and leave at different points."""

    first: Ints  # (n + 1,), where the options of each stop begin; their number at the end
    enters: Ints  # (m,), the point at which each option is entered
    leaves: Ints  # (m,), the point at which it is left
    costs: Floats  # (m,), cost of flying an option
    reverse: Ints  # (m,), the reversed option of the same stop; itself where both points are one

    @classmethod
    def of(cls, options: Sequence[Ints], costs: Sequence[Floats] | None = None) -> "Stops":
        """Make stops of pairs of points to enter and leave, (k, 2) each; the reverse of a pair is an option.

        The costs of options, (k,) for each stop, are 0 by default.
        """
        first = np.concatenate([[0], np.cumsum([len(pairs) for pairs in options])]).astype(np.int64)
        pairs = np.concatenate(options).astype(np.int64)
        spent = np.zeros(len(pairs)) if costs is None else np.concatenate(costs).astype(np.float64)
        reverse = np.empty(len(pairs), np.int64)
        for begin, end in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
            where = {
                (enters, leaves, cost): begin + k
                for k, (enters, leaves, cost) in reversed(
                    list(enumerate(zip(*pairs[begin:end].T.tolist(), spent[begin:end].tolist(), strict=True)))
                )
            }
            for k in range(begin, end):
                reverse[k] = where[pairs[k, 1], pairs[k, 0], spent[k]]
        return cls(first, pairs[:, 0].copy(), pairs[:, 1].copy(), spent, reverse)

    def __len__(self) -> int:
        return len(self.first) - 1

    @property
    def stop_of(self) -> Ints:
        """Stop of each option."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))


def short_tour(
    stops: Stops, distances: Floats, start: int = -1, end: int = -1, rounds: int = ROUNDS
) -> list[tuple[int, int]]:
    """Return a short tour over stops, each flown in one of its options.

    Parameters
    ----------
    stops : Stops
    distances : (p, p) float64 array
        Cost between points: finite, symmetric.
    start, end : int
        The points at which the tour starts and ends; -1 where it may be anywhere.
    rounds : int
        How long to search where there are many stops.

    Returns
    -------
    tour : list of (int, int)
        The stops in order, and the option of each, counted from 0 for each stop.

    Examples
    --------
    >>> x = np.array([0.0, 9, 1, 5])
    >>> stops = Stops.of([np.array([[n, n]]) for n in (1, 2, 3)])
    >>> [stop for stop, option in short_tour(stops, abs(x[:, None] - x), start=0)]
    [1, 2, 0]
    """
    if not len(stops):
        return []
    matrix = np.ascontiguousarray(distances, np.float64)
    count, options = len(stops), len(stops.enters)
    if count <= MAX_STOPS and 2**count * float(options) ** 2 <= MAX_STEPS:
        tour = exact_tour(stops, matrix, start, end)
    else:
        tour = local_search_tour(stops, matrix, start, end, rounds)
    chosen = stops.stop_of[tour]
    return list(zip(chosen.tolist(), (tour - stops.first[chosen]).tolist(), strict=True))


def exact_tour(stops: Stops, distances: Floats, start: int, end: int) -> Ints:
    """Return the options of the shortest tour, in order (Held and Karp); parameters as of `short_tour`."""
    sets, options = 1 << len(stops), len(stops.enters)
    best, before = np.full((sets, options), np.inf), np.zeros((sets, options), np.int64)
    _fill(distances, stops.stop_of, stops.enters, stops.leaves, stops.costs, start, best, before)
    last = best[-1] + (distances[stops.leaves, end] if end >= 0 else 0.0)
    tour = [int(np.argmin(last))]
    left = sets - 1
    for _ in range(len(stops) - 1):
        option = tour[-1]
        tour.append(int(before[left, option]))
        left ^= 1 << int(stops.stop_of[option])
    return np.array(tour[::-1], np.int64)


@kernel("void(f8[:,::1], i8[::1], i8[::1], i8[::1], f8[::1], i8, f8[:,::1], i8[:,::1])")
def _fill(distances, stop_of, enters, leaves, costs, start, best, before):  # type: ignore[no-untyped-def]
    options = enters.shape[0]
    for option in range(options):
        reach = 0.0
        if start >= 0:
            reach = distances[start, enters[option]]
        best[1 << stop_of[option], option] = reach + costs[option]
    for visited in range(1, best.shape[0]):  # bit masks of stops
        for option in range(options):
            so_far = best[visited, option]
            if so_far == np.inf:
                continue
            for after in range(options):
                bit = 1 << stop_of[after]
                if visited & bit:
                    continue
                total = so_far + distances[leaves[option], enters[after]] + costs[after]
                if total < best[visited | bit, after]:
                    best[visited | bit, after] = total
                    before[visited | bit, after] = option


def local_search_tour(stops: Stops, distances: Floats, start: int, end: int, rounds: int = ROUNDS) -> Ints:
    """Return the options of a short tour, in order (iterated local search); parameters as of `short_tour`."""
    tour = _nearest_neighbour(stops, distances, start)
    count, widest = len(stops), int(np.diff(stops.first).max())
    rounds = min(rounds, EFFORT // count)
    scratch = np.zeros((4, count), np.int64)
    totals, before = np.zeros((2, widest)), np.zeros((count, widest), np.int64)
    options = (stops.first, stops.enters, stops.leaves, stops.costs, stops.reverse, stops.stop_of)
    passes = max(int(AT_ONCE / (8.0 * count * count)), 1)
    state, lengths = np.zeros(4, np.int64), np.full(3, np.inf)
    while state[0] <= rounds:
        _search(
            distances, *options, start, end, rounds, passes, state, lengths, tour, scratch, totals, before
        )
    best: Ints = scratch[0]
    return best


def _nearest_neighbour(stops: Stops, distances: Floats, start: int) -> Ints:
    left = np.ones(len(stops.enters), bool)
    tour, here = [], start
    for _ in range(len(stops)):
        reach = stops.costs + (distances[here, stops.enters] if here >= 0 else 0.0)
        option = int(np.argmin(np.where(left, reach, np.inf)))
        tour.append(option)
        stop = int(stops.stop_of[option])
        left[stops.first[stop] : stops.first[stop + 1]] = False
        here = int(stops.leaves[option])
    return np.array(tour, np.int64)


@kernel(
    "void(f8[:,::1], i8[::1], i8[::1], i8[::1], f8[::1], i8[::1], i8[::1], i8, i8, i8, i8, i8[::1], f8[::1],"
    " i8[::1], i8[:,::1], f8[:,::1], i8[:,::1])"
)
def _search(  # type: ignore[no-untyped-def]
    distances,
    first,
    enters,
    leaves,
    costs,
    reverse,
    stop_of,
    start,
    end,
    rounds,
    passes,
    state,
    lengths,
    tour,
    scratch,
    totals,
    before,
):
    """Continue the search for some passes; `state` is the turn, whether it is under way, and its window."""
    count = tour.shape[0]
    best_tour, kept, copy, part = scratch[0], scratch[1], scratch[2], scratch[3]
    turn, is_under_way, begin, stop_before = state
    best, current, total = lengths
    while turn <= rounds and passes > 0:
        if not is_under_way:
            begin, stop_before = 0, count
            if turn > 0:
                low, high = double_bridge(tour, copy, turn)
                if turn % EVERYWHERE != 0:
                    begin, stop_before = max(low - WINDOW, 0), min(high + WINDOW, count)
            total = np.inf
            is_under_way = 1
        improving = two_opt(distances, enters, leaves, reverse, start, end, tour, begin, stop_before)
        if or_opt(distances, enters, leaves, reverse, start, end, tour, part, begin, stop_before):
            improving = True
        if reinsert(distances, first, enters, leaves, costs, stop_of, start, end, tour, begin, stop_before):
            improving = True
        length = best_options(
            distances, first, enters, leaves, costs, stop_of, start, end, tour, totals, before
        )
        if length < total - GAIN:
            total = length
            improving = True
        passes -= 1
        if improving:
            continue
        heat = HEAT * total / count * (rounds - turn) / max(rounds, 1)
        if turn == 0 or total < current + heat:
            current = total
            for k in range(count):
                kept[k] = tour[k]
        else:
            for k in range(count):
                tour[k] = kept[k]
        if total < best - GAIN:
            best = total
            for k in range(count):
                best_tour[k] = kept[k]
        turn += 1
        is_under_way = 0
    state[0], state[1], state[2], state[3] = turn, is_under_way, begin, stop_before
    lengths[0], lengths[1], lengths[2] = best, current, total
