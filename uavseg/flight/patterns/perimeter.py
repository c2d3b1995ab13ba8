"""Perimeters: outlines of regions simplified (Douglas-Peucker) to remove the stairs of pixels."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MIN_TOLERANCE_M = 1.0  # below the accuracy of satellite positioning
MIN_STEPS = 12  # with fewer edges, right angles are corners, not stairs
COLLINEAR_M = 1e-3  # corners that deviate less lie on a straight edge
MAX_AREA_CHANGE = 0.1  # share of the area; with a larger change, the right angles were not stairs
RIGHT_ANGLE_TOLERANCE = 0.02  # radians by which reprojection may turn the corners of pixels


def perimeter(region: Any, tolerance_m: float) -> Floats:
    """The outer ring of a region, closed, with as few corners as stay within a tolerance.

    Parameters
    ----------
    region : shapely Polygon
        In metres.
    tolerance_m : float
        No point of the ring is moved farther than this (Douglas-Peucker).

    Returns
    -------
    ring : (N, 2) array
        x, y in metres; the last point is the first one.
    """
    return simplified_ring(shapely.get_coordinates(region.exterior), tolerance_m)


def simplified_ring(closed: Floats, tolerance_m: float) -> Floats:
    """A closed ring (n, 2) with as few corners as stay within a tolerance; see `perimeter`."""
    ring = closed[:-1]
    ring = np.roll(ring, -_farthest(ring, ring.mean(axis=0)), axis=0)
    turn = _farthest(ring, ring[0])
    there = shapely.simplify(shapely.LineString(ring[: turn + 1]), tolerance_m, preserve_topology=False)
    back = shapely.simplify(shapely.LineString([*ring[turn:], ring[0]]), tolerance_m, preserve_topology=False)
    return np.concatenate((shapely.get_coordinates(there), shapely.get_coordinates(back)[1:]))


def _farthest(points: Floats, place: Floats) -> int:
    return int(np.argmax(np.hypot(*(points - place).T)))


def default_tolerance_m(region: Any) -> float:
    """Default tolerance: a metre, or a pixel if the outline follows the edges of larger pixels.

    Examples
    --------
    >>> stairs = shapely.union_all([shapely.box(10 * n, 0, 10 * n + 10, 10 * n + 10) for n in range(30)])
    >>> round(default_tolerance_m(stairs), 6), default_tolerance_m(shapely.box(0, 0, 50, 90))
    (10.0, 1.0)
    """
    corners = shapely.get_coordinates(shapely.simplify(region.exterior, COLLINEAR_M))
    steps = np.diff(corners, axis=0)
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
    """The longer side of a pixel: the shortest edge in each of the two directions."""
    along = np.abs(steps @ steps[0]) / (length * length[0]) > 0.5
    return float(max(length[along].min(), length[~along].min())) if along.any() and not along.all() else 0.0
