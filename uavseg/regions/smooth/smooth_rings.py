"""Rings without stairs: each stretch of boundary between two nodes drawn straight for itself.

A stretch that two rings share is drawn in the same direction for both, so both get the very same points.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.regions.outline.rings import Rings
from uavseg.regions.smooth.arcs import edge_key, is_turned, load, unit_corners
from uavseg.regions.smooth.nodes import Nodes, first_from
from uavseg.regions.smooth.sleeve import (
    HALF,
    UNIT,
    area_slope,
    crossings,
    doubled_steps,
    place_points,
    straighten,
)
from uavseg.regions.smooth.surface_nets import doubled_area, relax

Integers = NDArray[np.int64]

_TRIES = 6  # at most, to give back the area that straight pieces took


@dataclass(frozen=True, slots=True)
class Smooth:
    """Smooth rings and the stretches that they are made of.

    Parameters
    ----------
    rings : Rings
        In steps of which `portals.UNIT` make a pixel; a ring may begin anywhere.
    stretches : (k,) int64 array
        A number for each stretch of boundary, the same in both rings that share it.
    owners : (k,) int64 array
        The ring of each.
    """

    rings: Rings
    stretches: Integers
    owners: Integers


def smooth_rings(
    rings: Rings, nodes: Nodes, shape: tuple[int, int], kept: Integers, share: float = 1.0
) -> Smooth:
    """Draw all boundaries without stairs, within nearly half a pixel of the pixel edges.

    Nodes, and corners on the border of the raster, stay where they are.

    Parameters
    ----------
    rings : Rings
        Along pixel edges.
    nodes : Nodes
    shape : (int, int)
        Rows and columns of the raster.
    kept : (k,) int64 array
        Stretches that stay on the pixel edges, ascending.
    share : float
        How far the way from the pixel edges to the smooth line is gone, above 0 and at most 1.
    """
    lengths = _lengths(rings)
    units, longest = int(lengths.sum()), int(lengths.max(initial=0))
    vertices, starts = np.empty((2 * units, 2), np.int32), np.zeros_like(rings.starts)
    stretches, owners = np.empty((2, units), np.int64)
    corners, fixed = np.empty((longest + 1, 2), np.int64), np.empty(longest + 1, np.uint8)
    floats, whole = np.empty((7, longest + 2)), np.empty((4, longest + 2), np.int64)
    found = _smooth(
        *(rings.vertices, rings.starts, nodes.by_row, nodes.by_col, kept, *shape, share),
        *(corners, fixed, floats, whole, vertices, starts, stretches, owners),
    )
    drawn = replace(rings, vertices=vertices[: starts[-1]].copy(), starts=starts)
    return Smooth(drawn, stretches[:found].copy(), owners[:found].copy())


def _lengths(rings: Rings) -> Integers:
    """Unit edges of each ring."""
    first, last = rings.starts[:-1], rings.starts[1:] - 1
    steps = np.abs(np.diff(rings.vertices, axis=0)).sum(axis=1, dtype=np.int64)
    sums = np.concatenate([[0], np.cumsum(steps)])
    closing = np.abs(rings.vertices[last] - rings.vertices[first]).sum(axis=1, dtype=np.int64)
    return np.asarray(closing + sums[last] - sums[first], np.int64)


@inlined
def emit(row, col, vertices, used):  # type: ignore[no-untyped-def]
    """Write a vertex; gives how many there are."""
    vertices[used, 0] = row
    vertices[used, 1] = col
    return used + 1


@inlined
def draw_edges(corners, total, start, n, cyclic, vertices, used):  # type: ignore[no-untyped-def]
    """Write a stretch along its pixel edges, without its last corner."""
    for k in range(n):
        here = (start + k) % total
        before = (start + k - 1) % total
        after = (start + k + 1) % total
        straight = corners[before, 0] + corners[after, 0] == 2 * corners[here, 0]
        straight = straight and corners[before, 1] + corners[after, 1] == 2 * corners[here, 1]
        if not straight or (k == 0 and not cyclic):
            used = emit(UNIT * corners[here, 0], UNIT * corners[here, 1], vertices, used)
    return used


@inlined
def draw_smooth(base, whole, row, col, n, cyclic, turned, share, last, many, vertices, used):  # type: ignore[no-untyped-def]
    """Write the points of a stretch, without its last one, in the direction of the ring."""
    px = whole[0]
    py = whole[1]
    kept = whole[3]
    if share == 1.0:
        for k in range(many - 1):
            at = kept[many - 1 - k] if turned else kept[k]
            used = emit(UNIT * row + py[at], UNIT * col + px[at], vertices, used)
        return used
    # Between two points of adjacent edges lies the corner, as far on its way to the line as they are.
    for k in range(last):
        at = last - k if turned else k
        if cyclic or k > 0:
            edge = at if cyclic else at - 1
            edge = edge % n
            x = 0.5 * UNIT * (base[0, edge] + base[0, edge + 1])
            y = 0.5 * UNIT * (base[1, edge] + base[1, edge + 1])
            x = np.floor(x + share * (px[at] - x) + 0.5)
            y = np.floor(y + share * (py[at] - y) + 0.5)
            used = emit(UNIT * row + int(y), UNIT * col + int(x), vertices, used)
        else:
            used = emit(UNIT * row + py[at], UNIT * col + px[at], vertices, used)
        low = at - 1 if turned else at
        if cyclic or (low >= 1 and low < last - 1):
            corner = low + 1 if cyclic else low
            x = np.floor(UNIT * base[0, corner] * (1.0 - share) + share * 0.5 * (px[low] + px[low + 1]) + 0.5)
            y = np.floor(UNIT * base[1, corner] * (1.0 - share) + share * 0.5 * (py[low] + py[low + 1]) + 0.5)
            used = emit(UNIT * row + int(y), UNIT * col + int(x), vertices, used)
    return used


@inlined
def lay_out(floats, whole, n, cyclic):  # type: ignore[no-untyped-def]
    """From the pixel edges of a stretch to its points; gives the place of the last, and how many are kept."""
    relax(floats[0], floats[1], n, cyclic, floats[2], floats[3], floats[4], floats[5])
    offsets = floats[6]
    crossings(floats[0], floats[1], n, floats[2], floats[3], offsets)
    wanted = int(doubled_area(floats[0], floats[1], n)) * UNIT * UNIT
    last = 0
    many = 0
    for _try in range(_TRIES):
        last = place_points(floats[0], floats[1], n, cyclic, offsets, whole[0], whole[1], whole[2])
        many = straighten(floats[0], floats[1], cyclic, whole[0], whole[1], whole[2], last, whole[3])
        missing = wanted - doubled_steps(whole[0], whole[1], whole[3], many)
        if abs(missing) <= 64 * n:  # a two-thousandth of a pixel for each edge
            break
        slope = area_slope(floats[0], floats[1], n, cyclic, whole[0], whole[1], last)
        if slope <= 0:
            break
        more = float(missing) / float(slope)
        for e in range(n):
            offsets[e] = min(max(offsets[e] + more, -HALF), HALF)
    return last, many


_READ = "i4[:,::1], i8[::1], i8[::1], i8[::1], i8[::1], i8, i8, f8"
_ROOM = "i8[:,::1], u1[::1], f8[:,::1], i8[:,::1]"
_WRITTEN = "i4[:,::1], i8[::1], i8[::1], i8[::1]"


@kernel(f"i8({_READ}, {_ROOM}, {_WRITTEN})")
def _smooth(  # type: ignore[no-untyped-def]
    vertices, starts, by_row, by_col, kept, rows, cols, share, corners, fixed, floats, whole,
    drawn, drawn_starts, stretches, owners,
):  # fmt: skip
    used = 0
    found = 0
    drawn_starts[0] = 0
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
            turned = is_turned(corners, total, start, n)
            origin = load(corners, total, start, n, turned, floats)
            second = (origin - 1 if turned else origin + 1) % total
            key = edge_key(corners, origin, second, cols)
            place = first_from(kept, key)
            if place < kept.shape[0] and kept[place] == key:
                used = draw_edges(corners, total, start, n, cyclic, drawn, used)
            else:
                row = corners[origin, 0]
                col = corners[origin, 1]
                last, many = lay_out(floats, whole, n, cyclic)
                used = draw_smooth(floats, whole, row, col, n, cyclic, turned, share, last, many, drawn, used)
            stretches[found] = key
            owners[found] = ring
            found += 1
            start = (start + n) % total
            left -= n
        drawn_starts[ring + 1] = used
    return found
