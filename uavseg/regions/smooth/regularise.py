"""Regularised outlines: right angles and common directions, with shared borders kept, within a distance.

Arcs are simplified (Douglas and Peucker). The main direction of a region is the mean of the directions of its
Arcs are simplified (Douglas, Peucker). The main direction of a region is the mean of the directions of its
are near enough are drawn along that direction or its normal, at their mean offset (least squares).
"""

from dataclasses import replace

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_resolution
from uavseg.regions.outline.rings import Rings
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.smooth.arcs import STEPS_PER_PIXEL, find_nodes
from uavseg.regions.smooth.smooth_outlines import finer_grid

_Points = NDArray[np.complex128]  # x + 1j y
_Lines = tuple[_Points, Floats, Floats]  # normals, offsets along them, largest distances of points
_STAIRS = 1.4  # pixels, and 0.85 of the distance, at most: by which arcs are simplified first
_STRAIGHT = 4.0  # pixels: shorter edges may be stairs, and are no sign of a direction
_NEAR, _SAME = np.cos(4 * np.radians([12, 5]))  # edges follow a direction; adjacent regions have one
_REGULAR = 0.65  # of the length of a region's simplified outline that follows its direction, at least
_LEAST = 0.5  # pixels: the smallest distance that is tried
_PIECE = 16  # segments of an arc that are compared with others at once


@dataclass(frozen=True, slots=True)
class _Arcs:
    """Arcs of rings, each once, and where rings use them; those of a ring follow each other."""

    corners: Integers  # (v, 2): row and column in steps, in the orientation of the arc
    starts: Integers  # (a,): offset of each arc in `corners`
    counts: Integers  # (a,): its corners
    used: Integers  # (u,): the arc of each use
    rings: Integers  # (u,): its ring
    turned: Bools  # (u,): whether the ring runs against the arc


def regularise_outlines(rings: Rings, metres: float, geobox: GeoBox) -> tuple[Rings, GeoBox, int]:
    """Draw outlines with right angles where they then stay within a distance of the pixel edges.

    Each arc between nodes (corners where three or more regions meet, and those on the raster's border, which
    stay) stays within `metres` of the arc on pixel edges, and the other way round (Hausdorff distance); these
    are units of the transform where there is no CRS. Borders stay shared, outlines valid, and no region or
    hole vanishes. An arc has the direction of the longer of its regions. It stays on the pixel edges where
    neither has one, as round ones, and single edges do where they would leave the distance.

    Returns rings in corners of the finer grid that is the second value, see `finer_grid`, and the number of
    regions that stay on pixel edges altogether.

    Examples
    --------
    >>> from uavseg.regions.outline.trace import trace
    >>> row, col = np.indices((40, 40))
    >>> diamond = trace((abs(row - 20) + abs(col - 20) < 15).astype(np.uint32))
    >>> len(regularise_outlines(diamond, 1.5, GeoBox((40, 40), Affine.identity(), None))[0].vertices)
    4
    """
    fine = finer_grid(geobox, "--regularize")
    if not len(rings.labels):
        return rings, fine, 0
    step = np.array(ground_resolution(geobox)[::-1]) / STEPS_PER_PIXEL  # metres, down and to the right
    pixel, (arcs, sides, fixed) = STEPS_PER_PIXEL * float(step.max()), _split(rings, geobox.shape)
    points: _Points = arcs.corners @ (step * np.array([1j, 1]))
    arc_of = np.repeat(np.arange(len(sides)), arcs.counts)
    numbered = np.column_stack([points.real, points.imag, np.arange(len(points))])
    lines, tolerance = shapely.linestrings(numbered, indices=arc_of), min(_STAIRS * pixel, 0.85 * metres)
    lines = shapely.simplify(lines, tolerance, preserve_topology=False)
    kept = shapely.get_coordinates(lines, include_z=True)[:, 2].astype(np.int64)
    edges = np.stack([kept[:-1], kept[1:]])[:, arc_of[kept[:-1]] == arc_of[kept[1:]]]
    turns = _directions(
        points[edges[1]] - points[edges[0]], sides[arc_of[edges[0]]], sides, _STRAIGHT * pixel
    )
    reach, turns = np.where(turns == 0, 0, metres - float(step.max())), np.where(turns == 0, 1, turns)
    points = points * turns.conj()[arc_of]
    while True:
        reach[reach < _LEAST * pixel] = 0
        drawn, regular = _drawn(arcs, points, fixed, arc_of, edges, turns, reach, step)
        wrong = regular & _crossing(drawn, regular)
        if not wrong.any():
            made = _linked(rings, drawn)
            wrong = regular & np.isin(sides, _invalid(rings, made)).any(axis=1)
            if not wrong.any():
                return made, fine, len(np.setdiff1d(rings.labels, sides[regular]))
        reach[wrong] /= 2


