"""Regularised outlines: right angles and common directions, with shared borders kept, within a distance.

An arc, which ends at nodes where regions meet, stays within the distance of the pixel edges, and these of it.
Nodes stay where they are, and arcs meet nowhere else.

Arcs are simplified (Douglas and Peucker). The main direction of a region is the mean of the directions of its
edges modulo right angles, weighted by squared length; edges far from it are left out, and a region where few
are left has none. Successive edges of an arc are merged, best fit first, while their corners are within the
distance of one line along the direction or its normal, at their mean offset (least squares). These lines are
intersected. An arc that breaks the law above is drawn again within half of the distance.
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
from uavseg.regions.smooth.arcs import (
    STEPS_PER_PIXEL,
    Arcs,
    find_crossing,
    join_arcs,
    previous,
    ranges,
    split_arcs,
)
from uavseg.regions.smooth.smooth_outlines import finer_grid

_Points = NDArray[np.complex128]  # x + 1j y
_STAIRS = 1.4  # pixels, and 0.85 of the distance, at most: by which arcs are simplified first
_STRAIGHT = 4.0  # pixels: shorter edges may be stairs, and are no sign of a direction
_NEAR, _SAME = np.cos(4 * np.radians([12, 5]))  # within which edges follow it; adjacent regions share it
_REGULAR = 0.65  # of the length of a region's simplified outline that follows its direction, at least
_LEAST = 0.5  # pixels: the smallest distance that is tried


@dataclass(frozen=True, slots=True)
class _Corners:
    """Corners of arcs on the ground, rotated so that the direction of their arc is along x."""

    points: _Points  # (v,): metres
    fixed: Bools  # (v,): nodes, which are ends of arcs
    arc: Integers  # (v,): the arc of each


@dataclass(frozen=True, slots=True)
class _Runs:
    """Successive stretches of arcs from corner to corner, and a line for each."""

    begin: Integers  # (n,): its first corner
    end: Integers  # (n,): its last, where the next run of the arc begins
    normal: _Points  # (n,): unit normal of the line
    offset: Floats  # (n,): of the line along its normal, in metres
    away: Floats  # (n,): the largest distance of a corner from the line, in metres


def regularise_outlines(rings: Rings, metres: float, geobox: GeoBox) -> tuple[Rings, GeoBox, int]:
    """Draw outlines with right angles where they then stay within a distance of the pixel edges.

    Each arc between nodes (corners where three or more regions meet, and those on the raster's border, which
    stay) stays within `metres` of the arc on pixel edges, and the other way round (Hausdorff distance); these
    are units of the transform where there is no CRS. Borders stay shared, outlines valid, and no region or
    hole vanishes. An arc has the direction of the longer of its regions. It stays on the pixel edges where
    neither has one, as round ones, and single edges do where they would leave the distance.

    Arcs that cross others, or make a region invalid, are drawn again within half of their distance. Below
    half a pixel it becomes 0, and the arc stays on the pixel edges, where it is never wrong; so this ends.

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
    pixel = STEPS_PER_PIXEL * float(step.max())
    arcs, fixed = split_arcs(rings, geobox.shape)
    arc = np.repeat(np.arange(len(arcs.counts)), arcs.counts)
    points: _Points = arcs.corners @ (step * np.array([1j, 1]))
    edges = _simplify(points, arc, min(_STAIRS * pixel, 0.85 * metres))
    turns = _directions(points[edges[1]] - points[edges[0]], arc[edges[0]], arcs.sides, _STRAIGHT * pixel)
    reach = np.where(turns == 0, 0, metres - float(step.max()))
    reach[reach < _LEAST * pixel] = 0
    turns = np.where(turns == 0, 1, turns)
    corners = _Corners(points=points * turns.conj()[arc], fixed=fixed, arc=arc)
    drawn, made = arcs, join_arcs(rings, arcs)
    changed, regular = reach > 0, np.zeros(len(reach), bool)
    while changed.any():
        runs = _merge(corners, edges[:, changed[arc[edges[0]]]], reach)
        path, of = _join(corners, runs, *_intersect(corners, runs, reach))
        path *= turns[of]
        new = np.rint(np.stack([path.imag, path.real], axis=1) / step).astype(np.int64)
        drawn = _replace(drawn, arcs, changed, new, of)
        regular = drawn.starts != arcs.starts
        changed = regular & find_crossing(drawn, changed)
        if not changed.any():
            made = join_arcs(rings, drawn)
            changed = regular & np.isin(arcs.sides, _invalid(rings, made, arcs.sides[regular])).any(axis=1)
        reach[changed] /= 2
        reach[reach < _LEAST * pixel] = 0
    return made, fine, len(np.setdiff1d(rings.labels, arcs.sides[regular]))


