"""Travelling salesman tours over stops with options: exact for few stops, iterated local search for many.

Few stops: dynamic programming over sets of stops (M. Held and R. M. Karp, 1962). Many stops: 2-opt, Or-opt
and the best options, repeated after small perturbations (H. R. Lourenco, O. C. Martin and T. Stuetzle,
Iterated local search, 2003) with the double bridge of Martin, Otto and Felten. The random numbers are always
the same: so is the tour. Moves that cannot shorten the tour are skipped by lower bounds of distances, which
changes no tour.

A tour is an array of options; `enters` and `leaves` are the points at which each is entered and left, -1 for
`start` and `end` where the tour may begin and end anywhere.
"""

from collections.abc import Sequence

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass

LONGEST_PART = 3  # stops that Or-opt moves together
LONGEST_BRIDGE = 30  # stops in each of the parts that a perturbation exchanges
GAIN = 1e-7
GROUP = 8  # stops whose distance from a point is bounded together
MAX_STOPS, MAX_STEPS = 12, 3e7  # of an exact tour, which then takes a fraction of a second
ROUNDS = 4000
EFFORT = 400_000  # rounds times stops, at most
WINDOW = 10  # stops on either side of those parts that are improved after a perturbation
EVERYWHERE = 100  # rounds after which all stops are improved
HEAT = 0.5  # mean legs by which a tour may be longer than the last one, at first
AT_ONCE = 1e7  # pairs of stops for one call of the kernel, about 0.1 s: Ctrl-C takes effect between calls


@inlined
def leg(distances, here, there):  # type: ignore[no-untyped-def]
    return 0.0 if here < 0 or there < 0 else distances[here, there]


@inlined
def measure(problem, path, low, high):  # type: ignore[no-untyped-def]
    """Store the leg before each position from low to high; the longest of each group only grow."""
    distances, enters, leaves, _, stop_of, start, end = problem
    tour, left, entered, legs, position, group_of, longest = path
    for k in range(low, high + 1):
        left[k], entered[k], group = start, end, group_of[tour.shape[0]]
        if k > 0:
            left[k], group = leaves[tour[k - 1]], group_of[stop_of[tour[k - 1]]]
        if k < tour.shape[0]:
            entered[k] = enters[tour[k]]
            position[stop_of[tour[k]]] = k
        legs[k] = leg(distances, left[k], entered[k])
        longest[group] = max(longest[group], legs[k])


@inlined
def window_groups(stop_of, path, begin, stop_before, groups):  # type: ignore[no-untyped-def]
    """List the groups of a window and of the stop after it; return their number, and the longest leg."""
    tour, _, _, legs, _, group_of, _ = path
    number, longest = 0, 0.0
    for k in range(begin, stop_before + 1):
        group = group_of[stop_of[tour[k]] if k < tour.shape[0] else k]
        if number == 0 or group != groups[number - 1]:
            groups[number] = group
            number += 1
        longest = max(longest, legs[k])
    return number, longest


@inlined
def is_near(apart, path, i, groups, longest):  # type: ignore[no-untyped-def]
    """Return whether a leg between the one before position i and a group may be shorter than an old one."""
    _, left, entered, legs, _, _, _ = path
    for group in groups:
        if left[i] < 0 or apart[left[i], group] < legs[i] or apart[entered[i], group] < longest:
            return True
    return False


@inlined
def two_opt(problem, path, apart, nearby, begin, stop_before):  # type: ignore[no-untyped-def]
    """Reverse parts of the tour that begin or end in a window, wherever that shortens it: one pass."""
    distances, _, _, reverse, stop_of, _, _ = problem
    tour, left, entered, legs, _, _, _ = path
    gained = False
    number, longest = 0, 0.0
    for i in range(stop_before):
        if i < begin:
            if number == 0:
                number, longest = window_groups(stop_of, path, begin, stop_before, nearby)
            if not is_near(apart, path, i, nearby[:number], longest):
                continue
        for j in range(max(i, begin), stop_before if i < begin else tour.shape[0]):
            now = legs[i] + legs[j + 1]
            turned = leg(distances, left[i], left[j + 1]) + leg(distances, entered[i], entered[j + 1])
            if now - turned > GAIN:
                low, high = i, j
                while low < high:
                    tour[low], tour[high] = reverse[tour[high]], reverse[tour[low]]
                    low += 1
                    high -= 1
                if low == high:
                    tour[low] = reverse[tour[low]]
                measure(problem, path, i, j + 1)
                gained, number = True, 0
    return gained


@inlined
def move(problem, path, part, i, size, place):  # type: ignore[no-untyped-def]
    """Put a part in place of the stops from position i on, before what is now at another position."""
    tour = path[0]
    for m in range(i - 1, place - 1, -1):
        tour[m + size] = tour[m]
    for m in range(i + size, place):
        tour[m - size] = tour[m]
    for m in range(size):
        tour[(place if place <= i else place - size) + m] = part[m]
    measure(problem, path, min(i, place), max(i + size, place))


