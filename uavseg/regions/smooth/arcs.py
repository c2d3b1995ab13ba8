"""Topology of boundaries: nodes, where more than two arcs meet, and arcs between them; sleeve fitting.

An arc that two rings share has one orientation for both.

Sleeve fitting replaces an arc by few straight segments through portals. The portal of a unit edge lies on the
line between the centres of the two pixels that the edge separates, a little shorter at both ends. A line
through the portals of an arc, one after the other (as in the funnel algorithm), separates the same pixels and
stays within half a pixel of their edges; the portals of different arcs have no point in common. Coordinates
are integers, 256 to a pixel, relative to the first corner of the arc.

Zhao, Z.; Saalfeld, A. (1997): Linear-time sleeve-fitting polyline simplification algorithms. AutoCarto 13,
214-223.
"""

from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Integers
from uavseg.dataclass import dataclass
from uavseg.regions.outline.rings import Rings

_PASSED = 16  # bit of a corner through which another boundary goes straight
STEPS_PER_PIXEL = 256
MAX_OFFSET = 112  # steps from the middle of a portal to its ends: `MAX_SHIFT` of smooth_outlines
SLEEVE_WIDTH = 8  # steps along a portal by which a segment may miss the arc's point
_MAX_EDGES = 4096  # edges that one segment may replace
_PIECE = 16  # segments of an arc that are compared with others at once
_IS_NODE = np.array([bits & _PASSED > 0 or bits.bit_count() > 2 for bits in range(2 * _PASSED)])


@dataclass(frozen=True, slots=True)
class Nodes:
    """Keys of pixel corners, sorted by row (``row * (cols + 1) + col``) and by column, both ascending."""

    by_row: Integers
    by_col: Integers


@dataclass(frozen=True, slots=True)
class Arcs:
    """Arcs of rings, each once, and where rings use them; those of a ring follow each other."""

    corners: Integers  # (v, 2): row and column in steps, in the orientation of the arc, with both ends
    starts: Integers  # (a,): offset of each arc in `corners`
    counts: Integers  # (a,): its corners
    sides: Integers  # (a, 2): the regions that it separates, 0 for none
    used: Integers  # (u,): the arc of each use
    rings: Integers  # (u,): its ring
    turned: Bools  # (u,): whether the ring runs against the arc


def find_nodes(rings: Rings, shape: tuple[int, int]) -> Nodes:
    """Find the corners where three or four region boundaries meet: borders end there, or rings touch.

    The border between two regions counts as one boundary, though a ring of each runs along it. The shape is
    that of the raster.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> find_nodes(trace(np.array([[1, 2], [3, 3]], np.uint32)), (2, 2)).by_row
    array([1, 3, 4, 5])
    """
    rows, cols = rings.vertices[:, 0].astype(np.int64), rings.vertices[:, 1].astype(np.int64)
    by_row = _nodes_along(rings, rows * (shape[1] + 1) + cols, 1, shape[1] + 1)
    by_col = _nodes_along(rings, cols * (shape[0] + 1) + rows, 0, shape[0] + 1)
    col, row = np.divmod(by_col, shape[0] + 1)
    nodes = sorted_unique(np.concatenate([by_row, row * (shape[1] + 1) + col]))
    row, col = np.divmod(nodes, shape[1] + 1)
    return Nodes(nodes, np.sort(col * (shape[0] + 1) + row))


def _nodes_along(rings: Rings, keys: Integers, axis: int, stride: int) -> Integers:
    """Return the nodes among the corners `keys` that follow from turns, and from edges along an axis."""
    corners = sorted_unique(keys)
    directions = np.zeros(len(corners), np.uint8)
    _set_directions(rings.vertices, rings.starts, corners, axis, stride, directions)
    return np.asarray(corners[_IS_NODE[directions]])


