"""Good tours over many stops: 2-opt, Or-opt and the best options, repeated after small perturbations.

Iterated local search (H. R. Lourenco, O. C. Martin and T. Stuetzle, Iterated local search, 2003) with the
double bridge of Martin, Otto and Felten. The random numbers are always the same: so is the tour.
"""

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.flight.order.stops import Floats, Ints, Stops

ROUNDS = 4000
EFFORT = 400_000  # rounds times stops, at most
LONGEST_PART = 3  # stops that Or-opt moves together
LONGEST_BRIDGE = 30  # stops in each of the parts that a perturbation exchanges
WINDOW = 10  # stops on either side of those parts that are improved after it
EVERYWHERE = 100  # rounds after which all stops are
HEAT = 0.5  # mean legs by which a tour may be longer than the last one, at first
GAIN = 1e-7
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


@inlined
def _leg(distances, here, there):  # type: ignore[no-untyped-def]
    if here < 0 or there < 0:
        return 0.0
    return distances[here, there]


@inlined
def _left_before(leaves, tour, k, start):  # type: ignore[no-untyped-def]
    """The point that is left before position k."""
    if k == 0:
        return start
    return leaves[tour[k - 1]]


@inlined
def _entered_at(enters, tour, k, end):  # type: ignore[no-untyped-def]
    """The point that is entered at position k."""
    if k == tour.shape[0]:
        return end
    return enters[tour[k]]


@inlined
def _length(distances, enters, leaves, costs, start, end, tour):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(tour.shape[0]):
        total += _leg(distances, _left_before(leaves, tour, k, start), enters[tour[k]]) + costs[tour[k]]
    return total + _leg(distances, leaves[tour[tour.shape[0] - 1]], end)


@inlined
def _two_opt(distances, enters, leaves, reverse, start, end, tour, begin, stop_before):  # type: ignore[no-untyped-def]
    """Reverse parts of the tour that begin or end in a window, wherever that shortens it: one pass."""
    gained = False
    count = tour.shape[0]
    for i in range(stop_before):
        for j in range(max(i, begin), stop_before if i < begin else count):
            before, after = _left_before(leaves, tour, i, start), _entered_at(enters, tour, j + 1, end)
            now = _leg(distances, before, enters[tour[i]]) + _leg(distances, leaves[tour[j]], after)
            turned = _leg(distances, before, leaves[tour[j]]) + _leg(distances, enters[tour[i]], after)
            if now - turned > GAIN:
                low, high = i, j
                while low < high:
                    tour[low], tour[high] = reverse[tour[high]], reverse[tour[low]]
                    low += 1
                    high -= 1
                if low == high:
                    tour[low] = reverse[tour[low]]
                gained = True
    return gained


@inlined
def _or_opt(distances, enters, leaves, reverse, start, end, tour, part, begin, stop_before):  # type: ignore[no-untyped-def]
    """Move one to three stops of a window to another place wherever that shortens the tour: one pass."""
    gained = False
    count = tour.shape[0]
    for size in range(1, min(LONGEST_PART, count - 1) + 1):
        for i in range(begin, min(stop_before, count - size + 1)):
            before, after = _left_before(leaves, tour, i, start), _entered_at(enters, tour, i + size, end)
            first, last = enters[tour[i]], leaves[tour[i + size - 1]]
            saved = (
                _leg(distances, before, first) + _leg(distances, last, after) - _leg(distances, before, after)
            )
            best, place, turned = GAIN, -1, False
            for k in range(count + 1):
                if i <= k <= i + size:
                    continue
                here, there = _left_before(leaves, tour, k, start), _entered_at(enters, tour, k, end)
                gap = _leg(distances, here, there)
                forward = _leg(distances, here, first) + _leg(distances, last, there) - gap
                backward = _leg(distances, here, last) + _leg(distances, first, there) - gap
                if saved - forward > best:
                    best, place, turned = saved - forward, k, False
                if saved - backward > best:
                    best, place, turned = saved - backward, k, True
            if place < 0:
                continue
            for m in range(size):
                part[m] = reverse[tour[i + size - 1 - m]] if turned else tour[i + m]
            if place < i:
                for m in range(i - 1, place - 1, -1):
                    tour[m + size] = tour[m]
                for m in range(size):
                    tour[place + m] = part[m]
            else:
                for m in range(i + size, place):
                    tour[m - size] = tour[m]
                for m in range(size):
                    tour[place - size + m] = part[m]
            gained = True
    return gained