def _ranges(begin: Integers | int, counts: Integers) -> Integers:
    """Return the indices from each beginning on, one range after the other."""
    return np.repeat(begin - np.cumsum(counts) + counts, counts) + np.arange(int(counts.sum()))


def _split(rings: Rings, shape: tuple[int, int]) -> tuple[_Arcs, Integers, Bools]:
    """Split rings: arcs, their regions, (a, 2), 0 for none, and which of their corners, (v,), are nodes.

    A ring without a node begins where it is farthest from its middle, which is a corner of a rectangle.
    """
    corners, starts = rings.vertices.astype(np.int64), rings.starts[:-1]
    of_corner, keys = np.repeat(np.arange(len(starts)), np.diff(rings.starts)), corners @ [shape[1] + 1, 1]
    nodes = (corners % shape == 0).any(axis=1) | np.isin(keys, find_nodes(rings, shape).by_row)
    middle = np.minimum.reduceat(corners, starts) + np.maximum.reduceat(corners, starts)
    far = ((2 * corners - middle[of_corner]) ** 2).sum(axis=1)
    free = np.bincount(of_corner, nodes) == 0
    ends = nodes.copy()
    ends[np.lexsort((-keys, far, of_corner))[rings.starts[1:] - 1][free]] = True
    begin = np.flatnonzero(ends)
    ring = of_corner[begin]
    first, total, new = starts[ring], np.diff(rings.starts)[ring], np.diff(ring, prepend=-1) > 0
    after = np.roll(begin, -1)
    after[np.roll(new, -1)] = begin[new]
    there, back = first + (begin - first + 1) % total, first + (after - first - 1) % total
    turned = np.where(begin == after, keys[there] > keys[back], keys[begin] > keys[after])
    origin, second = np.where(turned, after, begin), np.where(turned, back, there)
    down, right = np.sign(corners[second] - corners[origin]).T
    _, one, used = np.unique(9 * keys[origin] + 3 * down + right, return_index=True, return_inverse=True)
    sides, order = np.zeros((len(one), 2), np.int64), np.argsort(used, kind="stable")
    sides[used[order], (np.diff(used[order], prepend=-1) == 0).astype(np.int64)] = rings.labels[ring[order]]
    counts = ((after - begin - 1) % total + 2)[one]
    along = np.where(turned, -1, 1)[one].repeat(counts) * _ranges(0, counts)
    first, total, origin = (part[one].repeat(counts) for part in (first, total, origin))
    index, offsets = first + (origin - first + along) % total, np.cumsum(counts) - counts
    corners = corners[index] * STEPS_PER_PIXEL
    is_end = np.isin(np.arange(len(index)), [offsets, offsets + counts - 1])
    arcs = _Arcs(corners=corners, starts=offsets, counts=counts, used=used, rings=ring, turned=turned)
    return arcs, sides, is_end & nodes[index]


def _directions(along: _Points, regions: Integers, sides: Integers, least: float) -> _Points:
    """Return the direction of each arc, (a,): that of the longer of its regions; 0 where neither has one.

    `along` and `regions` are the vectors, (e,), and the regions, (e, 2), of edges.
    """
    label, along, count = regions.T.reshape(-1), np.tile(along, 2), int(sides.max()) + 1
    length = np.abs(along)
    along = (along / np.maximum(length, 1e-300)) ** 4  # the same for directions that differ by right angles
    near = np.ones(len(label), bool)
    for _ in range(5):
        weighted = length**2 * along * near
        mean = np.bincount(label, weighted.real, count) + 1j * np.bincount(label, weighted.imag, count)
        mean /= np.maximum(np.abs(mean), 1e-300)
        near = (along * mean[label].conj()).real >= _NEAR
    total = np.bincount(label, length, count)
    regular = np.bincount(label, length * (near & (length >= least)), count) >= _REGULAR * total
    regular[0] = False
    rank = np.lexsort((-np.arange(count), total, regular)).argsort()  # the longest regular one is the last
    small, large = np.take_along_axis(sides, np.argsort(rank[sides], axis=1), axis=1).T
    alike = np.flatnonzero(regular[small] & ((mean[small] * mean[large].conj()).real >= _SAME))
    alike = alike[np.argsort(rank[large[alike]])]
    mean[small[alike]] = mean[large[alike]]
    return np.where(regular[large], np.exp(0.25j * np.angle(mean[large])), 0)