@inlined
def direction_bit(vertices, here, there):  # type: ignore[no-untyped-def]
    """Return the bit of the direction from one vertex to another: 1 right, 2 left, 4 down, 8 up."""
    if vertices[here, 0] == vertices[there, 0]:
        return 1 if vertices[there, 1] > vertices[here, 1] else 2
    return 4 if vertices[there, 0] > vertices[here, 0] else 8


@kernel("void(i4[:,::1], i8[::1], i8[::1], i8, i8, u1[::1])")
def _set_directions(vertices, starts, keys, axis, stride, directions):  # type: ignore[no-untyped-def]
    for ring in range(starts.shape[0] - 1):
        before = starts[ring + 1] - 1
        for v in range(starts[ring], starts[ring + 1]):
            after = v + 1 if v + 1 < starts[ring + 1] else starts[ring]
            line = np.int64(vertices[v, 1 - axis]) * stride
            place = lower_bound(keys, line + vertices[v, axis])
            directions[place] |= direction_bit(vertices, v, before) | direction_bit(vertices, v, after)
            if vertices[v, 1 - axis] == vertices[after, 1 - axis]:
                end = line + max(vertices[v, axis], vertices[after, axis])
                k = lower_bound(keys, line + min(vertices[v, axis], vertices[after, axis]) + 1)
                while k < keys.shape[0] and keys[k] < end:
                    directions[k] |= _PASSED
                    k += 1
            before = v


