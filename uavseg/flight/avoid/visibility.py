"""Visibility: straight legs that cross no edge of a polygon, and shortest paths in the graph of such legs."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Floats, Integers


class Edges:
    """Edges of the rings of polygons (shapely, in metres), which legs must not cross."""

    def __init__(self, polygons: Any) -> None:
        rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(polygons))]
        pairs = [np.hstack([ring[:-1], ring[1:]]) for ring in rings]
        self._edges = np.ascontiguousarray(np.concatenate([np.empty((0, 4)), *pairs]))
        self._first = np.cumsum([0, *map(len, pairs)], dtype=np.int64)
        boxes = [[*ring.min(axis=0), *ring.max(axis=0)] for ring in rings]
        self._boxes = np.array(boxes, np.float64).reshape(-1, 4)

    def crossed(self, starts: Floats, ends: Floats) -> NDArray[np.bool_]:
        """Return whether the legs between starts and ends, (n, 2) each, cross or touch an edge."""
        crossed = np.zeros(len(starts), np.bool_)
        if len(self._edges):
            legs = np.ascontiguousarray(np.hstack([starts, ends]), np.float64)
            _cross(legs, self._edges, self._first, self._boxes, crossed)
        return crossed


def shortest_paths(weights: Floats) -> tuple[Floats, Integers]:
    """Compute the shortest paths between all nodes of a graph (Floyd and Warshall).

    `weights` (n, n) are lengths of edges, infinite where there is none, 0 on the diagonal. The results are
    the lengths (n, n), and the node before each node (column) on the path from each node (row), (n, n) int64.
    """
    lengths = np.array(weights, np.float64, order="C")
    before = np.repeat(np.arange(len(lengths), dtype=np.int64)[:, None], len(lengths), axis=1)
    _relax(lengths, before)
    return lengths, before


def cheapest(sparse: Floats, matrix: Floats) -> tuple[Floats, Integers]:
    """Return the minimum of ``sparse[i, k] + matrix[k, j]`` over k, and that k (min-plus matrix product).

    `sparse` (n, m) are lengths; where they are infinite, nothing is computed. `matrix` is (m, p), the results
    are (n, p); k is 0 where the length is infinite.
    """
    lengths = np.full((len(sparse), matrix.shape[1]), np.inf)
    through = np.zeros(lengths.shape, np.int64)
    _min_plus(np.ascontiguousarray(sparse), np.ascontiguousarray(matrix), lengths, through)
    return lengths, through


@inlined
def _side(ax, ay, bx, by, x, y):  # type: ignore[no-untyped-def]
    """Return a positive number where (x, y) lies to the left of the line from a to b."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@kernel("void(f8[:,::1], f8[:,::1], i8[::1], f8[:,::1], b1[::1])")
def _cross(legs, edges, first, boxes, crossed):  # type: ignore[no-untyped-def]
    for k in range(legs.shape[0]):
        ax, ay, bx, by = legs[k, 0], legs[k, 1], legs[k, 2], legs[k, 3]
        west, east = min(ax, bx), max(ax, bx)
        south, north = min(ay, by), max(ay, by)
        crosses = False
        for r in range(boxes.shape[0]):
            if boxes[r, 0] > east or boxes[r, 2] < west or boxes[r, 1] > north or boxes[r, 3] < south:
                continue
            sw = _side(ax, ay, bx, by, boxes[r, 0], boxes[r, 1])
            se = _side(ax, ay, bx, by, boxes[r, 2], boxes[r, 1])
            ne = _side(ax, ay, bx, by, boxes[r, 2], boxes[r, 3])
            nw = _side(ax, ay, bx, by, boxes[r, 0], boxes[r, 3])
            if (sw > 0 and se > 0 and ne > 0 and nw > 0) or (sw < 0 and se < 0 and ne < 0 and nw < 0):
                continue
            for e in range(first[r], first[r + 1]):
                cx, cy, dx, dy = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
                if min(cx, dx) > east or max(cx, dx) < west or min(cy, dy) > north or max(cy, dy) < south:
                    continue
                c, d = _side(ax, ay, bx, by, cx, cy), _side(ax, ay, bx, by, dx, dy)
                if (c > 0 and d > 0) or (c < 0 and d < 0):
                    continue
                a, b = _side(cx, cy, dx, dy, ax, ay), _side(cx, cy, dx, dy, bx, by)
                if (a > 0 and b > 0) or (a < 0 and b < 0):
                    continue
                crosses = True
                break
            if crosses:
                break
        crossed[k] = crosses


@kernel("void(f8[:,::1], i8[:,::1])")
def _relax(lengths, before):  # type: ignore[no-untyped-def]
    count = lengths.shape[0]
    for k in range(count):
        for i in range(count):
            through = lengths[i, k]
            if through == np.inf:
                continue
            for j in range(count):
                if through + lengths[k, j] < lengths[i, j]:
                    lengths[i, j] = through + lengths[k, j]
                    before[i, j] = before[k, j]


@kernel("void(f8[:,::1], f8[:,::1], f8[:,::1], i8[:,::1])")
def _min_plus(sparse, matrix, lengths, through):  # type: ignore[no-untyped-def]
    for i in range(sparse.shape[0]):
        for k in range(sparse.shape[1]):
            first = sparse[i, k]
            if first == np.inf:
                continue
            for j in range(matrix.shape[1]):
                if first + matrix[k, j] < lengths[i, j]:
                    lengths[i, j] = first + matrix[k, j]
                    through[i, j] = k
