"""Eliminate small segments: merge each into the neighbour with which it shares the longest border."""

from dataclasses import replace

import numpy as np

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.edit.small import Area, region_areas
from uavseg.regions.outline.rings import LazyLabels, Rasteriser, RegionOutlines, merge_sums, select_sums
from uavseg.regions.outline.trace import link_strips, trace_strips
from uavseg.segmentation.components import LabelRows, Sums, border_lengths


def eliminate(
    outlined: RegionOutlines, classes: Integers, geobox: GeoBox, min_area: Area
) -> tuple[RegionOutlines, Integers]:
    """Merge segments below a minimum area into their neighbours.

    The smallest segment is merged first, of equal ones the first in raster order. It becomes part of the
    neighbour with which it shares most pixel edges; of several such neighbours, the one whose mean is
    nearest, then the one with the smallest label. A merged segment that now touches one of its class is
    merged with it. This repeats until all segments below the minimum have no neighbour. An area in square
    metres without a CRS is refused with a ParameterError.

    No two of the segments of one class, such as a level, share an edge. A merged segment takes the class of
    the neighbour it became part of. Labels are 1..m, the segment that encloses most pixels first; ties in
    raster order.
    """
    areas = region_areas(outlined, geobox, min_area)
    if not (areas < min_area.value).any():
        return outlined, classes
    labels = LazyLabels(Rasteriser(outlined.rings), geobox.shape)
    merged = _merged_into(outlined.sums, classes, areas, min_area.value, labels)
    roots, group = np.unique(merged, return_inverse=True)
    sums = merge_sums(outlined.sums, group, len(roots))
    pixels = np.zeros(len(roots), np.int64)
    np.add.at(pixels, group[outlined.rings.labels - 1], outlined.rings.pixel_areas())
    order = np.lexsort((sums.firsts[:, 1], sums.firsts[:, 0], -pixels))
    numbers = np.append(0, np.argsort(order)[group] + 1).astype(np.uint32)
    strips = trace_strips(replace(labels, numbers=numbers))
    del labels
    return RegionOutlines(link_strips(strips), select_sums(sums, order)), classes[roots][order]


def _merged_into(sums: Sums, classes: Integers, areas: Floats, limit: float, labels: LabelRows) -> Integers:
    """Return the segment that each one has become part of, counted from 0."""
    n = len(areas)
    pairs, shared = border_lengths(labels)
    near = (pairs - 1).astype(np.int32).reshape(-1)
    del pairs
    firsts = sums.firsts[:, 0] * np.int64(labels.shape[1]) + sums.firsts[:, 1]
    state = (areas.copy(), firsts, sums.counts.astype(np.int64), sums.greys.astype(np.int64), classes)
    borders = near, shared, np.zeros(1 << (len(near) + 8).bit_length(), np.int32)
    lists = np.full((2, n), -1, np.int32), np.full((2, len(near)), -1, np.int32)
    heap = np.empty(n, np.int32), np.full(n, -1, np.int32)
    parents = np.arange(n)
    _merge(*state, limit, *borders, *lists, parents, np.empty(n, np.int32), *heap)
    while (parents != parents[parents]).any():
        parents = parents[parents]
    return parents


@inlined
def comes_before(areas, firsts, one, other):  # type: ignore[no-untyped-def]
    """Check whether a segment is merged before another: the smaller, or the first in raster order."""
    return areas[one] < areas[other] or (areas[one] == areas[other] and firsts[one] < firsts[other])