def sorted_unique(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the distinct keys in ascending order; many times as fast as `numpy.unique`, which hashes them.

    Examples
    --------
    >>> sorted_unique(np.array([3, 1, 3, 2])).tolist()
    [1, 2, 3]
    """
    ordered = np.sort(keys)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


@inlined
def lower_bound(keys, key):  # type: ignore[no-untyped-def]
    """Return the index of the first of some ascending keys that is not below a key (binary search)."""
    low = 0
    high = keys.shape[0]
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


def split_arcs(rings: Rings, shape: tuple[int, int]) -> tuple[Arcs, Bools]:
    """Split rings into arcs between nodes; also return which of the arcs' corners, (v,), are nodes.

    Nodes are those of `find_nodes` and the vertices on the border of the raster, whose shape is given. An arc
    begins at its end of the smaller key; a closed one goes on to its neighbour of the smaller key.
    """
    vertices = rings.vertices.astype(np.int64)
    keys = vertices[:, 0] * (shape[1] + 1) + vertices[:, 1]
    nodes = (vertices % shape == 0).any(axis=1) | np.isin(keys, find_nodes(rings, shape).by_row)
    begin = np.flatnonzero(_ends(vertices, keys, rings.starts, nodes))
    ring = np.searchsorted(rings.starts, begin, side="right") - 1
    end = np.empty_like(begin)
    end[previous(ring)] = begin
    first, total = rings.starts[ring], np.diff(rings.starts)[ring]
    second = first + (begin - first + 1) % total
    last = first + (end - first - 1) % total
    turned = np.where(begin == end, keys[second] > keys[last], keys[begin] > keys[end])
    origin = np.where(turned, end, begin)
    edge = keys[origin] + 1j * keys[np.where(turned, last, second)]
    _, one, used = np.unique(edge, return_index=True, return_inverse=True)
    label = rings.labels[ring]
    sides = np.stack([label[one], np.bincount(used, label).astype(np.int64) - label[one]], axis=1)
    counts = ((end - begin - 1) % total + 2)[one]
    ahead = ranges(0, counts) * np.where(turned, -1, 1)[one].repeat(counts)
    first, total, origin = (part[one].repeat(counts) for part in (first, total, origin))
    index = first + (origin - first + ahead) % total
    arcs = Arcs(
        corners=vertices[index] * STEPS_PER_PIXEL,
        starts=np.cumsum(counts) - counts,
        counts=counts,
        sides=sides,
        used=used,
        rings=ring,
        turned=turned,
    )
    return arcs, nodes[index]


def _ends(vertices: Integers, keys: Integers, starts: Integers, nodes: Bools) -> Bools:
    """Return which vertices, (v,), end arcs: nodes, or in a ring without any the farthest from its middle.

    That one is a corner of a rectangle.
    """
    ring = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    doubled = np.minimum.reduceat(vertices, starts[:-1]) + np.maximum.reduceat(vertices, starts[:-1])
    free = np.flatnonzero(np.bincount(ring, nodes)[ring] == 0)
    far = ((2 * vertices[free] - doubled[ring[free]]) ** 2).sum(axis=1)
    free = free[np.lexsort((-keys[free], far, ring[free]))]
    ends = nodes.copy()
    ends[free[np.diff(ring[free], append=-1) != 0]] = True
    return ends


def join_arcs(rings: Rings, arcs: Arcs) -> Rings:
    """Join arcs again: return the rings that were split, with the corners of their arcs, in steps."""
    counts = arcs.counts[arcs.used] - 1
    begin = arcs.starts[arcs.used] + counts * arcs.turned
    ahead = ranges(0, counts) * np.where(arcs.turned, -1, 1).repeat(counts)
    starts = np.append(0, np.cumsum(np.bincount(arcs.rings, counts).astype(np.int64)))
    return replace(rings, vertices=arcs.corners[begin.repeat(counts) + ahead].astype(np.int32), starts=starts)


def find_crossing(arcs: Arcs, changed: Bools) -> Bools:
    """Return which arcs, (a,), meet others or themselves, except at their ends.

    Those that were changed, (a,), are compared with each other and with all whose extent overlaps theirs; in
    pieces, of which fewer overlap.
    """
    offsets = np.cumsum(arcs.counts) - arcs.counts
    corners = arcs.corners[ranges(arcs.starts, arcs.counts)]
    diagonal = [np.minimum.reduceat(corners, offsets), np.maximum.reduceat(corners, offsets)]
    extents = shapely.linestrings(np.stack(diagonal, axis=1))
    near = np.unique(shapely.STRtree(extents[changed]).query(extents)[0])
    segments = arcs.counts[near] - 1
    side = np.clip(segments // 3, 1, _PIECE)
    pieces = -(-segments // side)
    arc, side = np.repeat(near, pieces), np.repeat(side, pieces)
    begin = ranges(0, pieces) * side
    counts = np.minimum(side, arcs.counts[arc] - 1 - begin) + 1
    corners = arcs.corners[ranges(arcs.starts[arc] + begin, counts)].astype(np.float64)
    lines = shapely.linestrings(corners, indices=np.repeat(np.arange(len(arc)), counts))
    chosen = np.flatnonzero(changed[arc])
    one, other = shapely.STRtree(lines).query(lines[chosen], predicate="intersects")
    one = chosen[one]
    one, other = one[one != other], other[one != other]
    meet = ~shapely.relate_pattern(lines[one], lines[other], "FF*F*****")
    crossing = np.zeros(len(changed), bool)
    crossing[arc[np.append(one[meet], other[meet])]] = True
    crossing[arc[chosen[~shapely.is_simple(lines[chosen])]]] = True
    return crossing


def ranges(begin: Integers | int, counts: Integers) -> Integers:
    """Return the indices from each beginning on, one range after the other.

    Examples
    --------
    >>> ranges(np.array([5, 0]), np.array([2, 3])).tolist()
    [5, 6, 0, 1, 2]
    """
    return np.repeat(begin - np.cumsum(counts) + counts, counts) + np.arange(int(counts.sum()))


def previous(group: Integers) -> Integers:
    """Return the item before each, (n,), in its group of successive items; the last one before the first.

    Examples
    --------
    >>> previous(np.array([0, 0, 0, 4])).tolist()
    [2, 0, 1, 3]
    """
    first = np.diff(group, prepend=-1) > 0
    before = np.arange(len(group)) - 1
    before[first] = np.flatnonzero(np.roll(first, -1))
    return before


@inlined
def unit_corners(vertices, begin, end, by_row, by_col, rows, cols, corners, fixed):  # type: ignore[no-untyped-def]
    """Write all pixel corners of a ring, and which of them are fixed; returns their number."""
    used = 0
    for v in range(begin, end):
        after = v + 1 if v + 1 < end else begin
        row, col = int(vertices[v, 0]), int(vertices[v, 1])
        down, across = int(vertices[after, 0]) - row, int(vertices[after, 1]) - col
        length = abs(down) + abs(across)
        step_row, step_col = (down > 0) - (down < 0), (across > 0) - (across < 0)
        for k in range(length):
            corners[used + k, 0] = row + k * step_row
            corners[used + k, 1] = col + k * step_col
            fixed[used + k] = 0
        if row == 0 or row == rows or col == 0 or col == cols:
            fixed[used] = 1
        keys, key = (by_row, row * (cols + 1) + col) if down == 0 else (by_col, col * (rows + 1) + row)
        first = key + min(down + across, 0)  # one of the two is 0
        k = lower_bound(keys, first)
        while k < keys.shape[0] and keys[k] <= first + length:
            away = abs(keys[k] - key)
            if away < length:
                fixed[used + away] = 1
            k += 1
        used += length
    return used


@inlined
def edge_key(corners, here, there, cols):  # type: ignore[no-untyped-def]
    """Return the key of the edge from one corner to the next: number of the corner, and a direction."""
    down, across = corners[there, 0] - corners[here, 0], corners[there, 1] - corners[here, 1]
    direction = 0 if across > 0 else 2 if across < 0 else 1 if down > 0 else 3
    return (corners[here, 0] * (cols + 1) + corners[here, 1]) * 4 + direction


@inlined
def compare_corners(corners, one, other):  # type: ignore[no-untyped-def]
    """Compare two corners in raster order: -1 if the first one precedes, 1 if it follows, 0 if equal."""
    rows, cols = corners[one, 0] - corners[other, 0], corners[one, 1] - corners[other, 1]
    first = rows if rows != 0 else cols
    return 1 if first > 0 else -1 if first < 0 else 0


@inlined
def load_arc(corners, total, start, n, reverse, base):  # type: ignore[no-untyped-def]
    """Write the corners of an arc relative to its first one, in the orientation of the arc."""
    first = (start + n) % total if reverse else start
    for k in range(n + 1):
        here = (start + (n - k if reverse else k)) % total
        base[0, k] = corners[here, 1] - corners[first, 1]
        base[1, k] = corners[here, 0] - corners[first, 0]
    return first


@inlined
def is_reversed(corners, total, start, n):  # type: ignore[no-untyped-def]
    """Check whether the orientation of an arc, from the end that precedes, is opposite to the ring's."""
    end = (start + n) % total
    order = compare_corners(corners, start, end)
    if order == 0:
        order = compare_corners(corners, (start + 1) % total, (start + n - 1) % total)
    return order > 0


@inlined
def portal_offsets(base_x, base_y, n, x, y, offsets):  # type: ignore[no-untyped-def]
    """Compute where a line crosses the portals of an arc: steps to the left of the middle of each."""
    for e in range(n):
        dx, dy = base_x[e + 1] - base_x[e], base_y[e + 1] - base_y[e]
        middle_x, middle_y = 0.5 * (base_x[e] + base_x[e + 1]), 0.5 * (base_y[e] + base_y[e + 1])
        before = (x[e] - middle_x) * dx + (y[e] - middle_y) * dy
        after = (x[e + 1] - middle_x) * dx + (y[e + 1] - middle_y) * dy
        share = before / (before - after)
        across_x = x[e] + share * (x[e + 1] - x[e]) - middle_x
        across_y = y[e] + share * (y[e + 1] - y[e]) - middle_y
        offsets[e] = STEPS_PER_PIXEL * (across_x * dy - across_y * dx)


@inlined
def place_points(base_x, base_y, n, cyclic, offsets, px, py, steps):  # type: ignore[no-untyped-def]
    """Round the points on the portals to steps; returns the index of the last point."""
    # An open arc begins and ends with its two corners; the last point of a cyclic one equals its first.
    lead = 0 if cyclic else 1
    for e in range(n):
        step = min(max(int((offsets[e] + MAX_OFFSET) + 0.5) - MAX_OFFSET, -MAX_OFFSET), MAX_OFFSET)
        steps[e + lead] = step
        dx, dy = int(base_x[e + 1] - base_x[e]), int(base_y[e + 1] - base_y[e])
        px[e + lead] = int(STEPS_PER_PIXEL // 2 * (base_x[e] + base_x[e + 1])) + step * dy
        py[e + lead] = int(STEPS_PER_PIXEL // 2 * (base_y[e] + base_y[e + 1])) - step * dx
    if cyclic:
        px[n] = px[0]
        py[n] = py[0]
        return n
    px[0] = py[0] = 0
    px[n + 1] = int(STEPS_PER_PIXEL * base_x[n])
    py[n + 1] = int(STEPS_PER_PIXEL * base_y[n])
    return n + 1


@inlined
def cross_product(ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Return the cross product of a and b: above 0 where b points to the right of a in the image."""
    return ax * by - ay * bx


@inlined
def straighten(base_x, base_y, cyclic, px, py, steps, last, kept):  # type: ignore[no-untyped-def]
    """Fit a sleeve greedily: from each point a segment to the furthest point that it reaches."""
    # A segment passes through all portals between, within SLEEVE_WIDTH of the point on each. Returns the
    # number of points that are kept; their indices are written to `kept`, 0 and the last among them.
    lead = 0 if cyclic else 1
    kept[0] = 0
    count, here = 1, 0
    while here < last:
        best, at = here + 1, here + 1
        left_x = left_y = right_x = right_y = 0
        while at < last and at - here < _MAX_EDGES:
            dx = int(base_x[at - lead + 1] - base_x[at - lead])
            dy = int(base_y[at - lead + 1] - base_y[at - lead])
            out = min(steps[at] + SLEEVE_WIDTH, MAX_OFFSET) - steps[at]
            back = max(steps[at] - SLEEVE_WIDTH, -MAX_OFFSET) - steps[at]
            lx, ly = px[at] - px[here] + out * dy, py[at] - py[here] - out * dx
            rx, ry = px[at] - px[here] + back * dy, py[at] - py[here] - back * dx
            if cross_product(lx, ly, rx, ry) <= 0:
                break  # the segment would pass the portal backwards
            if at == here + 1 or cross_product(left_x, left_y, lx, ly) > 0:
                left_x, left_y = lx, ly
            if at == here + 1 or cross_product(rx, ry, right_x, right_y) > 0:
                right_x, right_y = rx, ry
            if cross_product(left_x, left_y, right_x, right_y) < 0:
                break
            at += 1
            x, y = px[at] - px[here], py[at] - py[here]
            if cross_product(left_x, left_y, x, y) >= 0 and cross_product(x, y, right_x, right_y) >= 0:
                best = at
        kept[count] = best
        count += 1
        here = best
    return count


@inlined
def doubled_steps(px, py, kept, count):  # type: ignore[no-untyped-def]
    """Return twice the signed area between the kept points and the line from the last to the first."""
    before = kept[count - 1]
    doubled = 0
    for k in range(count):
        doubled += px[before] * py[kept[k]] - py[before] * px[kept[k]]
        before = kept[k]
    return doubled


@inlined
def area_slope(base_x, base_y, n, cyclic, px, py, last):  # type: ignore[no-untyped-def]
    """Return the growth of twice the area if all points move one step to the left on their portals."""
    lead = 0 if cyclic else 1
    slope = 0
    for e in range(n):
        at = e + lead
        before = at - 1 if at > 0 else last - 1
        along_x, along_y = px[at + 1] - px[before], py[at + 1] - py[before]
        slope += along_y * int(base_y[e + 1] - base_y[e]) + along_x * int(base_x[e + 1] - base_x[e])
    return slope
