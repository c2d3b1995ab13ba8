"""Route order (generalised travelling salesman): a short tour over stops, each with several options."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Cost = Callable[[Any, Any], Any]  # of flying between points, given by index; broadcasts

MAX_EFFORT = 3e7  # passes times stops squared, after which a route is good enough
MAX_START_TRIALS = (
    30,
    1000,
)  # starts of a route without home: at most, and at most divided by the number of stops
MIN_GAIN = 1e-6  # metres
MANY_STOPS = 1500  # more than any vehicle stores: 2-opt only
MAX_PART = 3  # stops that Or-opt moves together


def straight_distance(points: Floats) -> Cost:
    """Cost function: the straight distance between points (N, 2), given by index."""

    def cost(here: Any, there: Any) -> Any:
        return np.hypot(points[here, 0] - points[there, 0], points[here, 1] - points[there, 1])

    return cost


def order_stops(options: Sequence[Ints], cost: Cost, home: int | None = None) -> list[tuple[int, int]]:
    """A short tour over stops, each of which has several options.

    Nearest neighbour, then 2-opt (reverse parts), Or-opt (move parts) and the best option of each stop for
    the order (exact, by dynamic programming), until nothing improves. Equal input gives equal output.

    Parameters
    ----------
    options : sequence of (K, 2) int arrays
        For each stop, the pairs of points at which a path enters and leaves it. The reverse of every pair
        must be an option too.
    cost : callable
        Cost of flying from one point to another; symmetric.
    home : int, optional
        The point where the tour starts and ends; by default it starts and ends anywhere.

    Returns
    -------
    tour : list of (int, int)
        The stops in order, and the option of each.

    Examples
    --------
    >>> points = np.array([[0.0, 0.0], [9, 0], [1, 0], [5, 0]])
    >>> stops = [np.array([[n, n]]) for n in (1, 2, 3)]
    >>> [stop for stop, option in order_stops(stops, straight_distance(points))]
    [0, 2, 1]
    """
    if not options:
        return []
    if home is not None:
        return _improve(options, cost, home, _nearest_neighbour(options, cost, home))[1]
    fly = _with_free_ends(cost)
    starts = range(min(len(options), MAX_START_TRIALS[0], max(MAX_START_TRIALS[1] // len(options), 1)))
    return min(_improve(options, fly, -1, _nearest_neighbour(options, fly, -1, start)) for start in starts)[1]


def _improve(
    options: Sequence[Ints], fly: Cost, end: int, tour: tuple[Ints, Ints]
) -> tuple[float, list[tuple[int, int]]]:
    """The cost of the improved tour, and its stops with their options."""
    stops, pairs = tour
    for _ in range(1 + int(MAX_EFFORT / len(stops) ** 2)):
        total, chosen = _best_options([options[stop] for stop in stops], fly, end)
        pairs = np.array([options[stop][k] for stop, k in zip(stops, chosen, strict=True)])
        found = [(int(stop), k) for stop, k in zip(stops, chosen, strict=True)]
        gained = _two_opt(stops, pairs, fly, end)
        if len(stops) <= MANY_STOPS:
            gained |= _or_opt(stops, pairs, fly, end)
        if not gained:
            break
    return total, found


def _with_free_ends(cost: Cost) -> Cost:
    """A cost function in which legs from or to the point -1 cost nothing."""

    def fly(here: Any, there: Any) -> Any:
        here, there = np.asarray(here), np.asarray(there)
        return np.where((here < 0) | (there < 0), 0.0, cost(np.maximum(here, 0), np.maximum(there, 0)))

    return fly


def _nearest_neighbour(
    options: Sequence[Ints], fly: Cost, end: int, start: int | None = None
) -> tuple[Ints, Ints]:
    """Nearest-neighbour tour: the stops and their (entry, exit) pairs."""
    stop_of = np.repeat(np.arange(len(options)), [len(option) for option in options])
    pairs = np.concatenate(options)
    stops, chosen = np.empty(len(options), np.int64), np.empty((len(options), 2), np.int64)
    here = end
    for n in range(len(options)):
        k = int(np.argmin(fly(here, pairs[:, 0]))) if n or start is None else int(np.argmax(stop_of == start))
        stops[n], chosen[n], here = stop_of[k], pairs[k], pairs[k, 1]
        left = stop_of != stop_of[k]
        stop_of, pairs = stop_of[left], pairs[left]
    return stops, chosen


def _best_options(options: Sequence[Ints], fly: Cost, end: int) -> tuple[float, list[int]]:
    """The cost of the shortest tour over stops in this order, and the option of each."""
    total = np.asarray(fly(end, options[0][:, 0]))
    came_from = []
    for before, after in pairwise(options):
        through = total[:, None] + fly(before[:, None, 1], after[None, :, 0])
        came_from.append(np.argmin(through, axis=0))
        total = through.min(axis=0)
    total = total + fly(options[-1][:, 1], end)
    chosen = [int(np.argmin(total))]
    for best in reversed(came_from):
        chosen.append(int(best[chosen[-1]]))
    return float(total.min()), chosen[::-1]


def _two_opt(stops: Ints, pairs: Ints, fly: Cost, end: int) -> bool:
    """One pass of 2-opt: reverse parts of the tour, in place, wherever that shortens it."""
    gained = False
    for first in range(len(stops)):
        before = pairs[first - 1, 1] if first else end
        lasts, after = pairs[first:, 1], np.append(pairs[first + 1 :, 0], end)
        now = fly(before, pairs[first, 0]) + fly(lasts, after)
        turned = fly(before, lasts) + fly(pairs[first, 0], after)
        best = int(np.argmax(now - turned))
        if now[best] - turned[best] > MIN_GAIN:
            part = slice(first, first + best + 1)
            stops[part] = stops[part][::-1]
            pairs[part] = pairs[part][::-1, ::-1]
            gained = True
    return gained


def _or_opt(stops: Ints, pairs: Ints, fly: Cost, end: int) -> bool:
    """One pass of Or-opt: move one to three consecutive stops, in place, wherever that shortens the tour."""
    gained = False
    for length in range(1, min(MAX_PART, len(stops) - 1) + 1):
        for first in range(len(stops) - length + 1):
            gained |= _or_opt_part(stops, pairs, first, first + length, fly, end)
    return gained


def _or_opt_part(stops: Ints, pairs: Ints, first: int, stop: int, fly: Cost, end: int) -> bool:
    """Move the stops [first, stop), possibly reversed, to the best place; True if that shortens the tour."""
    rest = np.delete(pairs, slice(first, stop), axis=0)
    befores, afters = np.append(end, rest[:, 1]), np.append(rest[:, 0], end)
    gaps = fly(befores, afters)
    entry, leave = pairs[first, 0], pairs[stop - 1, 1]
    inserted = np.stack((fly(befores, entry) + fly(leave, afters), fly(befores, leave) + fly(entry, afters)))
    longer = inserted - gaps
    turned, place = np.unravel_index(int(np.argmin(longer)), longer.shape)
    if longer[turned, place] > longer[0, first] - MIN_GAIN:
        return False
    part, which = pairs[first:stop], stops[first:stop]
    if turned:
        part, which = part[::-1, ::-1], which[::-1]
    stops[:] = np.insert(np.delete(stops, slice(first, stop)), place, which)
    pairs[:] = np.insert(rest, place, part, axis=0)
    return True