def _along(points: _Points, direction: _Points) -> Floats:
    """Return the coordinates of points along unit vectors."""
    return np.asarray((points * direction.conj()).real)


def _simplify(points: _Points, arc: Integers, tolerance: float) -> Integers:
    """Simplify arcs: points, and the arc of each, (v,); return the first and last point of edges, (2, e)."""
    numbered = np.column_stack([points.real, points.imag, np.arange(len(points))])
    lines = shapely.simplify(shapely.linestrings(numbered, indices=arc), tolerance, preserve_topology=False)
    left = shapely.get_coordinates(lines, include_z=True)[:, 2].astype(np.int64)
    return np.stack([left[:-1], left[1:]])[:, arc[left[:-1]] == arc[left[1:]]]


def _directions(edges: _Points, arc: Integers, sides: Integers, straight: float) -> _Points:
    """Return the direction of each arc, (a,): that of the longer of its regions; 0 where neither has one.

    Edges are vectors, (e,), with the arc of each; those shorter than `straight` follow no direction. Means
    are of fourth powers, which are the same for directions that differ by right angles. A region with nearly
    the direction of a longer neighbour takes that one.
    """
    label = sides[arc].T.reshape(-1)
    length = np.tile(np.abs(edges), 2)
    power = (np.tile(edges, 2) / np.maximum(length, 1e-300)) ** 4
    near = np.ones(len(label), bool)
    for _ in range(5):
        weighted = length**2 * power * near
        mean = np.bincount(label, weighted.real) + 1j * np.bincount(label, weighted.imag)
        mean /= np.maximum(np.abs(mean), 1e-300)
        near = _along(power, mean[label]) >= _NEAR
    total = np.bincount(label, length)
    regular = np.bincount(label, length * (near & (length >= straight))) >= _REGULAR * total
    regular[0] = False
    rank = np.lexsort((-np.arange(len(total)), total, regular)).argsort()  # the longest regular one is last
    small, large = np.take_along_axis(sides, np.argsort(rank[sides], axis=1), axis=1).T
    alike = np.flatnonzero(regular[small] & (_along(mean[small], mean[large]) >= _SAME))
    alike = alike[np.argsort(rank[large[alike]])]
    mean[small[alike]] = mean[large[alike]]
    return np.where(regular[large], np.exp(0.25j * np.angle(mean[large])), 0)


def _fit(corners: _Corners, begin: Integers, end: Integers, axis: Integers) -> _Runs:
    """Fit lines to runs: along axis 0 or 1 at the mean offset or through a node; 2 is from end to end."""
    points, counts = corners.points, end - begin
    starts, inner = np.cumsum(counts) - counts, ranges(begin, counts)
    length = np.abs(points[inner + 1] - points[inner])
    centre = np.add.reduceat(length * (points[inner + 1] + points[inner]) / 2, starts)
    centre /= np.add.reduceat(length, starts)
    anchor = np.where(corners.fixed[begin] | (axis == 2), points[begin], centre)
    anchor = np.where(corners.fixed[end], points[end], anchor)
    chord = points[end] - points[begin]
    normal = np.choose(axis, [np.full(len(axis), 1j), 1, 1j * chord / np.maximum(np.abs(chord), 1e-300)])
    offset = _along(anchor, normal)
    away = np.abs(_along(points[inner], normal.repeat(counts)) - offset.repeat(counts))
    away = np.maximum(np.maximum.reduceat(away, starts), np.abs(_along(points[end], normal) - offset))
    return _Runs(begin=begin, end=end, normal=normal, offset=offset, away=away)


