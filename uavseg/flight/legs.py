"""Straight legs between the pieces of a survey: their lengths, and their lengths outside of the region."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ALONG_EDGE_M = 0.01  # a leg this close to a region is not outside of it


def legs_between(path: Floats) -> Floats:
    """The legs (N - 1, 2, 2) from each end of the pieces (N, 2, 2) of a path to the next start."""
    return np.stack((path[:-1, 1], path[1:, 0]), axis=1)


def lengths_m(legs: Floats) -> Floats:
    """Lengths of legs (N, 2, 2) in metres."""
    lengths: Floats = np.hypot(*(legs[:, 1] - legs[:, 0]).T)
    return lengths


def outside_m(region: Any, legs: Floats) -> Floats:
    """Length of each leg outside of a region, by more than a centimetre, in metres.

    Each leg is split where it crosses an edge; a piece is outside if its middle is.

    Parameters
    ----------
    region : shapely Polygon
    legs : (N, 2, 2) array
        Start and end of each leg, as x, y in metres.

    Examples
    --------
    >>> ring = shapely.box(0, 0, 10, 10) - shapely.box(4, 4, 6, 6)
    >>> outside_m(ring, np.array([[[1.0, 1], [9, 1]], [[1, 5], [9, 5]]])).round(6).tolist()
    [0.0, 1.98]
    """
    buffered = _buffer_region(region)
    leg, part = _crossings(buffered, legs)
    same = leg[1:] == leg[:-1]
    leg, begin, end = leg[:-1][same], part[:-1][same], part[1:][same]
    middles = legs[leg, 0] + ((begin + end) / 2)[:, None] * (legs[leg, 1] - legs[leg, 0])
    outside = ~shapely.contains_xy(buffered.region, middles[:, 0], middles[:, 1])
    pieces_m = (end - begin) * lengths_m(legs)[leg] * outside
    metres: Floats = np.bincount(leg, weights=pieces_m, minlength=len(legs)).astype(np.float64)
    return metres


@dataclass(frozen=True, slots=True)
class _BufferedRegion:
    """A region buffered by a centimetre, and its edges (N, 2, 2) in a spatial index."""

    region: Any
    edges: Floats
    tree: Any


@lru_cache(maxsize=2)
def _buffer_region(region: Any) -> _BufferedRegion:
    region = shapely.buffer(region, ALONG_EDGE_M, join_style="mitre")
    shapely.prepare(region)
    coordinates, ring = shapely.get_coordinates(shapely.get_rings(region), return_index=True)
    same_ring = ring[1:] == ring[:-1]
    edges = np.stack((coordinates[:-1][same_ring], coordinates[1:][same_ring]), axis=1)
    return _BufferedRegion(region, edges, shapely.STRtree(shapely.linestrings(edges)))


def _crossings(buffered: _BufferedRegion, legs: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Crossings of legs with edges: the leg, and the position along it (0 to 1); sorted, with both ends."""
    leg, edge = buffered.tree.query(shapely.linestrings(legs))
    start, along = legs[leg, 0], legs[leg, 1] - legs[leg, 0]
    corner = buffered.edges[edge, 0]
    step = buffered.edges[edge, 1] - corner
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


def leaving_hull(region: Any, legs: Floats, spacing_m: float) -> Floats:
    """Those of the legs (N, 2, 2) that leave the region's convex hull by more than a spacing."""
    allowed = shapely.buffer(shapely.convex_hull(region), spacing_m)
    leaving: Floats = legs[~shapely.covers(allowed, shapely.linestrings(legs))]
    return leaving