@inlined
def or_opt(problem, path, members, apart, part, begin, stop_before):  # type: ignore[no-untyped-def]
    """Move one to three stops of a window to another place wherever that shortens the tour: one pass."""
    distances, _, _, reverse, _, _, _ = problem
    tour, left, entered, legs, position, _, longest = path
    gained = False
    count = tour.shape[0]
    for size in range(1, min(LONGEST_PART, count - 1) + 1):
        for i in range(begin, min(stop_before, count - size + 1)):
            first, last = entered[i], left[i + size]
            saved = legs[i] + legs[i + size] - leg(distances, left[i], entered[i + size])
            best, place, turned = GAIN, -1, False
            for group in range(apart.shape[1]):
                if saved - (min(apart[first, group], apart[last, group]) - longest[group]) < best:
                    continue
                for m in range(group * GROUP, min(group * GROUP + GROUP, count + 1)):
                    k = position[members[m]] + 1
                    if i <= k <= i + size:
                        continue
                    here, there = left[k], entered[k]
                    forward = leg(distances, first, here) + leg(distances, last, there) - legs[k]
                    backward = leg(distances, last, here) + leg(distances, first, there) - legs[k]
                    if saved - forward > best or (saved - forward == best and k < place):
                        best, place, turned = saved - forward, k, False
                    if saved - backward > best or (saved - backward == best and k < place):
                        best, place, turned = saved - backward, k, True
            if place < 0:
                continue
            for m in range(size):
                part[m] = reverse[tour[i + size - 1 - m]] if turned else tour[i + m]
            move(problem, path, part, i, size, place)
            gained = True
    return gained


@inlined
def reinsert(problem, path, members, apart, part, first, costs, begin, stop_before):  # type: ignore[no-untyped-def]
    """Move one stop of a window to another place, in the option that is best there: one pass."""
    distances, enters, leaves, _, stop_of, _, _ = problem
    tour, left, entered, legs, position, _, longest = path
    gained = False
    count = tour.shape[0]
    for i in range(begin, stop_before):
        stop = stop_of[tour[i]]
        skipped = leg(distances, left[i], entered[i + 1])
        saved = legs[i] + legs[i + 1] - skipped + costs[tour[i]]
        best, place, chosen = GAIN, -1, -1
        for group in range(apart.shape[1]):
            for option in range(first[stop], first[stop + 1]):
                enter, leave, cost = enters[option], leaves[option], costs[option]
                if saved - (apart[enter, group] - max(longest[group], skipped)) - cost < best:
                    continue
                for m in range(group * GROUP, min(group * GROUP + GROUP, count + 1)):
                    k = position[members[m]] + 1
                    if k == i + 1:
                        continue
                    there, gap = entered[k], legs[k]
                    if k == i:
                        there, gap = entered[i + 1], skipped
                    more = leg(distances, enter, left[k]) + leg(distances, leave, there) - gap
                    gain = saved - more - cost
                    if gain > best or (gain == best and (k < place or (k == place and option < chosen))):
                        best, place, chosen = gain, k, option
        if place < 0:
            continue
        part[0] = chosen
        move(problem, path, part, i, 1, place)
        gained = True
    return gained


@inlined
def best_options(problem, first, costs, tour, totals, before):  # type: ignore[no-untyped-def]
    """Choose the best option of each stop for this order of stops (dynamic programming)."""
    distances, enters, leaves, _, stop_of, start, end = problem
    count = tour.shape[0]
    stop = stop_of[tour[0]]
    for a in range(first[stop + 1] - first[stop]):
        option = first[stop] + a
        totals[0, a] = leg(distances, start, enters[option]) + costs[option]
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
        total = totals[(count - 1) % 2, a] + leg(distances, leaves[first[stop] + a], end)
        if total < best:
            best, which = total, a
    for k in range(count - 1, -1, -1):
        tour[k] = first[stop_of[tour[k]]] + which
        which = before[k, which]
    return best


@inlined
def double_bridge(tour, copy, turn):  # type: ignore[no-untyped-def]
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


@dataclass(frozen=True, slots=True, eq=False)
class Stops:
    """Stops 0..n - 1; each is flown in one of several options, which enter and leave at different points."""

    first: Integers  # (n + 1,), where the options of each stop begin; their number at the end
    enters: Integers  # (m,), the point at which each option is entered
    leaves: Integers  # (m,), the point at which it is left
    costs: Floats  # (m,), cost of flying an option
    reverse: Integers  # (m,), the reversed option of the same stop; itself where both points are one

    @classmethod
    def of(cls, options: Sequence[Integers], costs: Sequence[Floats] | None = None) -> "Stops":
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

    def distinct(self) -> tuple["Stops", Integers]:
        """Return the stops without options that equal an earlier one, and the options that are left."""
        left = np.flatnonzero(self.reverse[self.reverse] == np.arange(len(self.reverse)))
        first, reverse = np.searchsorted(left, self.first), np.searchsorted(left, self.reverse[left])
        return Stops(first, self.enters[left], self.leaves[left], self.costs[left], reverse), left

    @property
    def stop_of(self) -> Integers:
        """Stop of each option."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))


def short_tour(
    stops: Stops,
    distances: Floats,
    start: int = -1,
    end: int = -1,
    rounds: int = ROUNDS,
    first: Integers | None = None,
) -> list[tuple[int, int]]:
    """Return a short tour over stops, each flown in one of its options.

    `distances` (p, p) are costs between points: finite, symmetric, not negative. The tour starts and ends at
    the points `start` and `end`; -1 where it may be anywhere. `rounds` is how long to search where there are
    many stops, `first`, (n,), the options of the tour with which that search begins. The results are the
    stops in order, and the option of each, counted from 0 for each stop.

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
        tour = local_search_tour(stops, matrix, start, end, rounds, first)
    chosen = stops.stop_of[tour]
    return list(zip(chosen.tolist(), (tour - stops.first[chosen]).tolist(), strict=True))


