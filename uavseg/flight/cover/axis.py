"""Medial axis of a polygon: the edges of the Voronoi diagram of points along its outline that lie inside.

J. W. Brandt and V. R. Algazi, Continuous skeleton computation by Voronoi diagram, CVGIP: Image
Understanding 55, 1992: the diagram approaches the medial axis as points become denser. Branches to mere bumps
of the outline are pruned: those that end within the circle around their start.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEPS = 6.0  # points on the outline for each unit of detail
MAX_POINTS = 6000
BUMP = 1.5  # radii of the circle around its start: a branch that is less long shows a bump


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A branch of a medial axis."""

    xy: Floats  # (n, 2); a loop ends where it starts
    radius_m: Floats  # (n,), distance of each place to the outline
    ends_free: tuple[bool, bool]  # whether its start and its end lie on no other branch


def medial_axis(polygon: Any, detail_m: float) -> list[Branch]:
    """Return the branches of the medial axis of a polygon, without those to bumps; none for a round polygon.

    Parameters
    ----------
    polygon : shapely Polygon
        In metres.
    detail_m : float
        Narrower parts may be missed.

    Examples
    --------
    >>> [branch] = medial_axis(shapely.box(0, 0, 100, 10), 5)
    >>> branch.xy.min(axis=0).round().tolist(), branch.xy.max(axis=0).round().tolist()
    ([5.0, 5.0], [95.0, 5.0])
    """
    graph = _Graph.of_edges(_inner_edges(polygon, detail_m))
    radius = shapely.distance(shapely.boundary(polygon), shapely.points(graph.places))
    while True:
        bumps = [
            path
            for path in graph.paths()
            if graph.is_twig(path) and graph.length(path) <= BUMP * radius[_root(graph, path)] + detail_m
        ]
        if not bumps:
            break
        graph.remove(bumps)
    return [
        Branch(graph.places[path], radius[path], (graph.degree(path[0]) == 1, graph.degree(path[-1]) == 1))
        for path in graph.paths()
    ]


def _inner_edges(polygon: Any, detail_m: float) -> Floats:
    """Return the Voronoi edges inside the polygon, (m, 2, 2)."""
    step = max(detail_m / STEPS, float(shapely.length(polygon)) / MAX_POINTS)
    dense = shapely.get_coordinates(shapely.segmentize(shapely.boundary(polygon), step))
    edges = shapely.voronoi_polygons(shapely.MultiPoint(np.unique(dense, axis=0)), only_edges=True)
    lines = shapely.get_parts(edges)
    pairs = [np.stack([xy[:-1], xy[1:]], axis=1) for xy in map(shapely.get_coordinates, lines)]
    segments = np.concatenate(pairs)
    shapely.prepare(polygon)
    inner: Floats = segments[shapely.contains_properly(polygon, shapely.linestrings(segments))]
    return inner


class _Graph:
    """Places and the links between them; a path leads from junction or end to junction or end."""

    def __init__(self, places: Floats, links: dict[int, set[int]]) -> None:
        self.places, self.links = places, links

    @classmethod
    def of_edges(cls, edges: Floats) -> "_Graph":
        places, index = np.unique(edges.reshape(-1, 2).round(6), axis=0, return_inverse=True)
        links: dict[int, set[int]] = {k: set() for k in range(len(places))}
        for one, other in index.reshape(-1, 2).tolist():
            if one != other:
                links[one].add(other)
                links[other].add(one)
        return cls(places, links)

    def degree(self, place: int) -> int:
        return len(self.links[place])

    def length(self, path: list[int]) -> float:
        return float(np.hypot(*np.diff(self.places[path], axis=0).T).sum())

    def is_twig(self, path: list[int]) -> bool:
        """Return whether a path ends freely at one side, or at both."""
        return path[0] != path[-1] and 1 in (self.degree(path[0]), self.degree(path[-1]))

    def paths(self) -> Iterator[list[int]]:
        """Yield all paths, each once, in an order that depends on the places only."""
        used: set[tuple[int, int]] = set()
        nodes = [place for place in self.links if self.degree(place) not in (0, 2)]
        rest = [place for place in self.links if self.degree(place) == 2]  # for loops
        for start in [*nodes, *rest]:
            for following in sorted(self.links[start]):
                if (start, following) not in used:
                    if start in rest and used & {(start, other) for other in self.links[start]}:
                        continue
                    path = self._walk(start, following)
                    used |= set(pairwise(path)) | set(pairwise(path[::-1]))
                    yield path

    def remove(self, paths: list[list[int]]) -> None:
        for path in paths:
            for one, other in pairwise(path):
                self.links[one].discard(other)
                self.links[other].discard(one)

    def _walk(self, start: int, following: int) -> list[int]:
        path = [start, following]
        while self.degree(path[-1]) == 2 and path[-1] != start:
            (onward,) = self.links[path[-1]] - {path[-2]}
            path.append(onward)
        return path


def _root(graph: _Graph, path: list[int]) -> int:
    """Return the end of a twig at which it grows from others."""
    return path[0] if graph.degree(path[0]) != 1 else path[-1]
