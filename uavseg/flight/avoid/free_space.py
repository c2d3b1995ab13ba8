"""Free space of a flight, and shortest paths in it (visibility graph).

A shortest path among polygons is a chain of straight legs that bend at corners which point into free space
(T. Lozano-Perez and M. A. Wesley, An algorithm for planning collision-free paths among polyhedral obstacles,
Communications of the ACM 22, 1979). So the corners are the nodes of a graph whose edges are the legs in free
space. Shortest paths between all corners are computed once.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError

TOUCH_M = 1e-4  # legs may run along the edge of free space: that close to it, they are in it
MAX_POINTS = 8001  # both ends of as many regions as are ordered, and home; paths of more take gigabytes
MAX_PAIRS = 20_000  # of points, between which legs are checked together
AT_ONCE = 16  # paths that are computed together
MAX_CORNERS = 1200  # a graph of their pairs takes seconds


class Edges:
    """Edges of the rings of polygons (shapely, in metres), which legs must not cross."""

    def __init__(self, polygons: Any) -> None:
        rings = shapely.get_rings(shapely.get_parts(polygons))
        pairs = [np.hstack([xy[:-1], xy[1:]]) for xy in map(shapely.get_coordinates, rings)]
        self._edges = np.ascontiguousarray(np.concatenate([np.empty((0, 4)), *pairs]))
        self._first = np.cumsum([0, *map(len, pairs)], dtype=np.int64)
        self._boxes = shapely.bounds(rings)

    def crossed(self, starts: Floats, ends: Floats) -> Bools:
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


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """The plane without obstacles, or the inside of a polygon.

    Examples
    --------
    >>> wall = FreeSpace(obstacles=[shapely.box(4, -10, 6, 2)])
    >>> wall.path((0.0, 0.0), (10.0, 0.0)).tolist()
    [[0.0, 0.0], [4.0, 2.0], [6.0, 2.0], [10.0, 0.0]]
    """

    inside: Any = None  # shapely, in metres; by default the whole plane
    obstacles: Sequence[Any] = ()  # shapely Polygons in metres; their edges are free

    def is_free(self, points: Floats) -> Bools:
        """Return whether points (n, 2) lie in free space or on its edge."""
        places = shapely.points(points)
        free: Bools = ~shapely.intersects(self._closed, places)
        if self._open is not None:
            free &= shapely.covers(self._open, places)
        return free

    def sees(self, starts: Floats, ends: Floats) -> Bools:
        """Return whether the straight legs between starts and ends, (n, 2) each, stay in free space."""
        free: Bools = self.is_free(starts) & self.is_free(ends)
        return free & ~self._edges.crossed(starts, ends)

    def path(self, start: Sequence[float], end: Sequence[float]) -> Floats:
        """Return the shortest path between two points, both included, (k, 2); MissionError if none."""
        return self.paths(np.array([start, end], np.float64)).path(0, 1)

    def each_path(self, starts: Floats, ends: Floats) -> list[Floats]:
        """Return the shortest path between each start and its end, (n, 2) each; see `path`."""
        paths: list[Floats] = list(np.stack([starts, ends], axis=1))
        bent = np.flatnonzero(~self.sees(starts, ends)).tolist()
        for some in (bent[k : k + AT_ONCE] for k in range(0, len(bent), AT_ONCE)):
            found = self.paths(np.concatenate([starts[some], ends[some]]))
            for k, leg in enumerate(some):
                paths[leg] = found.path(k, k + len(some))
        return paths

    def paths(self, points: Floats) -> "ShortestPaths":
        """Compute shortest paths between points (n, 2); MissionError for too many points or corners."""
        if len(points) > MAX_POINTS:
            raise MissionError(
                f"ways between {len(points)} ends of lines would be compared, at most {MAX_POINTS} are; "
                "choose fewer or simpler regions, or a larger spacing"
            )
        free = self.is_free(points)
        direct = self._among(points, free)
        if np.isfinite(direct).all():
            return ShortestPaths(points, direct, direct)
        reach = self._to_corners(points, free)
        between, before = self._between_corners
        onward, first = cheapest(reach, between)
        over, last = cheapest(reach, onward.T)
        detours = Detours(corners=self.corners, lengths=over, first=first, last=last, before=before)
        lengths = np.minimum(direct, np.minimum(over, over.T))
        return ShortestPaths(points=points, lengths=lengths, direct=direct, detours=detours)

    def lengths_from(self, start: Floats, points: Floats) -> Floats:
        """Return the lengths (n,) of the shortest paths from a point (2,) to others (n, 2), or infinity."""
        starts = np.broadcast_to(start, points.shape)
        direct = np.where(self.sees(starts, points), _distances(starts, points), np.inf)
        if np.isfinite(direct).all():
            return direct
        ends = np.concatenate([start[None], points])
        reach = self._to_corners(ends, self.is_free(ends))
        onward, _ = cheapest(reach[:1], self._between_corners[0])
        over, _ = cheapest(reach[1:], onward.T)
        return np.minimum(direct, over[:, 0])

    @cached_property
    def corners(self) -> Floats:
        """The corners (c, 2) that point into free space, where shortest paths may bend."""
        corners = np.unique(np.concatenate([np.empty((0, 2)), *map(_bends, self._rings())]), axis=0)
        corners = corners[self.is_free(corners)]
        if len(corners) > MAX_CORNERS:
            raise MissionError(
                f"the areas to fly in or around have {len(corners)} corners, more than {MAX_CORNERS}; "
                "simplify them (extract --detail or --simplify), or give a larger spacing or margin"
            )
        return corners

    @cached_property
    def _between_corners(self) -> tuple[Floats, Integers]:
        """Shortest paths between corners."""
        return shortest_paths(self._among(self.corners, np.ones(len(self.corners), bool)))

    def _among(self, points: Floats, free: Bools) -> Floats:
        """Return the lengths of the straight legs between points; infinite where they are not free."""
        lengths = np.full((len(points), len(points)), np.inf)
        inside = np.flatnonzero(free)
        rows = max(MAX_PAIRS // max(len(inside), 1), 1)  # all pairs at once take gigabytes
        for first in range(0, len(inside), rows):
            here, there = np.triu_indices(min(rows, len(inside) - first), 1, len(inside) - first)
            here, there = inside[first + here], inside[first + there]
            seen = ~self._edges.crossed(points[here], points[there])
            here, there = here[seen], there[seen]
            lengths[here, there] = lengths[there, here] = _distances(points[here], points[there])
        np.fill_diagonal(lengths, 0)
        return lengths

    def _to_corners(self, points: Floats, free: Bools) -> Floats:
        """Return the lengths (n, c) of straight legs from points to corners; infinite where not free."""
        here, there = (side.ravel() for side in np.indices((len(points), len(self.corners))))
        here, there = here[free[here]], there[free[here]]
        seen = ~self._edges.crossed(points[here], self.corners[there])
        lengths = np.full((len(points), len(self.corners)), np.inf)
        lengths[here[seen], there[seen]] = _distances(points[here[seen]], self.corners[there[seen]])
        return lengths

    def _rings(self) -> list[Floats]:
        """Return the rings with free space on their left."""
        inside = [] if self.inside is None else _rings(self.inside)
        return [*inside, *(ring[::-1] for ring in _rings(self._blocked))]

    @cached_property
    def _blocked(self) -> Any:
        return shapely.union_all(list(self.obstacles)) if self.obstacles else shapely.MultiPolygon()

    @cached_property
    def _open(self) -> Any:
        """The inside with its edge, prepared for many queries."""
        if self.inside is None:
            return None
        inside = shapely.buffer(self.inside, TOUCH_M, join_style="mitre")
        shapely.prepare(inside)
        return inside

    @cached_property
    def _closed(self) -> Any:
        """The obstacles without their edges, prepared for many queries."""
        blocked = shapely.buffer(self._blocked, -TOUCH_M, join_style="mitre")
        shapely.prepare(blocked)
        return blocked

    @cached_property
    def _edges(self) -> Edges:
        parts = [self._closed] if self._open is None else [self._closed, self._open]
        return Edges(np.concatenate([shapely.get_parts(part) for part in parts]))


@dataclass(frozen=True, eq=False)
class Detours:
    """Paths between points that bend at corners."""

    corners: Floats  # (c, 2)
    lengths: Floats  # (n, n), metres between points; infinite where there is no path
    first: Integers  # (n, c), the first corner of the path from each point to each corner
    last: Integers  # (n, n), the last corner of the path to each point (row) from each (column)
    before: Integers  # (c, c), the corner before each corner (column) on the path from each corner (row)

    def bends(self, start: int, end: int) -> Floats:
        """Return the corners on the path from one point to another."""
        steps = [int(self.last[end, start])]
        first = int(self.first[start, steps[0]])
        while steps[-1] != first:
            steps.append(int(self.before[first, steps[-1]]))
        return self.corners[steps[::-1]]


@dataclass(frozen=True, eq=False)
class ShortestPaths:
    """Shortest paths between points."""

    points: Floats  # (n, 2)
    lengths: Floats  # (n, n), metres between points; infinite where there is no path
    direct: Floats  # (n, n), metres along the straight leg; infinite where it is not free
    detours: Detours | None = None  # without them, all paths are straight

    def path(self, start: int, end: int) -> Floats:
        """Return the path from one point to another, both included: (k, 2); MissionError if there is none."""
        if not np.isfinite(self.lengths[start, end]):
            raise MissionError("there is no way between two places that must be flown to")
        ends = self.points[[start, end]]
        if self.detours is None or self.direct[start, end] <= self.lengths[start, end]:
            return ends
        if self.detours.lengths[end, start] > self.detours.lengths[start, end]:
            return self.path(end, start)[::-1]
        return np.concatenate([ends[:1], self.detours.bends(start, end), ends[1:]])


def _rings(polygons: Any) -> list[Floats]:
    """Return the rings of polygons with the inside to the left."""
    rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(polygons)))
    return [shapely.get_coordinates(ring) for ring in rings]


def _bends(ring: Floats) -> Floats:
    """Return the corners of a closed ring at which it turns right: the left side is free around them."""
    points = ring[:-1]
    into, out = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    return points[into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0]


def _distances(starts: Floats, ends: Floats) -> Floats:
    steps = ends - starts
    return np.hypot(steps[:, 0], steps[:, 1])