def exact_tour(stops: Stops, distances: Floats, start: int, end: int) -> Integers:
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
        reach = distances[start, enters[option]] if start >= 0 else 0.0
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
                    best[visited | bit, after], before[visited | bit, after] = total, option


def local_search_tour(
    stops: Stops, distances: Floats, start: int, end: int, rounds: int = ROUNDS, first: Integers | None = None
) -> Integers:
    """Return the options of a short tour, in order (iterated local search); parameters as of `short_tour`."""
    stops, options_left = stops.distinct()
    if first is None:
        tour = _nearest_neighbour(stops, distances, start)
    else:
        tour = np.searchsorted(options_left, first)
    count, widest = len(stops), int(np.diff(stops.first).max())
    options = np.stack([stops.enters, stops.leaves, stops.reverse, stops.stop_of])
    members, apart = _groups(stops, distances, tour, (start, end))
    scratch, sums = np.zeros((9, count + 1), np.int64), np.zeros((2, count + 1))
    scratch[0, :count], scratch[6, members], scratch[8] = tour, np.arange(count + 1) // GROUP, members
    scratch[7, count] = -1
    totals, before = np.zeros((2, widest)), np.zeros((count, widest), np.int64)
    passes, rounds = max(int(AT_ONCE / (8.0 * count * count)), 1), min(rounds, EFFORT // count)
    state, lengths = np.array([0, 0, 0, 0, start, end, rounds], np.int64), np.full(3, np.inf)
    arrays = (stops.first, options, stops.costs, state, lengths, scratch, sums, apart, totals, before)
    while state[0] <= rounds:
        _search(distances, *arrays, passes)
    return options_left[scratch[1, :count]]


def _groups(
    stops: Stops, distances: Floats, tour: Integers, home: tuple[int, int]
) -> tuple[Integers, Floats]:
    """Return the stops in groups of neighbours, home as the last, and each point's distance from them."""
    # The distances (p, groups) are from the nearest point of a group; 0 where the tour may end anywhere.
    members = np.append(stops.stop_of[tour], len(stops))
    apart = np.zeros((len(stops) // GROUP + 1, len(distances)))
    for group, near in enumerate(apart):
        inside = np.isin(stops.stop_of, members[group * GROUP : (group + 1) * GROUP])
        points = np.append(stops.enters[inside], home if group == len(apart) - 1 else ())
        if points.min() >= 0:
            distances[points.astype(np.int64)].min(axis=0, out=near)
    return members, np.ascontiguousarray(apart.T)


def _nearest_neighbour(stops: Stops, distances: Floats, start: int) -> Integers:
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
    "void(f8[:,::1], i8[::1], i8[:,::1], f8[::1], i8[::1], f8[::1], i8[:,::1], f8[:,::1], f8[:,::1],"
    " f8[:,::1], i8[:,::1], i8)"
)
def _search(  # type: ignore[no-untyped-def]
    distances, first, options, costs, state, lengths, scratch, sums, apart, totals, before, passes
):
    """Continue the search for some passes; `state` is the turn, whether it is under way, its window, ends."""
    count = first.shape[0] - 1
    enters, leaves, reverse, stop_of = options[0], options[1], options[2], options[3]
    tour, best_tour, kept, copy = scratch[0, :count], scratch[1], scratch[2], scratch[3]
    left, entered, group_of, position, members = scratch[4], scratch[5], scratch[6], scratch[7], scratch[8]
    legs, longest = sums[0], sums[1]
    turn, is_under_way, begin, stop_before, start, end, rounds = state
    problem = (distances, enters, leaves, reverse, stop_of, start, end)
    path = (tour, left, entered, legs, position, group_of, longest)
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
        longest[:] = 0.0
        measure(problem, path, 0, count)
        improving = two_opt(problem, path, apart, copy, begin, stop_before)
        if or_opt(problem, path, members, apart, copy, begin, stop_before):
            improving = True
        longest[:] = 0.0
        measure(problem, path, 0, count)
        if reinsert(problem, path, members, apart, copy, first, costs, begin, stop_before):
            improving = True
        length = best_options(problem, first, costs, tour, totals, before)
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
