"""Exact tours over few stops: dynamic programming over sets of stops (M. Held and R. M. Karp, 1962)."""

import numpy as np

from uavseg._jit import kernel
from uavseg.flight.order.stops import Floats, Ints, Stops

MAX_STOPS = 12
MAX_STEPS = 3e7


def is_small(stops: Stops) -> bool:
    """Whether the exact tour takes a fraction of a second."""
    count, options = len(stops), len(stops.enters)
    return count <= MAX_STOPS and 2**count * float(options) ** 2 <= MAX_STEPS


def exact_tour(stops: Stops, distances: Floats, start: int, end: int) -> Ints:
    """The options of the shortest tour, in order.

    Parameters
    ----------
    stops : Stops
    distances : (p, p) float64 array
        Cost between points.
    start, end : int
        The points at which the tour starts and ends; -1 where it may be anywhere.
    """
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
    for visited in range(1, best.shape[0]):
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
