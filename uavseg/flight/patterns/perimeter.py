"""Perimeters: outlines at an offset, simplified (Douglas-Peucker), without legs that are too short to fly."""

import heapq
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.flight.avoid.enclosing import MANY_CORNERS
from uavseg.flight.mission.track import leg_lengths
from uavseg.flight.params.plan import MIN_MARGIN_M, PerimeterParams

ARC_SAGITTA_M = 0.05  # of the arcs around corners, before they are simplified
MIN_CORNERS = 3
MIN_TOLERANCE_M = 1.0  # below the accuracy of satellite positioning
MIN_STEPS = 12  # with fewer edges, right angles are corners, not stairs
COLLINEAR_M = 1e-3  # corners that deviate less lie on a straight edge
MAX_AREA_CHANGE = 0.1  # share of the area; with a larger change, the right angles were not stairs
RIGHT_ANGLE_TOLERANCE = 0.02  # radians by which reprojection may turn the corners of pixels


@dataclass(frozen=True, slots=True, eq=False)
class OffsetRings:
    """Rings of one region at a distance from its outline."""

    rings: tuple[Floats, ...]  # closed, (n, 2); the outer ones, and those of holes that are flown
    holes: int  # number of holes that are not flown
    moved_m: float  # distance by which rings were moved for longer legs, where more than the tolerance
    has_short_legs: bool  # whether a ring is too small for legs of the minimum length


def offset_rings(region: Any, params: PerimeterParams, tolerance_m: float, min_leg_m: float) -> OffsetRings:
    """Return the rings at a distance from the outline of a region; none where it is too narrow.

    The region is in metres. No point of a ring is moved farther than `tolerance_m` to save corners, and
    corners are left out until no leg is shorter than `min_leg_m`.
    """
    if abs(params.offset_m) >= MIN_MARGIN_M and shapely.get_num_coordinates(region) > MANY_CORNERS:
        tolerance_m /= 2  # once before, once after
        region = _simplified(region, tolerance_m)
    parts = [part for part in shapely.get_parts(_offset(region, params.offset_m)) if part.area > 0]
    outer = [part.exterior for part in parts]
    holes = _offset_holes(parts, region, params.offset_m)
    flown = [*outer, *holes] if params.holes == "fly" else outer
    rings, moved, short = [], 0.0, False
    for ring in flown:
        exact = shapely.get_coordinates(ring)
        simple = _simplified_ring(exact, tolerance_m)
        kept = long_legs(simple, min_leg_m)
        if len(kept) < len(simple):
            moved = max(moved, _hausdorff(kept, exact), _hausdorff(exact, kept))
        short |= bool(leg_lengths(kept).min() < min_leg_m)
        rings.append(kept)
    return OffsetRings(tuple(rings), 0 if params.holes == "fly" else len(holes), moved, short)


def long_legs(ring: Floats, min_leg_m: float) -> Floats:
    """Drop corners of a closed ring (n, 2) until no leg is shorter than a minimum, down to a triangle.

    Of the two ends of the shortest leg the one is dropped that moves the ring less.

    Examples
    --------
    >>> long_legs(np.array([[0, 0], [9, 0], [9, 1], [9, 9], [0, 0.0]]), 2).tolist()
    [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]]
    """
    corners, count = ring[:-1], len(ring) - 1
    before, after = (np.roll(np.arange(count), by).tolist() for by in (1, -1))
    legs = leg_lengths(ring).tolist()  # of each corner to the next one
    shortest = [(length, k) for k, length in enumerate(legs) if length < min_leg_m]
    heapq.heapify(shortest)
    left = np.ones(count, bool)
    while shortest and count > MIN_CORNERS:
        length, k = heapq.heappop(shortest)
        if not left[k] or length != legs[k]:
            continue  # it is another leg by now
        ends = (k, after[k])
        moved = [_height(corners[before[end]], corners[end], corners[after[end]]) for end in ends]
        out = ends[int(moved[1] <= moved[0])]
        left[out], count = False, count - 1
        after[before[out]], before[after[out]] = after[out], before[out]
        k = before[out]
        legs[k] = float(leg_lengths(corners[[k, after[k]]])[0])
        if legs[k] < min_leg_m:
            heapq.heappush(shortest, (legs[k], k))
    kept = corners[left]
    return kept[[*range(len(kept)), 0]]


def _offset(region: Any, offset_m: float) -> Any:
    if abs(offset_m) < MIN_MARGIN_M:
        return region
    half_turn = np.arccos(max(1 - ARC_SAGITTA_M / abs(offset_m), 0.5))
    return shapely.buffer(region, offset_m, quad_segs=max(int(np.ceil(np.pi / 4 / half_turn)), 2))


def _simplified(region: Any, tolerance_m: float) -> Any:
    exact = map(shapely.get_coordinates, shapely.get_rings(region))
    rings = [_simplified_ring(ring, tolerance_m) for ring in exact]
    outer, *holes = [ring if len(ring) > MIN_CORNERS else None for ring in rings]
    if outer is None:
        return region
    simple = shapely.Polygon(outer, [hole for hole in holes if hole is not None])
    return shapely.make_valid(simple, method="structure", keep_collapsed=False)


