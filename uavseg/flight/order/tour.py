"""Short tours over stops: exact for few, iterated local search for many."""

import numpy as np

from uavseg.flight.order.held_karp import exact_tour, is_small
from uavseg.flight.order.local_search import ROUNDS, good_tour
from uavseg.flight.order.stops import Floats, Stops


def short_tour(
    stops: Stops, distances: Floats, start: int = -1, end: int = -1, rounds: int = ROUNDS
) -> list[tuple[int, int]]:
    """A short tour over stops, each flown in one of its options.

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
    if is_small(stops):
        options = exact_tour(stops, matrix, start, end)
    else:
        options = good_tour(stops, matrix, start, end, rounds)
    chosen = stops.stop_of[options]
    return list(zip(chosen.tolist(), (options - stops.first[chosen]).tolist(), strict=True))