def _merge(corners: _Corners, edges: Integers, reach: Floats) -> _Runs:
    """Merge edges, (2, e), into runs whose corners are within reach, (a,) metres, of a line, best fit first.

    Two runs become one if they have one axis, or one of them is no longer than reach. Each pass merges the
    pair that fits best, and others that fit better than those they overlap. Runs become fewer, so this ends.
    """
    points, fixed, near = corners.points, corners.fixed, reach[corners.arc]
    begin, end = edges
    middle = (begin + end) // 2  # of corners that were cut off
    middle = middle[(np.abs(points[end] - points[begin]) <= 2 * near[begin]) & (middle > begin)]
    begin, end = np.sort(np.append(begin, middle)), np.sort(np.append(end, middle))
    chord = points[end] - points[begin]
    axis = (np.abs(chord.real) < np.abs(chord.imag)).astype(np.int64)
    axis[fixed[begin] & fixed[end] | (_fit(corners, begin, end, axis).away > near[begin])] = 2
    while True:
        length = np.abs(points[end] - points[begin])
        new = np.where(length[1:] > length[:-1], axis[1:], axis[:-1])
        short = np.minimum(length[1:], length[:-1]) <= near[begin[1:]]
        may = short | (axis[1:] == axis[:-1]) & (new < 2)
        may &= (begin[1:] == end[:-1]) & ~(fixed[begin[:-1]] & fixed[end[1:]])  # of one arc, not all of it
        pair = np.flatnonzero(may)  # the first run of each
        away = _fit(corners, begin[pair], end[pair + 1], new[pair]).away
        pair, away = (part[away <= near[begin[pair]]] for part in (pair, away))
        if not len(pair):
            return _fit(corners, begin, end, axis)
        rank = np.argsort(np.argsort(away, kind="stable"))
        best = np.full(len(axis), len(pair))
        np.minimum.at(best, np.append(pair, pair + 1), np.tile(rank, 2))
        pair = pair[(best[pair] == rank) & (best[pair + 1] == rank)]
        end[pair] = end[pair + 1]
        axis[pair] = new[pair]
        begin, end, axis = (np.delete(part, pair + 1) for part in (begin, end, axis))


def _intersect(corners: _Corners, runs: _Runs, reach: Floats) -> tuple[_Points, Bools]:
    """Return the ends of the line of each run, (n, 2), and which runs, (n,), keep their corners instead.

    Successive lines end where they meet, if that is within reach, (a,) metres, of the corner between them,
    else at that corner's feet. A run whose line is bad keeps its corners. That changes the lines beside it,
    so all are checked again; there are fewer lines each time, so this ends.
    """
    arc, here = corners.arc[runs.begin], corners.points[runs.begin]
    before, near = previous(arc), reach[arc]
    closed = np.bincount(arc, corners.fixed[runs.begin])[arc] == 0
    kept = (near == 0) | closed & (np.bincount(arc)[arc] < 3)
    normal, normal_before = runs.normal, runs.normal[before]
    to = runs.offset - _along(here, normal)
    to_before = runs.offset[before] - _along(here, normal_before)
    sine = (normal_before.conj() * normal).imag
    meet = 1j * (to * normal_before - to_before * normal) / np.where(np.abs(sine) > 0.1, sine, 1e-300)
    while True:
        met = (np.abs(meet) <= near) & ~kept & ~kept[before]
        enter = np.where(corners.fixed[runs.begin], here, here + np.where(met, meet, to * normal))
        leave = np.empty_like(enter)
        leave[before] = here + np.where(met, meet, to_before * normal_before)
        leave = np.where(corners.fixed[runs.end], corners.points[runs.end], leave)
        wrong = _bad_lines(corners.points, runs, enter, leave, near) & ~kept
        if not wrong.any():
            return np.stack([enter, leave], axis=1), kept
        kept |= wrong


