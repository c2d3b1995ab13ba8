"""Smooth rings arc by arc: surface nets, then sleeve fitting.

An arc that two rings share is processed in the same orientation for both, so both get identical points.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.regions.outline.rings import Rings
from uavseg.regions.smooth.arcs import edge_key, is_reversed, load_arc, unit_corners
from uavseg.regions.smooth.nodes import Nodes
from uavseg.regions.smooth.sleeve import (
    MAX_OFFSET,
    STEPS_PER_PIXEL,
    area_slope,
    doubled_steps,
    place_points,
    portal_offsets,
    straighten,
)
from uavseg.regions.smooth.surface_nets import doubled_area, relax
from uavseg.regions.sorted_keys import lower_bound

Integers = NDArray[np.int64]

_MAX_TRIES = 6  # to restore the area that straight segments cut off or add


@dataclass(frozen=True, slots=True)
class SmoothRings:
    """Smooth rings and the arcs that they are made of.

    Parameters
    ----------
    rings : Rings
        In steps, STEPS_PER_PIXEL to a pixel; a ring may begin at any of its vertices.
    arcs : (k,) int64 array
        Key of each arc, the same in both rings that share it.
    owners : (k,) int64 array
        The ring that each belongs to.
    """

    rings: Rings
    arcs: Integers
    owners: Integers


def smooth_rings(
    rings: Rings, nodes: Nodes, shape: tuple[int, int], unsmoothed: Integers, share: float = 1.0
) -> SmoothRings:
    """Smooth all boundaries, within nearly half a pixel of the pixel edges.

    Nodes, and corners on the border of the raster, are fixed.

    Parameters
    ----------
    rings : Rings
        Along pixel edges.
    nodes : Nodes
    shape : (int, int)
        Rows and columns of the raster.
    unsmoothed : (k,) int64 array
        Keys of arcs that stay on the pixel edges, ascending.
    share : float
        Blend between pixel edges (towards 0) and the smooth line (1); above 0 and at most 1.
    """
    lengths = _lengths(rings)
    units, longest = int(lengths.sum()), int(lengths.max(initial=0))
    vertices, starts = np.empty((2 * units, 2), np.int32), np.zeros_like(rings.starts)
    arcs, owners = np.empty((2, units), np.int64)
    corners, fixed = np.empty((longest + 1, 2), np.int64), np.empty(longest + 1, np.uint8)
    floats, integers = np.empty((7, longest + 2)), np.empty((4, longest + 2), np.int64)
    found = _smooth(
        *(rings.vertices, rings.starts, nodes.by_row, nodes.by_col, unsmoothed, *shape, share),
        *(corners, fixed, floats, integers, vertices, starts, arcs, owners),
    )
    smooth = replace(rings, vertices=vertices[: starts[-1]].copy(), starts=starts)
    return SmoothRings(smooth, arcs[:found].copy(), owners[:found].copy())


def _lengths(rings: Rings) -> Integers:
    """Unit edges of each ring."""
    first, last = rings.starts[:-1], rings.starts[1:] - 1
    steps = np.abs(np.diff(rings.vertices, axis=0)).sum(axis=1, dtype=np.int64)
    sums = np.concatenate([[0], np.cumsum(steps)])
    closing = np.abs(rings.vertices[last] - rings.vertices[first]).sum(axis=1, dtype=np.int64)
    return np.asarray(closing + sums[last] - sums[first], np.int64)


@inlined
def write_vertex(row, col, vertices, used):  # type: ignore[no-untyped-def]
    """Write a vertex; returns the number of vertices."""
    vertices[used, 0] = row
    vertices[used, 1] = col
    return used + 1


@inlined
def write_edges(corners, total, start, n, cyclic, vertices, used):  # type: ignore[no-untyped-def]
    """Write an arc along its pixel edges, without its last corner."""
    for k in range(n):
        here = (start + k) % total
        before = (start + k - 1) % total
        after = (start + k + 1) % total
        straight = corners[before, 0] + corners[after, 0] == 2 * corners[here, 0]
        straight = straight and corners[before, 1] + corners[after, 1] == 2 * corners[here, 1]
        if not straight or (k == 0 and not cyclic):
            used = write_vertex(
                STEPS_PER_PIXEL * corners[here, 0], STEPS_PER_PIXEL * corners[here, 1], vertices, used
            )
    return used


@inlined
def write_arc(base, integers, row, col, n, cyclic, reverse, share, last, count, vertices, used):  # type: ignore[no-untyped-def]
    """Write the points of a smooth arc, without its last one, in the orientation of the ring."""
    px = integers[0]
    py = integers[1]
    kept = integers[3]
    if share == 1.0:
        for k in range(count - 1):
            at = kept[count - 1 - k] if reverse else kept[k]
            used = write_vertex(
                STEPS_PER_PIXEL * row + py[at], STEPS_PER_PIXEL * col + px[at], vertices, used
            )
        return used
    # Between the points of two adjacent edges lies their corner, blended by the same share.
    for k in range(last):
        at = last - k if reverse else k
        if cyclic or k > 0:
            edge = at if cyclic else at - 1
            edge = edge % n
            x = 0.5 * STEPS_PER_PIXEL * (base[0, edge] + base[0, edge + 1])
            y = 0.5 * STEPS_PER_PIXEL * (base[1, edge] + base[1, edge + 1])
            x = np.floor(x + share * (px[at] - x) + 0.5)
            y = np.floor(y + share * (py[at] - y) + 0.5)
            used = write_vertex(
                STEPS_PER_PIXEL * row + int(y), STEPS_PER_PIXEL * col + int(x), vertices, used
            )
        else:
            used = write_vertex(
                STEPS_PER_PIXEL * row + py[at], STEPS_PER_PIXEL * col + px[at], vertices, used
            )
        low = at - 1 if reverse else at
        if cyclic or (low >= 1 and low < last - 1):
            corner = low + 1 if cyclic else low
            x = np.floor(
                STEPS_PER_PIXEL * base[0, corner] * (1.0 - share)
                + share * 0.5 * (px[low] + px[low + 1])
                + 0.5
            )
            y = np.floor(
                STEPS_PER_PIXEL * base[1, corner] * (1.0 - share)
                + share * 0.5 * (py[low] + py[low + 1])
                + 0.5
            )
            used = write_vertex(
                STEPS_PER_PIXEL * row + int(y), STEPS_PER_PIXEL * col + int(x), vertices, used
            )
    return used


@inlined
def fit_arc(floats, integers, n, cyclic):  # type: ignore[no-untyped-def]
    """Fit points to an arc; returns the index of the last point, and how many are kept."""
    relax(floats[0], floats[1], n, cyclic, floats[2], floats[3], floats[4], floats[5])
    offsets = floats[6]
    portal_offsets(floats[0], floats[1], n, floats[2], floats[3], offsets)
    expected = int(doubled_area(floats[0], floats[1], n)) * STEPS_PER_PIXEL * STEPS_PER_PIXEL
    last = 0
    count = 0
    for _try in range(_MAX_TRIES):
        last = place_points(floats[0], floats[1], n, cyclic, offsets, integers[0], integers[1], integers[2])
        count = straighten(
            floats[0], floats[1], cyclic, integers[0], integers[1], integers[2], last, integers[3]
        )
        missing = expected - doubled_steps(integers[0], integers[1], integers[3], count)
        if abs(missing) <= 64 * n:  # a two-thousandth of a pixel for each edge
            break
        slope = area_slope(floats[0], floats[1], n, cyclic, integers[0], integers[1], last)
        if slope <= 0:
            break
        more = float(missing) / float(slope)
        for e in range(n):
            offsets[e] = min(max(offsets[e] + more, -MAX_OFFSET), MAX_OFFSET)
    return last, count


_READ = "i4[:,::1], i8[::1], i8[::1], i8[::1], i8[::1], i8, i8, f8"
_BUFFERS = "i8[:,::1], u1[::1], f8[:,::1], i8[:,::1]"
_WRITTEN = "i4[:,::1], i8[::1], i8[::1], i8[::1]"


@kernel(f"i8({_READ}, {_BUFFERS}, {_WRITTEN})")
def _smooth(  # type: ignore[no-untyped-def]
    vertices, starts, by_row, by_col, unsmoothed, rows, cols, share, corners, fixed, floats, integers,
    smooth, smooth_starts, arcs, owners,
):  # fmt: skip
    used = 0
    found = 0
    smooth_starts[0] = 0
    for ring in range(starts.shape[0] - 1):
        begin = starts[ring]
        total = unit_corners(vertices, begin, starts[ring + 1], by_row, by_col, rows, cols, corners, fixed)
        first = 0
        while first < total and not fixed[first]:
            first += 1
        cyclic = first == total
        start = 0 if cyclic else first
        left = total
        while left > 0:
            n = 1
            while n < left and not fixed[(start + n) % total]:
                n += 1
            reverse = is_reversed(corners, total, start, n)
            origin = load_arc(corners, total, start, n, reverse, floats)
            second = (origin - 1 if reverse else origin + 1) % total
            key = edge_key(corners, origin, second, cols)
            place = lower_bound(unsmoothed, key)
            if place < unsmoothed.shape[0] and unsmoothed[place] == key:
                used = write_edges(corners, total, start, n, cyclic, smooth, used)
            else:
                row = corners[origin, 0]
                col = corners[origin, 1]
                last, count = fit_arc(floats, integers, n, cyclic)
                used = write_arc(
                    floats, integers, row, col, n, cyclic, reverse, share, last, count, smooth, used
                )
            arcs[found] = key
            owners[found] = ring
            found += 1
            start = (start + n) % total
            left -= n
        smooth_starts[ring + 1] = used
    return found