@inlined
def settle(areas, firsts, heap, place, size, at):  # type: ignore[no-untyped-def]
    """Restore the order of a binary heap for one item (sift up or down)."""
    item = heap[at]
    while at > 0 and comes_before(areas, firsts, item, heap[(at - 1) // 2]):
        heap[at] = heap[(at - 1) // 2]
        place[heap[at]] = at
        at = (at - 1) // 2
    while 2 * at + 1 < size:
        below = 2 * at + 1
        if below + 1 < size and comes_before(areas, firsts, heap[below + 1], heap[below]):
            below += 1
        if not comes_before(areas, firsts, heap[below], item):
            break
        heap[at] = heap[below]
        place[heap[at]] = at
        at = below
    heap[at], place[item] = item, at


@inlined
def remove(areas, firsts, heap, place, size, item):  # type: ignore[no-untyped-def]
    """Remove an item from a heap; return its new size."""
    at = place[item]
    place[item] = -1
    last = heap[size - 1]
    if last != item:
        heap[at], place[last] = last, at
        settle(areas, firsts, heap, place, size - 1, at)
    return size - 1


@inlined
def update(areas, firsts, limit, heap, place, size, item):  # type: ignore[no-untyped-def]
    """Update the heap for an item that has grown; return its new size."""
    if place[item] >= 0 and areas[item] >= limit:
        return remove(areas, firsts, heap, place, size, item)
    if place[item] >= 0:
        settle(areas, firsts, heap, place, size, place[item])
    return size


@inlined
def is_less(one, of_one, other, of_other):  # type: ignore[no-untyped-def]
    """Compare fractions in 0..1, one / of_one < other / of_other, without products."""
    while True:
        if one == 0 or other == 0:
            return one == 0 and other > 0
        whole, whole_other = of_one // one, of_other // other
        if whole != whole_other:
            return whole > whole_other
        # 1 / x and 1 / y have equal whole parts: x < y where the rest of 1 / y is less than that of 1 / x
        one, of_one, other, of_other = of_other - whole * other, other, of_one - whole * one, one


@inlined
def mean_distance(greys, counts, one, other):  # type: ignore[no-untyped-def]
    """Return the distance of the means of two segments, times the pixels of the first: whole, and rest."""
    pixels, n = counts[one], counts[other]
    whole = greys[other] // n - greys[one] // pixels
    rest = (greys[other] % n) * pixels - (greys[one] % pixels) * n
    whole = whole * pixels + rest // n
    rest = rest % n
    if whole < 0 and rest > 0:
        return -whole - 1, n - rest
    return abs(whole), rest


@inlined
def is_nearer(greys, counts, one, other, best):  # type: ignore[no-untyped-def]
    """Check whether the mean of a segment is nearer to `other` than to `best`; ties by number."""
    whole, rest = mean_distance(greys, counts, one, other)
    best_whole, best_rest = mean_distance(greys, counts, one, best)
    if whole != best_whole:
        return whole < best_whole
    if is_less(rest, counts[other], best_rest, counts[best]):
        return True
    return not is_less(best_rest, counts[best], rest, counts[other]) and other < best


@inlined
def slot_of(table, near, one, other):  # type: ignore[no-untyped-def]
    """Return the slot of the border of two segments in a hash table with linear probing."""
    low, high = np.uint64(min(one, other)), np.uint64(max(one, other))
    spread = (low * np.uint64(0x9E3779B97F4A7C15) + high) * np.uint64(0xC2B2AE3D27D4EB4F)
    at = np.int64((spread >> np.uint64(32)) & np.uint64(table.shape[0] - 1))
    while table[at] > 0:
        border = 2 * (table[at] - 1)
        if (near[border] == one and near[border + 1] == other) or (
            near[border] == other and near[border + 1] == one
        ):
            break
        at = (at + 1) & (table.shape[0] - 1)
    return at


@inlined
def empty_slot(table, near, at):  # type: ignore[no-untyped-def]
    """Remove a border from the hash table; later ones move up, so that probing still finds them."""
    table[at] = 0
    at = (at + 1) & (table.shape[0] - 1)
    while table[at] > 0:
        border = table[at]
        table[at] = 0
        table[slot_of(table, near, near[2 * (border - 1)], near[2 * (border - 1) + 1])] = border
        at = (at + 1) & (table.shape[0] - 1)


@inlined
def append(ends, links, owner, side):  # type: ignore[no-untyped-def]
    """Append a side of a border to the list of a segment."""
    last = ends[1, owner]
    links[0, side] = last
    links[1, side] = -1
    if last < 0:
        ends[0, owner] = side
    else:
        links[1, last] = side
    ends[1, owner] = side


@inlined
def unlink(ends, links, owner, side):  # type: ignore[no-untyped-def]
    """Remove a side of a border from the list of a segment."""
    before, after = links[0, side], links[1, side]
    if before < 0:
        ends[0, owner] = after
    else:
        links[1, before] = after
    if after < 0:
        ends[1, owner] = before
    else:
        links[0, after] = before


@inlined
def absorb(segments, borders, one, into):  # type: ignore[no-untyped-def]
    """Merge one segment into another: its sums, and its borders."""
    areas, firsts, counts, greys, parents = segments
    near, shared, table, ends, links = borders
    parents[one] = into
    areas[into] += areas[one]
    firsts[into] = min(firsts[into], firsts[one])
    counts[into] += counts[one]
    greys[into] += greys[one]
    side = ends[0, one]
    while side >= 0:
        following = links[1, side]
        other = near[side ^ 1]
        empty_slot(table, near, slot_of(table, near, one, other))
        unlink(ends, links, other, side ^ 1)
        if other != into:
            at = slot_of(table, near, into, other)
            if table[at] > 0:
                shared[table[at] - 1] += shared[side >> 1]
            else:
                table[at] = (side >> 1) + 1
                near[side] = into
                append(ends, links, into, side)
                append(ends, links, other, side ^ 1)
        side = following
    ends[0, one] = ends[1, one] = -1


@kernel(
    "void(f8[::1], i8[::1], i8[::1], i8[::1], i8[::1], f8, i4[::1], i8[::1], i4[::1], i4[:,::1], i4[:,::1], "
    "i8[::1], i4[::1], i4[::1], i4[::1])"
)
def _merge(  # type: ignore[no-untyped-def]
    areas, firsts, counts, greys, levels, limit, near, shared, table, ends, links, parents, adjacent,
    heap, place,
):  # fmt: skip
    # Border k has the sides 2 k and 2 k + 1: near[side] is the segment on that side, near[side ^ 1] the one
    # beyond. Each segment has a linked list of its sides (first and last in `ends`, the ones before and after
    # in `links`), and a hash table finds the border of two segments.
    segments = (areas, firsts, counts, greys, parents)
    borders = (near, shared, table, ends, links)
    for k in range(shared.shape[0]):
        append(ends, links, near[2 * k], 2 * k)
        append(ends, links, near[2 * k + 1], 2 * k + 1)
        table[slot_of(table, near, near[2 * k], near[2 * k + 1])] = k + 1
    size = 0
    for one in range(areas.shape[0]):
        if areas[one] < limit:
            heap[size] = one
            size += 1
            settle(areas, firsts, heap, place, size, size - 1)
    while size > 0:
        one = heap[0]
        count = 0
        size = remove(areas, firsts, heap, place, size, one)
        into, longest = -1, 0
        side = ends[0, one]
        while side >= 0:
            other = near[side ^ 1]
            adjacent[count] = other
            count += 1
            length = shared[side >> 1]
            if length > longest or (length == longest and is_nearer(greys, counts, one, other, into)):
                into, longest = other, length
            side = links[1, side]
        if count == 0:
            continue
        absorb(segments, borders, one, into)
        size = update(areas, firsts, limit, heap, place, size, into)
        level = levels[into]
        first = into
        for k in range(count):  # only these can be new beside it
            other = adjacent[k]
            if other != first and levels[other] == level:
                gone = max(into, other)
                into = min(into, other)
                if place[gone] >= 0:
                    size = remove(areas, firsts, heap, place, size, gone)
                absorb(segments, borders, gone, into)
                size = update(areas, firsts, limit, heap, place, size, into)
