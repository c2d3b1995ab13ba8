"""Rings at a distance from an outline, without legs that are too short to fly."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.patterns.pattern_params import LEAST_MARGIN_M, PerimeterParams
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
    parts = [part for part in shapely.get_parts(_offset(region, params.offset_m)) if part.area > 0]
    outer = [part.exterior for part in parts]
    holes = [hole for part in parts for hole in part.interiors if _is_offset(hole, region, params.offset_m)]
    flown = [*outer, *holes] if params.holes == "fly" else outer
    rings, moved, short = [], 0.0, False
    for ring in flown:
        exact = shapely.get_coordinates(ring)
        simple = simplified_ring(exact, tolerance_m)
        kept = long_legs(simple, min_leg_m)
        if len(kept) < len(simple):
            moved = max(
                moved, float(shapely.hausdorff_distance(shapely.LineString(kept), ring, densify=0.02))
            )
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
    corners = ring[:-1]
    while len(corners) > LEAST_CORNERS:
        legs = _legs(corners[[*range(len(corners)), 0]])
        shortest = int(np.argmin(legs))
        if legs[shortest] >= min_leg_m:
            break
        ends = (shortest, (shortest + 1) % len(corners))
        moved = [_height(corners[k - 1], corners[k], corners[(k + 1) % len(corners)]) for k in ends]
        corners = np.delete(corners, ends[int(moved[1] <= moved[0])], axis=0)
    return corners[[*range(len(corners)), 0]]


def _offset(region: Any, offset_m: float) -> Any:
    if abs(offset_m) < LEAST_MARGIN_M:
        return region
    radius = abs(offset_m)
    half_turn = np.arccos(max(1 - ARC_SAGITTA_M / radius, 0.5))
    return shapely.buffer(region, offset_m, quad_segs=max(int(np.ceil(np.pi / 4 / half_turn)), 2))


def _is_offset(ring: Any, region: Any, offset_m: float) -> bool:
    """Whether a ring has a corner at the offset: GEOS leaves tiny holes in the middle of some buffers."""
    corners = shapely.points(shapely.get_coordinates(ring))
    from_offset = np.abs(shapely.distance(region.boundary, corners) - abs(offset_m))
    return abs(offset_m) < LEAST_MARGIN_M or bool(from_offset.min() <= 2 * ARC_SAGITTA_M)


def _legs(ring: Floats) -> Floats:
    lengths: Floats = np.hypot(*np.diff(ring, axis=0).T)
    return lengths


def _height(before: Floats, corner: Floats, after: Floats) -> float:
    """Distance of a corner from the leg between its neighbours."""
    leg = shapely.LineString([before, after])
    return float(shapely.distance(leg, shapely.Point(corner)))
