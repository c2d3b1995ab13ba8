"""In which order, and from which end, to fly things so that little is flown between them."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Cost = Callable[[Any, Any], Any]  # of flying between points, given by index; broadcasts

EFFORT = 3e7  # passes times stops squared, until a route is good enough
STARTS = 30, 1000  # a route without home is tried from so many stops, times stops
LEAST_GAIN = 1e-6  # metres
MANY_STOPS = 1500  # no vehicle holds more: their parts are turned round, but not moved
LONGEST_PART = 3  # stops that are moved together


def distances(points: Floats) -> Cost:
    """The cost that is the straight distance between points (N, 2)."""

    def cost(here: Any, there: Any) -> Any:
        return np.hypot(points[here, 0] - points[there, 0], points[here, 1] - points[there, 1])

    return cost


def order(options: Sequence[Ints], cost: Cost, home: int | None = None) -> list[tuple[int, int]]:
    """A short tour over stops, each of which can be flown in several ways.

    Nearest neighbour, then parts turned round (2-opt) or moved (Or-opt) and the best option of each stop
    for the order (exact, by dynamic programming), until nothing helps. Equal input gives equal output.

    Parameters
    ----------
    options : sequence of (K, 2) int arrays
        For each stop, the points where one may enter and then leaves it. With every pair its reverse must
        be there.
    cost : callable
        Cost of flying from one point to another; symmetric.
    home : int, optional
        The point where the tour starts and ends; without it, it starts and ends anywhere.

    Returns
    -------
    tour : list of (int, int)
        The stops in order, and the option of each.

    Examples
    --------
    >>> points = np.array([[0.0, 0.0], [9, 0], [1, 0], [5, 0]])
    >>> stops = [np.array([[n, n]]) for n in (1, 2, 3)]
    >>> [stop for stop, option in order(stops, distances(points))]
    [0, 2, 1]
    """
    if not options:
        return []
    if home is not None:
        return _improved(options, cost, home, _nearest(options, cost, home))[1]
    fly = _with_free_ends(cost)
    starts = range(min(len(options), STARTS[0], max(STARTS[1] // len(options), 1)))
    return min(_improved(options, fly, -1, _nearest(options, fly, -1, start)) for start in starts)[1]


def _improved(
    options: Sequence[Ints], fly: Cost, end: int, tour: tuple[Ints, Ints]
) -> tuple[float, list[tuple[int, int]]]:
    """The cost of the tour when nothing helps any more, and its stops with their options."""
    stops, pairs = tour
    for _ in range(1 + int(EFFORT / len(stops) ** 2)):
        total, chosen = _best_options([options[stop] for stop in stops], fly, end)
        pairs = np.array([options[stop][k] for stop, k in zip(stops, chosen, strict=True)])
        found = [(int(stop), k) for stop, k in zip(stops, chosen, strict=True)]
        gained = _turn_parts(stops, pairs, fly, end)
        if len(stops) <= MANY_STOPS:
            gained |= _move_parts(stops, pairs, fly, end)
        if not gained:
            break
    return total, found


def _with_free_ends(cost: Cost) -> Cost:
    """The cost, where flying from or to the point -1 costs nothing."""

    def fly(here: Any, there: Any) -> Any:
        here, there = np.asarray(here), np.asarray(there)
        return np.where((here < 0) | (there < 0), 0.0, cost(np.maximum(here, 0), np.maximum(there, 0)))

    return fly


def _nearest(options: Sequence[Ints], fly: Cost, end: int, start: int | None = None) -> tuple[Ints, Ints]:
    """Stops and their (entry, exit) pairs, going to the nearest entry of a stop not yet flown."""
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


def _turn_parts(stops: Ints, pairs: Ints, fly: Cost, end: int) -> bool:
    """Turn parts of the tour round, in place, wherever that shortens it: one pass of 2-opt."""
    gained = False
    for first in range(len(stops)):
        before = pairs[first - 1, 1] if first else end
        lasts, after = pairs[first:, 1], np.append(pairs[first + 1 :, 0], end)
        now = fly(before, pairs[first, 0]) + fly(lasts, after)
        turned = fly(before, lasts) + fly(pairs[first, 0], after)
        best = int(np.argmax(now - turned))
        if now[best] - turned[best] > LEAST_GAIN:
            part = slice(first, first + best + 1)
            stops[part] = stops[part][::-1]
            pairs[part] = pairs[part][::-1, ::-1]
            gained = True
    return gained


def _move_parts(stops: Ints, pairs: Ints, fly: Cost, end: int) -> bool:
    """Move one to three stops in a row elsewhere, in place, wherever that shortens the tour: Or-opt."""
    gained = False
    for length in range(1, min(LONGEST_PART, len(stops) - 1) + 1):
        for first in range(len(stops) - length + 1):
            gained |= _move_part(stops, pairs, first, first + length, fly, end)
    return gained


def _move_part(stops: Ints, pairs: Ints, first: int, stop: int, fly: Cost, end: int) -> bool:
    rest = np.delete(pairs, slice(first, stop), axis=0)
    befores, afters = np.append(end, rest[:, 1]), np.append(rest[:, 0], end)
    gaps = fly(befores, afters)
    entry, leave = pairs[first, 0], pairs[stop - 1, 1]
    inserted = np.stack((fly(befores, entry) + fly(leave, afters), fly(befores, leave) + fly(entry, afters)))
    longer = inserted - gaps
    turned, place = np.unravel_index(int(np.argmin(longer)), longer.shape)
    if longer[turned, place] > longer[0, first] - LEAST_GAIN:
        return False
    part, which = pairs[first:stop], stops[first:stop]
    if turned:
        part, which = part[::-1, ::-1], which[::-1]
    stops[:] = np.insert(np.delete(stops, slice(first, stop)), place, which)
    pairs[:] = np.insert(rest, place, part, axis=0)
    return True
