"""Good tours over many stops: 2-opt, Or-opt and the best options, repeated after small perturbations.

Iterated local search (H. R. Lourenco, O. C. Martin and T. Stuetzle, Iterated local search, 2003) with the
double bridge of Martin, Otto and Felten. The random numbers are always the same: so is the tour.
"""

import numpy as np

from uavseg._jit import kernel
from uavseg.flight.order.moves import GAIN, best_options, double_bridge, or_opt, reinsert, two_opt
from uavseg.flight.order.stops import Floats, Ints, Stops

ROUNDS = 4000
EFFORT = 400_000  # rounds times stops, at most
WINDOW = 10  # stops on either side of those parts that are improved after it
EVERYWHERE = 100  # rounds after which all stops are
HEAT = 0.5  # mean legs by which a tour may be longer than the last one, at first
AT_ONCE = 1e7  # pairs of stops for one call of the kernel, about 0.1 s: Ctrl-C takes effect between calls


def good_tour(stops: Stops, distances: Floats, start: int, end: int, rounds: int = ROUNDS) -> Ints:
    """The options of a short tour, in order.

    Parameters
    ----------
    stops : Stops
    distances : (p, p) float64 array
        Cost between points, symmetric.
    start, end : int
        The points at which the tour starts and ends; -1 where it may be anywhere.
    rounds : int
        Perturbations that are tried, at most.
    """
    tour = _nearest_neighbour(stops, distances, start)
    count, most = len(stops), int(np.diff(stops.first).max())
    rounds = min(rounds, EFFORT // count)
    scratch = np.zeros((4, count), np.int64)
    totals, before = np.zeros((2, most)), np.zeros((count, most), np.int64)
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
    """The nearest option of a stop that is left, again and again."""
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
    """Go on with the search for some passes; `state` is the turn, whether it is under way, and its window."""
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
        found = best_options(
            distances, first, enters, leaves, costs, stop_of, start, end, tour, totals, before
        )
        if found < total - GAIN:
            total = found
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
