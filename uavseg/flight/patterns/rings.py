"""Rings at a distance from an outline, without legs that are too short to fly."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.avoid.enclosing import MANY_CORNERS
from uavseg.flight.params.pattern import LEAST_MARGIN_M, PerimeterParams
from uavseg.flight.patterns.perimeter import simplified_ring

Floats = NDArray[np.float64]

ARC_SAGITTA_M = 0.05  # of the arcs around corners, before they are simplified
LEAST_CORNERS = 3


@dataclass(frozen=True, slots=True, eq=False)
class OffsetRings:
    """Rings of one region at a distance from its outline.

    Parameters
    ----------
    rings : tuple of (n, 2) float64 arrays
        Closed; the outer ones, and those of holes that are flown.
    holes : int
        Number of holes that are not flown.
    moved_m : float
        By so much rings were moved beyond the tolerance, for the sake of longer legs.
    has_short_legs : bool
        Whether a ring is too small for legs of the shortest length.
    """

    rings: tuple[Floats, ...]
    holes: int
    moved_m: float
    has_short_legs: bool


def offset_rings(region: Any, params: PerimeterParams, tolerance_m: float, min_leg_m: float) -> OffsetRings:
    """The rings at a distance from the outline of a region; none where it is too narrow.

    Parameters
    ----------
    region : shapely Polygon
        In metres.
    params : PerimeterParams
    tolerance_m : float
        No point of a ring is moved farther than this to save corners.
    min_leg_m : float
        Corners are left out until no leg is shorter.
    """
    if abs(params.offset_m) >= LEAST_MARGIN_M and shapely.get_num_coordinates(region) > MANY_CORNERS:
        tolerance_m /= 2  # once before, once after
        region = _simplified(region, tolerance_m)
    parts = [part for part in shapely.get_parts(_offset(region, params.offset_m)) if part.area > 0]
    outer = [part.exterior for part in parts]
    holes = _offset_holes(parts, region, params.offset_m)
    flown = [*outer, *holes] if params.holes == "fly" else outer
    rings, moved, short = [], 0.0, False
    for ring in flown:
        exact = shapely.get_coordinates(ring)
        simple = simplified_ring(exact, tolerance_m)
        kept = long_legs(simple, min_leg_m)
        if len(kept) < len(simple):
            moved = max(moved, _hausdorff(kept, exact), _hausdorff(exact, kept))
        short |= bool(_legs(kept).min() < min_leg_m)
        rings.append(kept)
    return OffsetRings(tuple(rings), 0 if params.holes == "fly" else len(holes), moved, short)


def long_legs(ring: Floats, min_leg_m: float) -> Floats:
    """A closed ring from which corners are left out until no leg is shorter; at least a triangle is left.

    Of the two ends of the shortest leg the one is left out that moves the ring less.

    Examples
    --------
    >>> long_legs(np.array([[0, 0], [9, 0], [9, 1], [9, 9], [0, 0.0]]), 2).tolist()
    [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]]
    """
    corners, count = ring[:-1], len(ring) - 1
    after = np.roll(np.arange(count), -1).tolist()
    before = np.roll(np.arange(count), 1).tolist()
    legs = _legs(ring).tolist()  # of each corner to the next one
    shortest = [(length, k) for k, length in enumerate(legs) if length < min_leg_m]
    heapq.heapify(shortest)
    left = np.ones(count, bool)
    while shortest and count > LEAST_CORNERS:
        length, k = heapq.heappop(shortest)
        if not left[k] or length != legs[k]:
            continue  # it is another leg by now
        ends = (k, after[k])
        moved = [_height(corners[before[end]], corners[end], corners[after[end]]) for end in ends]
        out = ends[int(moved[1] <= moved[0])]
        left[out], count = False, count - 1
        after[before[out]], before[after[out]] = after[out], before[out]
        k = before[out]
        legs[k] = float(_legs(corners[[k, after[k]]])[0])
        if legs[k] < min_leg_m:
            heapq.heappush(shortest, (legs[k], k))
    kept = corners[left]
    return kept[[*range(len(kept)), 0]]


def _offset(region: Any, offset_m: float) -> Any:
    if abs(offset_m) < LEAST_MARGIN_M:
        return region
    radius = abs(offset_m)
    half_turn = np.arccos(max(1 - ARC_SAGITTA_M / radius, 0.5))
    return shapely.buffer(region, offset_m, quad_segs=max(int(np.ceil(np.pi / 4 / half_turn)), 2))


def _simplified(region: Any, tolerance_m: float) -> Any:
    """A region of which each ring has few corners, as `simplified_ring` leaves them."""
    rings = [
        simplified_ring(shapely.get_coordinates(ring), tolerance_m) for ring in shapely.get_rings(region)
    ]
    outer, *holes = [ring if len(ring) > LEAST_CORNERS else None for ring in rings]
    if outer is None:
        return region
    simple = shapely.Polygon(outer, [hole for hole in holes if hole is not None])
    return shapely.make_valid(simple, method="structure", keep_collapsed=False)


def _offset_holes(parts: Sequence[Any], region: Any, offset_m: float) -> list[Any]:
    """The holes of an offset, but for tiny ones that GEOS leaves in the middle of some buffers.

    They have no corner at the offset.
    """
    holes = [hole for part in parts for hole in part.interiors]
    if abs(offset_m) < LEAST_MARGIN_M or not holes:
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


def _legs(ring: Floats) -> Floats:
    lengths: Floats = np.hypot(*np.diff(ring, axis=0).T)
    return lengths


def _hausdorff(ring: Floats, other: Floats) -> float:
    """How far points along a ring lie from another one at most."""
    steps = max(min(50, 100_000 // len(ring)), 2)  # of each edge
    share = np.arange(steps)[:, None, None] / steps
    dense = ((1 - share) * ring[:-1] + share * ring[1:]).reshape(-1, 2)
    edges = shapely.STRtree(shapely.linestrings(np.stack([other[:-1], other[1:]], axis=1)))
    _, distance = edges.query_nearest(shapely.points(dense), return_distance=True, all_matches=False)
    return float(distance.max())


def _height(before: Floats, corner: Floats, after: Floats) -> float:
    """Distance of a corner from the leg between its neighbours."""
    leg = shapely.LineString([before, after])
    return float(shapely.distance(leg, shapely.Point(corner)))
