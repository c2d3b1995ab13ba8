"""Moves that shorten a tour over stops: 2-opt, Or-opt, reinsertion, the best options; and a perturbation.

A tour is an array of options; `enters` and `leaves` are the points at which each is entered and left, -1 for
`start` and `end` where the tour may begin and end anywhere.
"""

import numpy as np

from uavseg._jit import inlined

LONGEST_PART = 3  # stops that Or-opt moves together
LONGEST_BRIDGE = 30  # stops in each of the parts that a perturbation exchanges
GAIN = 1e-7


@inlined
def leg(distances, here, there):  # type: ignore[no-untyped-def]
    if here < 0 or there < 0:
        return 0.0
    return distances[here, there]


@inlined
def left_before(leaves, tour, k, start):  # type: ignore[no-untyped-def]
    """Return the point that is left before position k."""
    if k == 0:
        return start
    return leaves[tour[k - 1]]


@inlined
def entered_at(enters, tour, k, end):  # type: ignore[no-untyped-def]
    """Return the point that is entered at position k."""
    if k == tour.shape[0]:
        return end
    return enters[tour[k]]


@inlined
def two_opt(distances, enters, leaves, reverse, start, end, tour, begin, stop_before):  # type: ignore[no-untyped-def]
    """Reverse parts of the tour that begin or end in a window, wherever that shortens it: one pass."""
    gained = False
    count = tour.shape[0]
    for i in range(stop_before):
        for j in range(max(i, begin), stop_before if i < begin else count):
            before, after = left_before(leaves, tour, i, start), entered_at(enters, tour, j + 1, end)
            now = leg(distances, before, enters[tour[i]]) + leg(distances, leaves[tour[j]], after)
            turned = leg(distances, before, leaves[tour[j]]) + leg(distances, enters[tour[i]], after)
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
def or_opt(distances, enters, leaves, reverse, start, end, tour, part, begin, stop_before):  # type: ignore[no-untyped-def]
    """Move one to three stops of a window to another place wherever that shortens the tour: one pass."""
    gained = False
    count = tour.shape[0]
    for size in range(1, min(LONGEST_PART, count - 1) + 1):
        for i in range(begin, min(stop_before, count - size + 1)):
            before, after = left_before(leaves, tour, i, start), entered_at(enters, tour, i + size, end)
            first, last = enters[tour[i]], leaves[tour[i + size - 1]]
            saved = (
                leg(distances, before, first) + leg(distances, last, after) - leg(distances, before, after)
            )
            best, place, turned = GAIN, -1, False
            for k in range(count + 1):
                if i <= k <= i + size:
                    continue
                here, there = left_before(leaves, tour, k, start), entered_at(enters, tour, k, end)
                gap = leg(distances, here, there)
                forward = leg(distances, here, first) + leg(distances, last, there) - gap
                backward = leg(distances, here, last) + leg(distances, first, there) - gap
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
def reinsert(distances, first, enters, leaves, costs, stop_of, start, end, tour, begin, stop_before):  # type: ignore[no-untyped-def]
    """Move one stop of a window to another place, in the option that is best there: one pass."""
    gained = False
    count = tour.shape[0]
    for i in range(begin, stop_before):
        before, after = left_before(leaves, tour, i, start), entered_at(enters, tour, i + 1, end)
        stop = stop_of[tour[i]]
        saved = (
            leg(distances, before, enters[tour[i]])
            + leg(distances, leaves[tour[i]], after)
            - leg(distances, before, after)
            + costs[tour[i]]
        )
        best, place, chosen = GAIN, -1, -1
        for k in range(count + 1):
            if k == i + 1:
                continue
            here, there = left_before(leaves, tour, k, start), entered_at(enters, tour, k, end)
            if k == i:
                there = after
            gap = leg(distances, here, there)
            for option in range(first[stop], first[stop + 1]):
                more = leg(distances, here, enters[option]) + leg(distances, leaves[option], there) - gap
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
def best_options(distances, first, enters, leaves, costs, stop_of, start, end, tour, totals, before):  # type: ignore[no-untyped-def]
    """Choose the best option of each stop for this order of stops (dynamic programming)."""
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