def _offset_holes(parts: Sequence[Any], region: Any, offset_m: float) -> list[Any]:
    """Return the holes of an offset, but for tiny ones that GEOS leaves in the middle of some buffers."""
    # Those have no corner at the offset.
    holes = [hole for part in parts for hole in part.interiors]
    if abs(offset_m) < MIN_MARGIN_M or not holes:
        return holes
    outline = region.boundary
    shapely.prepare(outline)
    is_offset = []
    for hole in holes:
        corners = shapely.points(shapely.get_coordinates(hole))
        near = shapely.dwithin(outline, corners, abs(offset_m) + 2 * ARC_SAGITTA_M)
        nearer = shapely.dwithin(outline, corners, max(abs(offset_m) - 2 * ARC_SAGITTA_M, 0))
        is_offset.append(bool((near & ~nearer).any()))
    return [hole for hole, kept in zip(holes, is_offset, strict=True) if kept]


def _hausdorff(ring: Floats, other: Floats) -> float:
    """Return the maximum distance of points along a ring from another one."""
    steps = max(min(50, 100_000 // len(ring)), 2)  # of each edge
    share = np.arange(steps)[:, None, None] / steps
    dense = ((1 - share) * ring[:-1] + share * ring[1:]).reshape(-1, 2)
    edges = shapely.STRtree(shapely.linestrings(np.stack([other[:-1], other[1:]], axis=1)))
    _, distance = edges.query_nearest(shapely.points(dense), return_distance=True, all_matches=False)
    return float(distance.max())


def _height(before: Floats, corner: Floats, after: Floats) -> float:
    return float(shapely.distance(shapely.LineString([before, after]), shapely.Point(corner)))


def perimeter(region: Any, tolerance_m: float) -> Floats:
    """Return the outer ring of a region in metres, (N, 2) and closed, with few corners.

    No point of it is moved farther than `tolerance_m` (Douglas-Peucker).
    """
    return _simplified_ring(shapely.get_coordinates(region.exterior), tolerance_m)


def _simplified_ring(closed: Floats, tolerance_m: float) -> Floats:
    """Return a closed ring (n, 2) with as few corners as stay within a tolerance; see `perimeter`."""
    ring = closed[:-1]
    ring = np.roll(ring, -_farthest(ring, ring.mean(axis=0)), axis=0)
    turn = _farthest(ring, ring[0])
    there = shapely.simplify(shapely.LineString(ring[: turn + 1]), tolerance_m, preserve_topology=False)
    back = shapely.simplify(shapely.LineString([*ring[turn:], ring[0]]), tolerance_m, preserve_topology=False)
    return np.concatenate((shapely.get_coordinates(there), shapely.get_coordinates(back)[1:]))


def _farthest(points: Floats, place: Floats) -> int:
    return int(np.argmax(np.hypot(*(points - place).T)))


def default_tolerance_m(region: Any) -> float:
    """Return the default tolerance: a metre, or a pixel if the outline follows the edges of larger pixels.

    Examples
    --------
    >>> stairs = shapely.union_all([shapely.box(10 * n, 0, 10 * n + 10, 10 * n + 10) for n in range(30)])
    >>> round(default_tolerance_m(stairs), 6), default_tolerance_m(shapely.box(0, 0, 50, 90))
    (10.0, 1.0)
    """
    steps = np.diff(shapely.get_coordinates(shapely.simplify(region.exterior, COLLINEAR_M)), axis=0)
    if len(steps) < MIN_STEPS:
        return MIN_TOLERANCE_M
    before, length = np.roll(steps, 1, axis=0), np.hypot(*steps.T)
    leaning = np.abs((before * steps).sum(axis=1)) / (length * np.roll(length, 1))
    pixel_m = _pixel_m(steps, length) if np.mean(leaning < RIGHT_ANGLE_TOLERANCE) > 0.9 else 0.0
    return pixel_m if pixel_m > MIN_TOLERANCE_M and _keeps_shape(region, pixel_m) else MIN_TOLERANCE_M


def _keeps_shape(region: Any, tolerance_m: float) -> bool:
    outline, ring = shapely.Polygon(region.exterior), perimeter(region, tolerance_m)
    if len(ring) < 4:
        return False
    simple = shapely.make_valid(shapely.Polygon(ring))
    return bool(shapely.symmetric_difference(outline, simple).area < MAX_AREA_CHANGE * outline.area)


def _pixel_m(steps: Floats, length: Floats) -> float:
    """Return the longer side of a pixel: the shortest edge in each of the two directions."""
    along = np.abs(steps @ steps[0]) / (length * length[0]) > 0.5
    return float(max(length[along].min(), length[~along].min())) if along.any() and not along.all() else 0.0