def _fit(points: _Points, fixed: Bools, begin: Integers, end: Integers, axis: Integers) -> _Lines:
    """Fit lines to runs: along axis 0 or 1 at the mean offset or through a node, else from end to end."""
    sides, ends, chord = end - begin, np.cumsum(end - begin), points[end] - points[begin]
    length, index = np.abs(np.diff(points)), _ranges(begin, sides)
    centre = np.add.reduceat((length * (points[1:] + points[:-1]) / 2)[index], ends - sides)
    centre /= np.add.reduceat(length[index], ends - sides)
    anchor = np.where(fixed[begin] | (axis == 2), points[begin], centre)
    anchor = np.where(fixed[end], points[end], anchor)
    normal = np.choose(axis, [np.full(len(axis), 1j), 1, 1j * chord / np.maximum(np.abs(chord), 1e-300)])
    offset = (anchor * normal.conj()).real
    away = np.abs((points[index] * normal.conj().repeat(sides)).real - offset.repeat(sides))
    last = np.abs((points[end] * normal.conj()).real - offset)
    return normal, offset, np.maximum(np.maximum.reduceat(away, ends - sides), last)


def _merged(points: _Points, fixed: Bools, edges: Integers, reach: Floats) -> list[Integers]:
    """Merge runs of one axis, and short ones with any, within reach, best first; return begin, end, axis."""
    begin, end = edges
    middle = (begin + end) // 2  # of corners that were cut off
    middle = middle[(np.abs(points[end] - points[begin]) <= 2 * reach[begin]) & (middle > begin)]
    begin, end = np.sort(np.append(begin, middle)), np.sort(np.append(end, middle))
    chord = points[end] - points[begin]
    axis = (np.abs(chord.real) < np.abs(chord.imag)).astype(np.int64)
    axis[fixed[begin] & fixed[end] | (_fit(points, fixed, begin, end, axis)[2] > reach[begin])] = 2
    while True:
        long = np.abs(points[end] - points[begin])
        new = np.where(long[1:] > long[:-1], axis[1:], axis[:-1])
        may = (np.minimum(long[1:], long[:-1]) <= reach[begin[1:]]) | (axis[1:] == axis[:-1]) & (new < 2)
        may &= (begin[1:] == end[:-1]) & ~(fixed[begin[:-1]] & fixed[end[1:]])  # of one arc, not all of it
        one = np.flatnonzero(may)
        away = _fit(points, fixed, begin[one], end[one + 1], new[one])[2]
        one, away = (part[away <= reach[begin[one]]] for part in (one, away))
        if not len(one):
            return [begin, end, axis]
        rank, best = np.argsort(np.argsort(away, kind="stable")), np.full(len(axis), len(one))
        np.minimum.at(best, np.append(one, one + 1), np.tile(rank, 2))
        one = one[(best[one] == rank) & (best[one + 1] == rank)]
        end[one], axis[one] = end[one + 1], new[one]
        begin, end, axis = (np.delete(part, one + 1) for part in (begin, end, axis))