@inlined
def _reinsert(distances, first, enters, leaves, costs, stop_of, start, end, tour, begin, stop_before):  # type: ignore[no-untyped-def]
    """Move one stop of a window to another place, in the option that is best there: one pass."""
    gained = False
    count = tour.shape[0]
    for i in range(begin, stop_before):
        before, after = _left_before(leaves, tour, i, start), _entered_at(enters, tour, i + 1, end)
        stop = stop_of[tour[i]]
        saved = (
            _leg(distances, before, enters[tour[i]])
            + _leg(distances, leaves[tour[i]], after)
            - _leg(distances, before, after)
            + costs[tour[i]]
        )
        best, place, chosen = GAIN, -1, -1
        for k in range(count + 1):
            if k == i + 1:
                continue
            here, there = _left_before(leaves, tour, k, start), _entered_at(enters, tour, k, end)
            if k == i:
                there = after
            gap = _leg(distances, here, there)
            for option in range(first[stop], first[stop + 1]):
                more = _leg(distances, here, enters[option]) + _leg(distances, leaves[option], there) - gap
                if saved - more - costs[option] > best:
                    best, place, chosen = saved - more - costs[option], k, option
        if place < 0:
            continue
        if place <= i:
            for m in range(i - 1, place - 1, -1):
                tour[m + 1] = tour[m]
            tour[place] = chosen
        else:
            for m in range(i + 1, place):
                tour[m - 1] = tour[m]
            tour[place - 1] = chosen
        gained = True
    return gained


@inlined
def _best_options(distances, first, enters, leaves, costs, stop_of, start, end, tour, totals, before):  # type: ignore[no-untyped-def]
    """The best option of each stop for this order of stops (dynamic programming)."""
    count = tour.shape[0]
    stop = stop_of[tour[0]]
    for a in range(first[stop + 1] - first[stop]):
        option = first[stop] + a
        totals[0, a] = _leg(distances, start, enters[option]) + costs[option]
    for k in range(1, count):
        previous, stop = stop_of[tour[k - 1]], stop_of[tour[k]]
        for a in range(first[stop + 1] - first[stop]):
            option = first[stop] + a
            best, which = np.inf, 0
            for b in range(first[previous + 1] - first[previous]):
                total = totals[(k - 1) % 2, b] + distances[leaves[first[previous] + b], enters[option]]
                if total < best:
                    best, which = total, b
            totals[k % 2, a] = best + costs[option]
            before[k, a] = which
    stop = stop_of[tour[count - 1]]
    best, which = np.inf, 0
    for a in range(first[stop + 1] - first[stop]):
        total = totals[(count - 1) % 2, a] + _leg(distances, leaves[first[stop] + a], end)
        if total < best:
            best, which = total, a
    for k in range(count - 1, -1, -1):
        tour[k] = first[stop_of[tour[k]]] + which
        which = before[k, which]
    return best


@inlined
def _double_bridge(tour, copy, turn):  # type: ignore[no-untyped-def]
    """Exchange two neighbouring parts of the tour, of `LONGEST_BRIDGE` stops at most: A B C D to A C B D."""
    count = tour.shape[0]
    state = np.uint64(turn) * np.uint64(0x9E3779B97F4A7C15)  # of a splitmix generator (S. Vigna, 2015)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    state ^= state >> np.uint64(31)
    longest = np.uint64(min(LONGEST_BRIDGE, max(count // 2, 1)))
    low = np.int64(state % np.uint64(count))
    middle = min(low + 1 + np.int64((state >> np.uint64(20)) % longest), count)
    high = min(middle + 1 + np.int64((state >> np.uint64(40)) % longest), count)
    for k in range(low, high):
        copy[k] = tour[k]
    for m in range(middle, high):
        tour[low + m - middle] = copy[m]
    for m in range(low, middle):
        tour[high - middle + m] = copy[m]
    return low, high


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
                low, high = _double_bridge(tour, copy, turn)
                if turn % EVERYWHERE != 0:
                    begin, stop_before = max(low - WINDOW, 0), min(high + WINDOW, count)
            total = np.inf
            is_under_way = 1
        improving = _two_opt(distances, enters, leaves, reverse, start, end, tour, begin, stop_before)
        if _or_opt(distances, enters, leaves, reverse, start, end, tour, part, begin, stop_before):
            improving = True
        if _reinsert(distances, first, enters, leaves, costs, stop_of, start, end, tour, begin, stop_before):
            improving = True
        found = _best_options(
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
