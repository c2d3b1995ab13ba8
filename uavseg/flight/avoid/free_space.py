"""Free space of a flight, and shortest paths in it (visibility graph).

A shortest path among polygons is a chain of straight legs that bend at corners which point into free space
(T. Lozano-Perez and M. A. Wesley, An algorithm for planning collision-free paths among polyhedral obstacles,
Communications of the ACM 22, 1979). So the corners are the nodes of a graph whose edges are the legs that
stay in free space, and Dijkstra's algorithm finds the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOUCH_M = 1e-4
"""Legs may run along the edge of free space: that close to it, they are in it."""
MAX_CORNERS = 1200  # a graph of their pairs takes seconds


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """The plane without obstacles, or the inside of a polygon.

    Parameters
    ----------
    inside : shapely Polygon or MultiPolygon, optional
        In metres; by default the whole plane.
    obstacles : sequence of shapely Polygon
        In metres; their edges are free.

    Examples
    --------
    >>> wall = FreeSpace(obstacles=[shapely.box(4, -10, 6, 2)])
    >>> wall.path((0.0, 0.0), (10.0, 0.0)).tolist()
    [[0.0, 0.0], [4.0, 2.0], [6.0, 2.0], [10.0, 0.0]]
    """

    inside: Any = None
    obstacles: Sequence[Any] = ()

    def is_free(self, points: Floats) -> NDArray[np.bool_]:
        """Whether points (n, 2) lie in free space or on its edge."""
        free: NDArray[np.bool_] = self._covers(shapely.points(points))
        return free

    def sees(self, starts: Floats, ends: Floats) -> NDArray[np.bool_]:
        """Whether the straight legs between starts and ends, (n, 2) each, stay in free space."""
        legs = shapely.linestrings(np.stack([starts, ends], axis=1))
        free: NDArray[np.bool_] = self._covers(legs)
        return free

    def path(self, start: Sequence[float], end: Sequence[float]) -> Floats:
        """The shortest path between two points, both included: (k, 2).

        Raises
        ------
        MissionError
            If there is none.
        """
        found = self.paths(np.array([start, end], np.float64))
        return found.path(0, 1)

    def paths(self, points: Floats) -> "ShortestPaths":
        """Shortest paths between any two of some points (n, 2).

        Raises
        ------
        MissionError
            If free space has too many corners.
        """
        here, there = np.triu_indices(len(points), 1)
        seen = self.sees(points[here], points[there]) if len(here) else np.zeros(0, bool)
        if seen.all():
            return ShortestPaths(points, _lengths(points, points))
        corners = self.corners
        nodes = np.concatenate([points, corners])
        weights = np.full((len(nodes), len(nodes)), np.inf)
        _link(weights, nodes, here[seen], there[seen])
        n = len(points)
        weights[n:, n:] = self._corner_weights
        for k in range(n):
            seen = self.sees(np.broadcast_to(points[k], corners.shape), corners)
            _link(weights, nodes, np.full(int(seen.sum()), k), n + np.flatnonzero(seen))
        np.fill_diagonal(weights, 0)
        lengths, before = _dijkstra(weights, n)
        return ShortestPaths(nodes, lengths[:, :n], before)

    @cached_property
    def corners(self) -> Floats:
        """The corners (c, 2) that point into free space, where shortest paths may bend."""
        bends = [_bends(ring) for ring in self._rings()]
        corners = np.unique(np.concatenate([np.empty((0, 2)), *bends]), axis=0)
        corners = corners[self.is_free(corners)]
        if len(corners) > MAX_CORNERS:
            raise MissionError(
                f"the areas to fly around have {len(corners)} corners, more than {MAX_CORNERS}; "
                "simplify them, or give a larger margin"
            )
        return corners

    @cached_property
    def _corner_weights(self) -> Floats:
        corners = self.corners
        weights = np.full((len(corners), len(corners)), np.inf)
        here, there = np.triu_indices(len(corners), 1)
        seen = self.sees(corners[here], corners[there]) if len(here) else np.zeros(0, bool)
        _link(weights, corners, here[seen], there[seen])
        return weights

    def _rings(self) -> list[Floats]:
        """Rings with free space on their left."""
        inside = [] if self.inside is None else _rings(self.inside)
        return [*inside, *(ring[::-1] for ring in _rings(self._blocked))]

    @cached_property
    def _blocked(self) -> Any:
        return shapely.union_all(list(self.obstacles)) if self.obstacles else shapely.MultiPolygon()

    @cached_property
    def _tests(self) -> tuple[Any, Any]:
        """The inside with its edge, and the obstacles without theirs, ready for many questions."""
        inside = None if self.inside is None else shapely.buffer(self.inside, TOUCH_M, join_style="mitre")
        blocked = shapely.buffer(self._blocked, -TOUCH_M, join_style="mitre")
        shapely.prepare([geometry for geometry in (inside, blocked) if geometry is not None])
        return inside, blocked

    def _covers(self, geometries: Any) -> NDArray[np.bool_]:
        inside, blocked = self._tests
        free: NDArray[np.bool_] = ~shapely.intersects(blocked, geometries)
        if inside is not None:
            free &= shapely.covers(inside, geometries)
        return free


@dataclass(frozen=True, eq=False)
class ShortestPaths:
    """Shortest paths between points, the first of some nodes.

    Parameters
    ----------
    nodes : (m, 2) float64 array
        The points, then corners.
    lengths : (n, n) float64 array
        Metres between points; infinite where there is no path.
    before : (n, m) int64 array, optional
        The node before each node on the shortest path from each point; without, all paths are straight.
    """

    nodes: Floats
    lengths: Floats
    before: Ints | None = None

    def path(self, start: int, end: int) -> Floats:
        """The path from one point to another, both included: (k, 2).

        Raises
        ------
        MissionError
            If there is none.
        """
        if not np.isfinite(self.lengths[start, end]):
            raise MissionError("there is no way between two places that must be flown to")
        if self.before is None or start == end:
            return self.nodes[[start, end]]
        steps = [end]
        while steps[-1] != start:
            steps.append(int(self.before[start, steps[-1]]))
        return self.nodes[steps[::-1]]


def _rings(polygons: Any) -> list[Floats]:
    """Rings of polygons: their inside lies to the left."""
    rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(polygons)))
    return [shapely.get_coordinates(ring) for ring in rings]


def _bends(ring: Floats) -> Floats:
    """The corners of a closed ring at which it turns right, so that the left side is free around them."""
    points = ring[:-1]
    into, out = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turn = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
    bends: Floats = points[turn < 0]
    return bends


def _lengths(starts: Floats, ends: Floats) -> Floats:
    """Distances (n, m) between points (n, 2) and (m, 2)."""
    steps = starts[:, None] - ends[None]
    lengths: Floats = np.hypot(steps[..., 0], steps[..., 1])
    return lengths


def _link(weights: Floats, nodes: Floats, here: Ints, there: Ints) -> None:
    steps = nodes[here] - nodes[there]
    weights[here, there] = weights[there, here] = np.hypot(steps[:, 0], steps[:, 1])


def _dijkstra(weights: Floats, count: int) -> tuple[Floats, Ints]:
    """Lengths of shortest paths from the first nodes to all, and the node before each (Dijkstra, dense)."""
    lengths = np.full((count, len(weights)), np.inf)
    before = np.zeros((count, len(weights)), np.int64)
    sources = np.arange(count)
    lengths[sources, sources] = 0
    open_ = np.ones((count, len(weights)), bool)
    for _ in range(len(weights)):
        nearest = np.where(open_, lengths, np.inf).argmin(axis=1)
        open_[sources, nearest] = False
        through = lengths[sources, nearest][:, None] + weights[nearest]
        shorter = through < lengths
        lengths = np.where(shorter, through, lengths)
        before = np.where(shorter, nearest[:, None], before)
    return lengths, before