def _drawn(
    arcs: _Arcs, points: _Points, fixed: Bools, arc_of: Integers, edges: Integers, turns: _Points,
    reach: Floats, step: Floats,
) -> tuple[_Arcs, Bools]:  # fmt: skip
    """Return the arcs as they are drawn within `reach`, (a,) metres, and which have a new line.

    Lines end where they meet, if that is in reach of the point between them, else at that point's feet. A run
    whose line turns back or leaves its reach keeps its points.
    """
    begin, end, axis = _merged(points, fixed, edges, reach[arc_of])
    (normal, offset, _), arc, count = _fit(points, fixed, begin, end, axis), arc_of[begin], end - begin + 1
    new, tail, before = (
        np.diff(arc, prepend=-1) > 0,
        np.diff(arc, append=len(turns)) > 0,
        np.arange(len(arc)) - 1,
    )
    before[new] = np.flatnonzero(tail)
    kept = (reach[arc] == 0) | ~fixed[arcs.starts][arc] & (np.bincount(arc)[arc] < 3)
    inside, run_of, here = _ranges(begin, count), np.repeat(np.arange(len(arc)), count), points[begin]
    away = offset[before] - (here * normal[before].conj()).real
    to = offset - (here * normal.conj()).real
    sine = (normal[before].conj() * normal).imag
    meet = 1j * (to * normal[before] - away * normal) / np.where(np.abs(sine) > 0.1, sine, 1e-300)
    while True:
        met = (np.abs(meet) <= reach[arc]) & ~kept & ~kept[before]
        enter = np.where(fixed[begin], here, here + np.where(met, meet, to * normal))
        leave = np.empty_like(enter)
        leave[before] = here + np.where(met, meet, away * normal[before])
        leave = np.where(fixed[end], points[end], leave)
        along = leave - enter
        share = ((points[inside] - enter[run_of]) * along[run_of].conj()).real
        share = np.clip(share / np.maximum(np.abs(along) ** 2, 1e-300)[run_of], 0, 1)
        far = np.abs(points[inside] - enter[run_of] - share * along[run_of])
        wrong = np.maximum.reduceat(far, np.cumsum(count) - count) > reach[arc]
        wrong |= (along * (points[end] - here).conj()).real < 0
        if not (wrong & ~kept).any():
            break
        kept |= wrong
    sizes = np.where(kept, count, 2)
    made, at = points[_ranges(begin, sizes)], np.cumsum(sizes) - sizes
    made[at[~kept]], made[at[~kept] + 1] = enter[~kept], leave[~kept]
    closed = ~fixed[arcs.starts][arc]  # their first point is the last one, too
    closing, of = (at + sizes)[tail & closed], arc.repeat(sizes)
    made, of = np.insert(made, closing, made[at[new & closed]]), np.insert(of, closing, arc[tail & closed])
    made *= turns[of]
    corners = np.rint(np.stack([made.imag, made.real], axis=1) / step).astype(np.int64)
    distinct = (np.diff(corners, axis=0, prepend=-1) != 0).any(axis=1) | (np.diff(of, prepend=-1) > 0)
    counts = np.bincount(of[distinct])
    regular = (np.bincount(arc, ~kept) > 0) & (counts > 1)
    starts = np.where(regular, len(arcs.corners) + np.cumsum(counts) - counts, arcs.starts)
    counts, corners = (
        np.where(regular, counts, arcs.counts),
        np.concatenate([arcs.corners, corners[distinct]]),
    )
    return replace(arcs, corners=corners, starts=starts, counts=counts), regular


def _crossing(arcs: _Arcs, regular: Bools) -> Bools:
    """Return the arcs, (a,), that meet others, or themselves, but at nodes; one of two has a new line."""
    segments, wrong = arcs.counts - 1, np.zeros(len(regular), bool)
    side = np.clip(segments // 3, 1, _PIECE)
    arc = np.repeat(np.arange(len(side)), -(-segments // side))
    begin = _ranges(0, -(-segments // side)) * side[arc]
    counts = np.minimum(side[arc], segments[arc] - begin) + 1
    corners = arcs.corners[_ranges(arcs.starts[arc] + begin, counts)].astype(np.float64)
    pieces = shapely.linestrings(corners, indices=np.repeat(np.arange(len(arc)), counts))
    chosen = np.flatnonzero(regular[arc])
    one, other = shapely.STRtree(pieces).query(pieces[chosen], predicate="intersects")
    one, other = chosen[one[chosen[one] != other]], other[chosen[one] != other]
    meet = ~shapely.relate_pattern(pieces[one], pieces[other], "FF*F*****")
    wrong[arc[one[meet]]] = wrong[arc[other[meet]]] = True
    wrong[arc[chosen[~shapely.is_simple(pieces[chosen])]]] = True
    return wrong


def _linked(rings: Rings, arcs: _Arcs) -> Rings:
    """Return the rings that the arcs make."""
    counts = arcs.counts[arcs.used] - 1
    begin = arcs.starts[arcs.used] + counts * arcs.turned
    along = np.where(arcs.turned, -1, 1).repeat(counts) * _ranges(0, counts)
    starts = np.append(0, np.cumsum(np.bincount(arcs.rings, counts).astype(np.int64)))
    return replace(rings, vertices=arcs.corners[begin.repeat(counts) + along].astype(np.int32), starts=starts)


def _invalid(before: Rings, rings: Rings) -> Integers:
    """Return the regions that are not valid, hold a ring of others, or of which a ring was turned over."""
    polygons = np.asarray(LazyPolygons(rings, Affine.identity()))
    wrong = ~shapely.is_valid(polygons)
    within = shapely.STRtree(shapely.points(rings.vertices[rings.starts[:-1], ::-1]))
    wrong[within.query(polygons, predicate="contains")[0]] = True
    turned = np.sign(before.pixel_areas()) != np.sign(rings.pixel_areas())
    return np.union1d(np.flatnonzero(wrong) + 1, rings.labels[turned])
