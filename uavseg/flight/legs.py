"""Straight legs between pieces of a survey: how long they are, and where they leave the region."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]

IN_PIECE = (0.5, 0.2, 0.8)  # where in a piece to look
ALONG_EDGE_M = 0.01  # a leg this near to a region is not outside of it


def between(path: Floats) -> Floats:
    """The legs (N - 1, 2, 2) from each end of the pieces (N, 2, 2) of a path to the next start."""
    return np.stack((path[:-1, 1], path[1:, 0]), axis=1)


def lengths_m(legs: Floats) -> Floats:
    """Lengths of legs (N, 2, 2)."""
    lengths: Floats = np.hypot(*(legs[:, 1] - legs[:, 0]).T)
    return lengths


def outside_m(region: Any, legs: Floats) -> Floats:
    """How many metres of each leg lie outside of a region.

    Each leg is cut where it meets an edge; a piece is outside if one of three points in it is.

    Parameters
    ----------
    region : shapely Polygon
    legs : (N, 2, 2) array
        Start and end of each leg, as x, y in metres.

    Examples
    --------
    >>> ring = shapely.box(0, 0, 10, 10) - shapely.box(4, 4, 6, 6)
    >>> outside_m(ring, np.array([[[1.0, 1], [9, 1]], [[1, 5], [9, 5]]])).tolist()
    [0.0, 2.0]
    """
    leg, part = _cuts(region, legs)
    same = leg[1:] == leg[:-1]
    leg, begin, end = leg[:-1][same], part[:-1][same], part[1:][same]
    start, along = legs[leg, 0], legs[leg, 1] - legs[leg, 0]
    outside = np.zeros(len(leg), dtype=bool)
    for place in IN_PIECE:
        points = start + (begin + place * (end - begin))[:, None] * along
        outside[~outside] = _is_outside(region, points[~outside])
    pieces_m = (end - begin) * lengths_m(legs)[leg] * outside
    metres: Floats = np.bincount(leg, weights=pieces_m, minlength=len(legs)).astype(np.float64)
    return metres


def _cuts(region: Any, legs: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Where legs meet edges: the leg, and how far along it (0 to 1); sorted, each from 0 to 1."""
    coordinates, ring = shapely.get_coordinates(shapely.get_rings(region), return_index=True)
    inner = np.flatnonzero(ring[1:] == ring[:-1])
    edges = shapely.STRtree(
        shapely.linestrings(np.stack((coordinates[inner], coordinates[inner + 1]), axis=1))
    )
    leg, edge = edges.query(shapely.linestrings(legs))
    start, along = legs[leg, 0], legs[leg, 1] - legs[leg, 0]
    corner = coordinates[inner[edge]]
    step = coordinates[inner[edge] + 1] - corner
    with np.errstate(divide="ignore", invalid="ignore"):
        part = _cross(corner - start, step) / _cross(along, step)
        on_edge = _cross(corner - start, along) / _cross(along, step)
    met = (part > 0) & (part < 1) & (on_edge >= -1e-9) & (on_edge <= 1 + 1e-9)
    every = np.arange(len(legs))
    leg, part = np.r_[every, leg[met], every], np.r_[0 * every, part[met], 0 * every + 1]
    order = np.lexsort((part, leg))
    return leg[order], part[order]


def _cross(first: Floats, second: Floats) -> Floats:
    product: Floats = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return product


def _is_outside(region: Any, points: Floats) -> NDArray[np.bool_]:
    shapely.prepare(region)
    outside: NDArray[np.bool_] = ~shapely.contains_xy(region, points[:, 0], points[:, 1])
    outside[outside] = ~shapely.dwithin(region, shapely.points(points[outside]), ALONG_EDGE_M)
    return outside


def leaving_hull(region: Any, legs: Floats, spacing_m: float) -> Floats:
    """Those of the legs (N, 2, 2) that leave the region's convex hull by more than a spacing."""
    allowed = shapely.buffer(shapely.convex_hull(region), spacing_m)
    leaving: Floats = legs[~shapely.covers(allowed, shapely.linestrings(legs))]
    return leaving
