"""Division of a route into flights, and orders of its regions that need fewer of them (vehicle routing).

For a given order, the places where a route is cut are the best ones: a shortest path over the flights that
fit (the split of C. Prins, A simple and effective evolutionary algorithm for the vehicle routing problem,
Computers and Operations Research 31, 2004). Better orders are found by simulated annealing: regions are
moved, exchanged and turned round, and each order is cut into so many flights with the least time, and the
least time above the limit. The random numbers are always the same, and so are the flights.
"""

import math

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass

MANY = 1e9  # seconds that a flight counts for, where the fewest are looked for
HALVINGS = 40
LIKE = 1.02  # times the least longest flight that others may take
OVER = 20.0  # times the time above a limit counts
STEPS = 1e8  # of the search, at most: less than a second
MAX_ROUNDS, MIN_ROUNDS = 20_000, 50
MAX_REGIONS = 100  # whose order is changed


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Time and items of pieces of a route in the order of flight."""

    seconds: Floats  # (n,)
    items: Floats  # (n,)
    transit_s: Floats  # (n,): to the next piece; 0 for the last one
    transit_items: Floats  # (n,): likewise
    ways_s: Floats  # (4, n): out to the start of each piece, back from its start, out to its end and back
    ways_items: Floats  # (4, n): likewise

    def cut(self, longest_s: float, most_items: float, flight_s: float = 0.0) -> list[tuple[int, int]]:
        """Return the first and last piece of each flight for the least sum of times, and `flight_s` for each.

        No flight takes longer than `longest_s`, with the ways, or has more items. There are none where a
        piece does not fit into a flight alone.
        """
        count = len(self.seconds)
        best, start = np.full(count + 1, np.inf), np.zeros(count + 1, np.int64)
        spent, carried = _before(self.seconds, self.transit_s), _before(self.items, self.transit_items)
        limits = np.array([longest_s, most_items, flight_s])
        arrays = (self.seconds, self.items, spent, carried, self.ways_s, self.ways_items)
        _cut(*(np.ascontiguousarray(one, np.float64) for one in arrays), limits, best, start)
        if not np.isfinite(best[-1]):
            return []
        flights = []
        stop = count
        while stop:
            flights.append((int(start[stop]), stop - 1))
            stop = int(start[stop])
        return flights[::-1]

    def times(self, cuts: list[tuple[int, int]]) -> Floats:
        """Return the time of each flight, with the ways."""
        spent = _before(self.seconds, self.transit_s)
        first, last = np.array(cuts).T
        ways_s = self.ways_s[0, first] + self.ways_s[3, last]
        seconds: Floats = spent[last] + self.seconds[last] - spent[first] + ways_s
        return seconds

    def fewest(self, longest_s: float, most_items: float) -> int:
        """Return the least number of flights; 0 where a piece does not fit into one."""
        return len(self.cut(longest_s, most_items, MANY))

    def least_flights(self, longest_s: float, most_items: float) -> int:
        """Return a lower bound of the number of flights in any order: pieces, and the shortest ways."""
        ways_s = float(self.ways_s[::2].min() + self.ways_s[1::2].min())
        by_time = float(self.seconds.sum()) / max(longest_s - ways_s, 1e-9)
        return math.ceil(max(by_time, float(self.items.sum()) / most_items) - 1e-9)

    def alike(self, count: int, longest_s: float, most_items: float) -> list[tuple[int, int]]:
        """Return so many flights, of which the longest is nearly as short as it can be.

        There are fewer where there are fewer pieces. `longest_s`, perhaps infinite, is within reach.
        """
        whole_s = float(self.seconds.sum() + self.transit_s.sum() + self.ways_s.max() * 2)
        low, high = 0.0, min(longest_s, whole_s)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if 0 < self.fewest(middle, most_items) <= count else (middle, high)
        cuts = self.cut(min(high * LIKE, longest_s), most_items, MANY)
        if len(cuts) < count:
            cuts = self.cut(high, most_items, MANY)
        while len(cuts) < min(count, len(self.seconds)):  # more flights that make none of them shorter
            widest = max(range(len(cuts)), key=lambda k: cuts[k][1] - cuts[k][0])
            first, last = cuts[widest]
            middle = (first + last) // 2
            cuts[widest : widest + 1] = [(first, middle), (middle + 1, last)]
        return cuts


def _before(pieces: Floats, transits: Floats) -> Floats:
    """Return the sums before each piece."""
    return np.concatenate([[0.0], np.cumsum(pieces + transits)[:-1]])


@kernel("void(f8[::1], f8[::1], f8[::1], f8[::1], f8[:,::1], f8[:,::1], f8[::1], f8[::1], i8[::1])")
def _cut(seconds, items, spent, carried, ways_s, ways_items, limits, best, start):  # type: ignore[no-untyped-def]
    best[0] = 0.0
    for last in range(seconds.shape[0]):
        end_s = spent[last] + seconds[last] + ways_s[3, last]
        end_items = carried[last] + items[last] + ways_items[3, last]
        for first in range(last, -1, -1):
            if spent[last] + seconds[last] - spent[first] > limits[0]:
                break
            if carried[last] + items[last] - carried[first] > limits[1]:
                break
            flight_s = end_s - spent[first] + ways_s[0, first]
            if flight_s > limits[0] or end_items - carried[first] + ways_items[0, first] > limits[1]:
                continue
            total = best[first] + flight_s + limits[2]
            if total < best[last + 1]:
                best[last + 1], start[last + 1] = total, first


def order_of_regions(
    pieces: Pieces, region: Integers, between_s: Floats, flights: int, longest_s: float, most_items: float
) -> tuple[Integers, Integers] | None:
    """Look for an order of regions that so many flights can fly; return it, and which are turned round.

    `region` (n,) is that of each piece, 0, 1, ... in the order of flight; `between_s` (2 r, 2 r) are times
    between the starts (even) and ends (odd) of regions. None where no such order is found.
    """
    first = np.searchsorted(region, np.arange(int(region[-1]) + 2)).astype(np.int64)
    count, n = len(first) - 1, len(region)
    rounds = min(int(STEPS / max(flights * n * n / 4, 1)), MAX_ROUNDS)
    if not 1 < count <= MAX_REGIONS or rounds < MIN_ROUNDS:
        return None
    orders = np.zeros((4, count), np.int64)
    orders[0] = np.arange(count)
    state = np.array([longest_s, most_items, rounds, 0.0])
    line, best = np.zeros((7, n)), np.zeros((4, n + 1))
    arrays = (pieces.seconds, pieces.items, pieces.transit_s, pieces.transit_items, pieces.ways_s)
    given = (np.ascontiguousarray(one, np.float64) for one in (*arrays, pieces.ways_items, between_s))
    _search(*given, first, orders, state, line, best, flights)
    return (orders[0], orders[1]) if state[3] <= 0 else None


@inlined
def _random(turn):  # type: ignore[no-untyped-def]
    """Return a number of a splitmix generator (S. Vigna, 2015)."""
    state = np.uint64(turn) * np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state ^ (state >> np.uint64(31))


@inlined
def _lay_out(tables, first, order, turned, line):  # type: ignore[no-untyped-def]
    """Store time, items, ways and sums of the pieces in an order; `line` has a row for each."""
    seconds, items, transit_s, transit_items, ways_s, ways_items, between_s = tables
    spent, carried, at = 0.0, 0.0, 0
    for k in range(order.shape[0]):
        region = order[k]
        low, high = first[region], first[region + 1]
        if k > 0:
            before = order[k - 1]
            spent += between_s[2 * before + 1 - turned[before], 2 * region + turned[region]]
        for m in range(high - low):
            piece = high - 1 - m if turned[region] else low + m
            line[0, at], line[1, at] = spent, carried
            spent, carried = spent + seconds[piece], carried + items[piece]
            line[2, at], line[3, at] = spent, carried
            line[4, at] = ways_s[2 * turned[region], piece]
            line[5, at] = ways_s[3 - 2 * turned[region], piece]
            line[6, at] = ways_items[2 * turned[region], piece] + ways_items[3 - 2 * turned[region], piece]
            transit = piece - 1 if turned[region] else piece
            if m < high - low - 1:
                spent, carried = spent + transit_s[transit], carried + transit_items[transit]
            at += 1


@inlined
def _cost(line, best, count, flights, longest_s, most_items):  # type: ignore[no-untyped-def]
    """Return the least time of so many flights, and how far it exceeds the limits."""
    for j in range(1, count + 1):
        best[0, j], best[2, j] = np.inf, 0.0
    best[0, 0], best[2, 0] = 0.0, 0.0
    for turn in range(flights):
        now, then = turn % 2, 1 - turn % 2
        best[then, 0], best[2 + then, 0] = np.inf, 0.0
        for j in range(1, count + 1):
            best[then, j], best[2 + then, j] = best[now, j], best[2 + now, j]
            for i in range(j - 1, -1, -1):
                flight_s = line[2, j - 1] - line[0, i] + line[4, i] + line[5, j - 1]
                if line[2, j - 1] - line[0, i] > 2 * longest_s:
                    break
                over = max(flight_s - longest_s, 0.0)
                over += max(line[3, j - 1] - line[1, i] + line[6, i] - most_items, 0.0)
                total = best[now, i] + flight_s + OVER * over
                if total < best[then, j]:
                    best[then, j] = total
                    best[2 + then, j] = best[2 + now, i] + over
    last = flights % 2
    return best[last, count], best[2 + last, count]


@inlined
def _change(order, turned, turn):  # type: ignore[no-untyped-def]
    """Move a region to another place, turn it round, or reverse a part of the order."""
    count = np.uint64(order.shape[0])
    state = _random(turn)
    here, there = np.int64(state % count), np.int64((state >> np.uint64(16)) % count)
    kind = (state >> np.uint64(32)) % np.uint64(4)
    low, high = min(here, there), max(here, there)
    if kind == 0:  # reverse
        for k in range(low, high + 1):
            turned[order[k]] = 1 - turned[order[k]]
        while low < high:
            order[low], order[high] = order[high], order[low]
            low += 1
            high -= 1
    elif kind == 1:
        order[here], order[there] = order[there], order[here]
    else:
        region, step = order[here], -1 if there < here else 1
        for k in range(here, there, step):
            order[k] = order[k + step]
        order[there] = region
        if kind == 3:
            turned[region] = 1 - turned[region]


@kernel(
    "void(f8[::1], f8[::1], f8[::1], f8[::1], f8[:,::1], f8[:,::1], f8[:,::1], i8[::1], i8[:,::1], f8[::1],"
    " f8[:,::1], f8[:,::1], i8)"
)
def _search(  # type: ignore[no-untyped-def]
    seconds, items, transit_s, transit_items, ways_s, ways_items, between_s, first, orders, state, line,
    best, flights,
):  # fmt: skip
    """Anneal an order until so many flights fit."""
    # `orders` has the order and which regions are turned round, and the same of a trial; `state` the limits,
    # the rounds, and by what the result exceeds the limits.
    tables = (seconds, items, transit_s, transit_items, ways_s, ways_items, between_s)
    order, turned, trial, trial_turned = orders[0], orders[1], orders[2], orders[3]
    rounds = np.int64(state[2])
    _lay_out(tables, first, order, turned, line)
    now, over = _cost(line, best, seconds.shape[0], flights, state[0], state[1])
    heat = 0.02 * now
    for turn in range(1, rounds + 1):
        if over <= 0:
            break
        for k in range(order.shape[0]):
            trial[k], trial_turned[k] = order[k], turned[k]
        _change(trial, trial_turned, turn)
        _lay_out(tables, first, trial, trial_turned, line)
        cost, exceeds = _cost(line, best, seconds.shape[0], flights, state[0], state[1])
        chance = np.float64(_random(turn + 1_000_003) >> np.uint64(11)) / 9007199254740992.0
        if cost < now or chance < math.exp((now - cost) / (heat * (1 - turn / (rounds + 1)))):
            now, over = cost, exceeds
            for k in range(order.shape[0]):
                order[k], turned[k] = trial[k], trial_turned[k]
    state[3] = over
