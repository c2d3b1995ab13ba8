"""Smooth outlines: surface nets and sleeve fitting, with shared borders, pixels and areas preserved.

An arc that two rings share is processed in the same orientation for both, so both get identical points.

Every pixel corner of an arc moves towards the middle of its two neighbours, repeatedly, and never further
than nearly half a pixel along each axis. The squares around different corners have no point in common, so
boundaries neither cross nor touch where they did not before. Such nets shrink convex shapes; here the area on
either side of an arc is restored after every few steps. Against the true outlines of seeded random fields
(features of 3 to 40 pixels), 16 steps had the smallest distance: 0.08 to 0.19 pixels on average.

Gibson, S. F. F. (1998): Constrained elastic surface nets: generating smooth surfaces from binary segmented
data. MICCAI, LNCS 1496, 888-898.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.raster.grid.geobox import GeoBox, scaled
from uavseg.raster.grid.ground import ground_resolution
from uavseg.regions.outline.rings import Rings, reorder_rings
from uavseg.regions.smooth.arcs import (
    MAX_OFFSET,
    STEPS_PER_PIXEL,
    Nodes,
    area_slope,
    doubled_steps,
    edge_key,
    find_nodes,
    is_reversed,
    load_arc,
    lower_bound,
    place_points,
    portal_offsets,
    straighten,
    unit_corners,
)

MAX_SHIFT = 0.4375  # pixels that a corner may move along each axis
_ROUNDS = 2
_STEPS = 8  # of each round; even, as they are done in pairs
_MAX_TRIES = 6  # to restore the area that straight segments cut off or add
AREA_TOLERANCE = 0.01  # largest relative change of a region's area
_MAX_SIDE = np.iinfo(np.int32).max // STEPS_PER_PIXEL - 1
_READ = "i4[:,::1], i8[::1], i8[::1], i8[::1], i8[::1], i8, i8, f8"
_BUFFERS = "i8[:,::1], u1[::1], f8[:,::1], i8[:,::1]"
_WRITTEN = "i4[:,::1], i8[::1], i8[::1], i8[::1]"


@inlined
def relax(base_x, base_y, n, cyclic, x, y, other_x, other_y):  # type: ignore[no-untyped-def]
    """Relax an arc of n unit edges from its corners `base_x`, `base_y`; the result is written to `x`, `y`."""
    # All arrays are of floats and have at least n + 1 items. The ends of an open arc are fixed; those of a
    # cyclic one are the same corner, which moves.
    for i in range(n + 1):
        x[i] = base_x[i]
        y[i] = base_y[i]
    area = doubled_area(base_x, base_y, n)
    for _round in range(_ROUNDS):
        for _step in range(_STEPS // 2):
            relax_axis(x, other_x, base_x, n, cyclic)
            relax_axis(other_x, x, base_x, n, cyclic)
            relax_axis(y, other_y, base_y, n, cyclic)
            relax_axis(other_y, y, base_y, n, cyclic)
        restore_area(x, y, base_x, base_y, n, cyclic, area - doubled_area(x, y, n), other_x, other_y)


@inlined
def clamp(value, middle, reach):  # type: ignore[no-untyped-def]
    """Clamp a value to at most `reach` from the middle."""
    return min(max(value, middle - reach), middle + reach)


@inlined
def relax_axis(here, there, base, n, cyclic):  # type: ignore[no-untyped-def]
    """Relax along one axis: each corner moves halfway to the middle of its neighbours."""
    for i in range(1, n):
        there[i] = clamp(0.5 * here[i] + 0.25 * (here[i - 1] + here[i + 1]), base[i], MAX_SHIFT)
    there[0] = here[0]
    there[n] = here[n]
    if cyclic:
        there[0] = clamp(0.5 * here[0] + 0.25 * (here[n - 1] + here[1]), base[0], MAX_SHIFT)
        there[n] = there[0]


@inlined
def doubled_area(x, y, n):  # type: ignore[no-untyped-def]
    """Return twice the signed area between an arc and the line from its end to its start."""
    doubled = x[n] * y[0] - y[n] * x[0]
    for i in range(n):
        doubled += x[i] * y[i + 1] - y[i] * x[i + 1]
    return doubled


@inlined
def restore_area(x, y, base_x, base_y, n, cyclic, missing, along_x, along_y):  # type: ignore[no-untyped-def]
    """Move the corners along the gradient of the area, so that twice the area grows by `missing`."""
    # The gradient at each corner is the vector between its neighbours, rotated by a right angle. Corners stay
    # within MAX_SHIFT, so the area may grow by less.
    squares = 0.0
    for i in range(0 if cyclic else 1, n):
        before = i - 1 if i > 0 else n - 1
        along_x[i] = x[i + 1] - x[before]
        along_y[i] = y[i + 1] - y[before]
        squares += along_x[i] * along_x[i] + along_y[i] * along_y[i]
    if squares == 0.0:
        return
    share = missing / squares
    for i in range(0 if cyclic else 1, n):
        x[i] = clamp(x[i] + share * along_y[i], base_x[i], MAX_SHIFT)
        y[i] = clamp(y[i] - share * along_x[i], base_y[i], MAX_SHIFT)
    if cyclic:
        x[n] = x[0]
        y[n] = y[0]


def smooth_outlines(rings: Rings, metres: float, geobox: GeoBox) -> tuple[Rings, GeoBox]:
    """Smooth the outlines of regions; none vanishes, overlaps another or becomes invalid.

    An outline still runs between the same pixel centres, so burning it into the raster's grid gives the same
    labels, and stays within half a pixel of the pixel edges (constrained elastic surface nets, see
    `surface_nets`). A border between two regions stays one line. Nodes, and corners on the raster's border,
    are fixed. Where the area of a region would change by more than a hundredth, its outline stays on the
    pixel edges, and so do its neighbours' borders with it.

    Rings run along the pixel edges of `geobox`; those that are returned are in corners of the finer grid,
    with STEPS_PER_PIXEL times as many rows and columns, and may begin at any of their vertices. `metres` is
    the largest distance of outlines from the pixel edges, in units of the transform where there is no CRS.
    More than half a pixel counts as half a pixel; with less, stairs are flattened, not removed. A
    ParameterError says that `metres` is negative or not finite, or that the raster has more than eight
    million rows or columns.

    Examples
    --------
    >>> from affine import Affine
    >>> from uavseg.regions.outline.trace import trace
    >>> box = GeoBox((3, 3), Affine(2.0, 0.0, 0.0, 0.0, -2.0, 0.0), None)
    >>> pixel = trace(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]], np.uint32))
    >>> smooth, fine = smooth_outlines(pixel, 1.0, box)
    >>> (smooth.vertices / STEPS_PER_PIXEL).round(1).tolist()
    [[0.8, 1.5], [1.5, 2.2], [2.2, 1.5], [1.5, 0.8]]
    """
    if not 0 <= metres < np.inf:
        raise ParameterError(f"expected outlines to be smoothed by 0 or more metres, got {metres:g}")
    fine = finer_grid(geobox, "--smooth-outline")
    share = min(metres / (max(ground_resolution(geobox)) / 2), 1.0)
    if share == 0 or not len(rings.labels):
        return replace(rings, vertices=rings.vertices * np.int32(STEPS_PER_PIXEL)), fine
    return _smooth_preserving_areas(rings, geobox.shape, share), fine


def finer_grid(geobox: GeoBox, option: str) -> GeoBox:
    """Return a grid of STEPS_PER_PIXEL times as many rows and columns; refuse too many, for an option."""
    rows, cols = geobox.shape
    if max(rows, cols) > _MAX_SIDE:
        many = f"more than {_MAX_SIDE:,} rows or columns"
        raise ParameterError(f"outlines of a raster of {many} are drawn on pixel edges; leave {option} out")
    transform = scaled(geobox.transform, 1 / STEPS_PER_PIXEL, 1 / STEPS_PER_PIXEL)
    return replace(geobox, shape=(STEPS_PER_PIXEL * rows, STEPS_PER_PIXEL * cols), transform=transform)


def _smooth_preserving_areas(rings: Rings, shape: tuple[int, int], share: float) -> Rings:
    """Smooth rings; the arcs of regions whose area would change too much are not smoothed."""
    nodes = find_nodes(rings, shape)
    smooth = smooth_rings(rings, nodes, shape, np.empty(0, np.int64), share)
    expected = _areas(rings) * STEPS_PER_PIXEL**2
    unsmoothed = np.empty(0, np.int64)
    while (wrong := np.abs(_areas(smooth.rings) - expected) > AREA_TOLERANCE * expected).any():
        of_wrong = wrong[rings.labels]
        more = np.setdiff1d(smooth.arcs[of_wrong[smooth.owners]], unsmoothed)
        assert len(more), "regions on pixel edges have the area of their pixels"
        unsmoothed = np.union1d(unsmoothed, more)
        affected = np.zeros(len(rings.labels), bool)
        affected[smooth.owners[np.isin(smooth.arcs, more)]] = True
        again = smooth_rings(rings.select(affected), nodes, shape, unsmoothed, share)
        order, old = np.arange(len(rings.labels)), smooth.rings
        order[affected] = len(order) + np.arange(int(affected.sum()))
        vertices = np.concatenate([old.vertices, again.rings.vertices])
        starts = np.concatenate([old.starts, len(old.vertices) + again.rings.starts[1:]])
        vertices, starts = reorder_rings(vertices, starts, order)
        smooth = replace(smooth, rings=replace(old, vertices=vertices, starts=starts))
    return smooth.rings if share == 1 else _drop_collinear(smooth.rings, nodes, shape)


def _drop_collinear(rings: Rings, nodes: Nodes, shape: tuple[int, int]) -> Rings:
    """Remove vertices at which rings do not turn, except nodes."""
    here = rings.vertices.astype(np.int64)
    index = np.arange(len(here))
    before, after = index - 1, index + 1
    before[rings.starts[:-1]], after[rings.starts[1:] - 1] = rings.starts[1:] - 1, rings.starts[:-1]
    incoming, outgoing = here - here[before], here[after] - here
    corner, rest = np.divmod(here, STEPS_PER_PIXEL)
    node = (rest == 0).all(axis=1) & np.isin(corner[:, 0] * (shape[1] + 1) + corner[:, 1], nodes.by_row)
    turning = node | (incoming[:, 0] * outgoing[:, 1] != incoming[:, 1] * outgoing[:, 0])
    starts = np.concatenate([[0], np.cumsum(turning)])[rings.starts]
    return replace(rings, vertices=rings.vertices[turning], starts=starts)


def _areas(rings: Rings) -> NDArray[np.float64]:
    """Return the area of each region 0..n, in square units of the rings."""
    return np.asarray(np.bincount(rings.labels, rings.pixel_areas()), np.float64)


@dataclass(frozen=True, slots=True)
class SmoothRings:
    """Smooth rings and the arcs that they are made of."""

    rings: Rings  # in steps, STEPS_PER_PIXEL to a pixel; they may begin at any of their vertices
    arcs: Integers  # their keys, the same in both rings that share an arc
    owners: Integers  # the rings that the arcs belong to


def smooth_rings(
    rings: Rings, nodes: Nodes, shape: tuple[int, int], unsmoothed: Integers, share: float = 1.0
) -> SmoothRings:
    """Smooth all boundaries of rings along pixel edges, within nearly half a pixel of these.

    Nodes, and corners on the border of the raster, are fixed. Arcs with the keys in `unsmoothed`, ascending,
    stay on the pixel edges. `share` blends between pixel edges (towards 0) and the smooth line (1); above 0
    and at most 1.
    """
    lengths = rings.pixel_perimeters()
    units, longest = int(lengths.sum()), int(lengths.max(initial=0))
    vertices, starts = np.empty((2 * units, 2), np.int32), np.zeros_like(rings.starts)
    arcs, owners = np.empty((2, units), np.int64)
    corners, fixed = np.empty((longest + 1, 2), np.int64), np.empty(longest + 1, np.uint8)
    floats, integers = np.empty((7, longest + 2)), np.empty((4, longest + 2), np.int64)
    count = _smooth(
        *(rings.vertices, rings.starts, nodes.by_row, nodes.by_col, unsmoothed, *shape, share),
        *(corners, fixed, floats, integers, vertices, starts, arcs, owners),
    )
    smooth = replace(rings, vertices=vertices[: starts[-1]].copy(), starts=starts)
    return SmoothRings(smooth, arcs[:count].copy(), owners[:count].copy())


@inlined
def write_vertex(row, col, down, right, vertices, used):  # type: ignore[no-untyped-def]
    """Write a vertex that lies steps down and to the right of a corner; return the number of vertices."""
    vertices[used, 0] = STEPS_PER_PIXEL * row + int(down)
    vertices[used, 1] = STEPS_PER_PIXEL * col + int(right)
    return used + 1


@inlined
def write_edges(corners, total, start, n, cyclic, vertices, used):  # type: ignore[no-untyped-def]
    """Write an arc along its pixel edges, without its last corner."""
    for k in range(n):
        here = (start + k) % total
        before, after = (start + k - 1) % total, (start + k + 1) % total
        straight = corners[before, 0] + corners[after, 0] == 2 * corners[here, 0]
        straight = straight and corners[before, 1] + corners[after, 1] == 2 * corners[here, 1]
        if not straight or (k == 0 and not cyclic):
            used = write_vertex(corners[here, 0], corners[here, 1], 0, 0, vertices, used)
    return used


@inlined
def write_arc(base, integers, row, col, n, cyclic, reverse, share, last, count, vertices, used):  # type: ignore[no-untyped-def]
    """Write the points of a smooth arc, without its last one, in the orientation of the ring."""
    px, py, kept = integers[0], integers[1], integers[3]
    if share == 1.0:
        for k in range(count - 1):
            at = kept[count - 1 - k] if reverse else kept[k]
            used = write_vertex(row, col, py[at], px[at], vertices, used)
        return used
    # Between the points of two adjacent edges lies their corner, blended by the same share.
    for k in range(last):
        at = last - k if reverse else k
        x, y = np.float64(px[at]), np.float64(py[at])
        if cyclic or k > 0:
            edge = (at if cyclic else at - 1) % n
            x = 0.5 * STEPS_PER_PIXEL * (base[0, edge] + base[0, edge + 1])
            y = 0.5 * STEPS_PER_PIXEL * (base[1, edge] + base[1, edge + 1])
            x = np.floor(x + share * (px[at] - x) + 0.5)
            y = np.floor(y + share * (py[at] - y) + 0.5)
        used = write_vertex(row, col, y, x, vertices, used)
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
            used = write_vertex(row, col, y, x, vertices, used)
    return used


@inlined
def fit_arc(floats, integers, n, cyclic):  # type: ignore[no-untyped-def]
    """Fit points to an arc; return the index of the last point, and the number of kept points."""
    base_x, base_y, offsets = floats[0], floats[1], floats[6]
    px, py, steps, kept = integers[0], integers[1], integers[2], integers[3]
    relax(base_x, base_y, n, cyclic, floats[2], floats[3], floats[4], floats[5])
    portal_offsets(base_x, base_y, n, floats[2], floats[3], offsets)
    expected = int(doubled_area(base_x, base_y, n)) * STEPS_PER_PIXEL * STEPS_PER_PIXEL
    last, count = 0, 0
    for _try in range(_MAX_TRIES):
        last = place_points(base_x, base_y, n, cyclic, offsets, px, py, steps)
        count = straighten(base_x, base_y, cyclic, px, py, steps, last, kept)
        missing = expected - doubled_steps(px, py, kept, count)
        if abs(missing) <= 64 * n:  # a two-thousandth of a pixel for each edge
            break
        slope = area_slope(base_x, base_y, n, cyclic, px, py, last)
        if slope <= 0:
            break
        more = float(missing) / float(slope)
        for e in range(n):
            offsets[e] = min(max(offsets[e] + more, -MAX_OFFSET), MAX_OFFSET)
    return last, count


@kernel(f"i8({_READ}, {_BUFFERS}, {_WRITTEN})")
def _smooth(  # type: ignore[no-untyped-def]
    vertices, starts, by_row, by_col, unsmoothed, rows, cols, share, corners, fixed, floats, integers,
    smooth, smooth_starts, arcs, owners,
):  # fmt: skip
    used, arc = 0, 0
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
                row, col = corners[origin, 0], corners[origin, 1]
                last, count = fit_arc(floats, integers, n, cyclic)
                used = write_arc(
                    floats, integers, row, col, n, cyclic, reverse, share, last, count, smooth, used
                )
            arcs[arc], owners[arc] = key, ring
            arc += 1
            start = (start + n) % total
            left -= n
        smooth_starts[ring + 1] = used
    return arc