def _bad_lines(points: _Points, runs: _Runs, enter: _Points, leave: _Points, near: Floats) -> Bools:
    """Return the runs, (n,), whose line turns back or is further than `near`, (n,), from a corner."""
    counts = runs.end - runs.begin + 1
    run = np.repeat(np.arange(len(counts)), counts)
    chord, to = leave - enter, points[ranges(runs.begin, counts)] - enter[run]
    share = np.clip(_along(to, chord[run]) / np.maximum(np.abs(chord) ** 2, 1e-300)[run], 0, 1)
    far = np.maximum.reduceat(np.abs(to - share * chord[run]), np.cumsum(counts) - counts)
    return (far > near) | (_along(chord, points[runs.end] - points[runs.begin]) < 0)


def _join(corners: _Corners, runs: _Runs, ends: _Points, kept: Bools) -> tuple[_Points, Integers]:
    """Return the points, (m,), of arcs of which a line is drawn, one after the other, and the arc of each.

    A run has the ends of its line, (n, 2), or all its corners where these are kept, (n,).
    """
    arc = corners.arc[runs.begin]
    counts = np.where(kept, runs.end - runs.begin + 1, 2)
    starts = np.cumsum(counts) - counts
    path = corners.points[ranges(runs.begin, counts)]
    path[starts[~kept, None] + [0, 1]] = ends[~kept]
    closed = ~corners.fixed[runs.begin] & (np.diff(arc, prepend=-1) > 0)  # at the first run of an arc
    after_last = (starts + counts)[previous(arc)[closed]]
    path = np.insert(path, after_last, path[starts[closed]])
    of = np.insert(arc.repeat(counts), after_last, arc[closed])
    drawn = np.bincount(arc, ~kept)[of] > 0
    return path[drawn], of[drawn]


def _replace(drawn: Arcs, arcs: Arcs, changed: Bools, corners: Integers, arc: Integers) -> Arcs:
    """Return drawn arcs with those that changed, (a,), replaced: corners, (m, 2), and the arc of each, (m,).

    Equal successive corners become one. What has less than two then stays on the pixel edges, as in `arcs`.
    """
    distinct = (np.diff(corners, axis=0, prepend=-1) != 0).any(axis=1) | (np.diff(arc, prepend=-1) > 0)
    counts = np.bincount(arc[distinct], minlength=len(changed))
    new = len(drawn.corners) + np.cumsum(counts) - counts
    corners = np.concatenate([drawn.corners, corners[distinct]])
    starts = np.select([counts > 1, changed], [new, arcs.starts], drawn.starts)
    counts = np.select([counts > 1, changed], [counts, arcs.counts], drawn.counts)
    return replace(drawn, corners=corners, starts=starts, counts=counts)


def _invalid(before: Rings, rings: Rings, regions: Integers) -> Integers:
    """Return the regions that overlap, of which a ring turned over, or that are invalid, of those given."""
    polygons = np.asarray(LazyPolygons(rings, Affine.identity()))
    changed = np.isin(np.arange(len(polygons)) + 1, regions)
    wrong = changed.copy()
    wrong[changed] = ~shapely.is_valid(polygons[changed])
    first = shapely.points(rings.vertices[rings.starts[:-1], ::-1])
    holder, held = shapely.STRtree(first).query(polygons, predicate="contains")
    wrong[np.append(holder, rings.labels[held] - 1)] = True
    turned = np.sign(before.pixel_areas()) != np.sign(rings.pixel_areas())
    return np.union1d(np.flatnonzero(wrong) + 1, rings.labels[turned])
