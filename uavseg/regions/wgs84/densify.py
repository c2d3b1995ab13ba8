"""Densify edges: straight lines on a map followed in longitude and latitude."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geodesy.globe import densify_rings
from uavseg.regions.ragged import RaggedPolygons

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SAG = 1 / 500  # largest distance of an edge from its true course, in pixels


def densify_edges(
    flat: RaggedPolygons, degrees: Floats, side: float, radius: float, to_degrees: Callable[[Floats], Floats]
) -> RaggedPolygons:
    """Rings in degrees, with vertices added to edges that would deviate if they were straight in degrees.

    Parameters
    ----------
    flat : RaggedPolygons
        Rings in units of the map.
    degrees : (v, 2) float64 array
        Longitudes and latitudes of its vertices.
    side : float
        Side of a pixel in units of the map.
    radius : float
        Of the Earth, in units of the map.
    to_degrees : callable
        From map coordinates to longitudes and latitudes, both (m, 2) arrays.
    """
    xy, starts = flat.vertices, flat.rings
    for _ in range(8):
        pieces = _pieces(xy, degrees, starts, side, radius)
        if pieces.max() == 1:
            break
        xy, starts = densify_rings(xy, starts, pieces)
        degrees = to_degrees(xy)
    return replace(flat, vertices=degrees, rings=starts)


def _pieces(xy: Floats, degrees: Floats, starts: Integers, side: float, radius: float) -> Integers:
    """Number of pieces to split each edge, from a vertex to the next, into."""
    steps = np.append(np.hypot(*np.diff(xy, axis=0).T), 0)
    steps[starts[1:] - 1] = 0
    slope = np.abs(degrees[:, 1])
    if steps.max() <= _straight_enough(slope.max(), side, radius):
        return np.ones(len(xy), np.int64)
    limit = _straight_enough(np.maximum(slope, np.roll(slope, -1)), side, radius)
    pieces: Integers = np.maximum(np.ceil(steps / np.maximum(limit, side / 16)), 1).astype(np.int64)
    return pieces


def _straight_enough(lat: Any, side: float, radius: float) -> Any:
    """Longest edge with a sag of _SAG pixels at a latitude: meridians converge faster towards the poles."""
    curvature = np.maximum(np.tan(np.radians(np.minimum(lat, 89.999999))), 0.3) / radius
    return np.sqrt(8 * _SAG * side / curvature)
