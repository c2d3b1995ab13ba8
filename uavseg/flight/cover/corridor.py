"""Corridors: long, thin regions in lines parallel to their medial axis.

The axis is divided where the region needs another number of lines. Areas beside all lines, as at forks, are
covered in straight lines.

J. W. Brandt and V. R. Algazi, Continuous skeleton computation by Voronoi diagram, CVGIP: Image
Understanding 55, 1992: the diagram approaches the medial axis as points become denser. Branches to mere bumps
of the outline are pruned: those that end within the circle around their start.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.lib.stride_tricks import sliding_window_view
from shapely.ops import substring

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.avoid.enclosing import MANY_CORNERS
from uavseg.flight.cover import lines as swaths
from uavseg.flight.cover.lines import MIN_LINE_M, OrderParams, flight_space, grid_lines, path_length
from uavseg.flight.cover.survey import axes

STEPS = 6.0  # points on the outline for each unit of detail
MAX_POINTS = 6000
BUMP = 1.5  # radii of the circle around its start: a branch that is less long shows a bump
GROWN = 0.25  # spacings by which a region is grown before its axis is computed: narrow places do not end it
SMOOTH = 0.03  # spacings by which the axis is simplified
STEP = 0.25  # spacings between places of the axis at which the width is measured
RUN = 8  # places before and after, of which the widest decides about the number of lines
MISSED = 5e-4  # share of a region that lines may miss
THIN = 4.0  # spacings: the mean width of a thin region
LONG = 8.0  # mean widths: the length of a long one
SLENDER = 0.6  # share of its convex hull that a bent one fills
_Section = tuple[Any, int, float]  # part of an axis (LineString), with the number of lines and their spacing


@dataclass(frozen=True, slots=True, eq=False)
class Branch:
    """A branch of a medial axis."""

    xy: Floats  # (n, 2); a loop ends where it starts
    radius_m: Floats  # (n,), distance of each place to the outline
    ends_free: tuple[bool, bool]  # whether its start and its end lie on no other branch


def medial_axis(polygon: Any, detail_m: float) -> list[Branch]:
    """Return the branches of the medial axis of a polygon, without those to bumps; none for a round polygon.

    The polygon is in metres. Parts narrower than `detail_m` may be missed.

    Examples
    --------
    >>> [branch] = medial_axis(shapely.box(0, 0, 100, 10), 5)
    >>> branch.xy.min(axis=0).round().tolist(), branch.xy.max(axis=0).round().tolist()
    ([5.0, 5.0], [95.0, 5.0])
    """
    # the Voronoi edges inside the polygon, (m, 2, 2)
    step = max(detail_m / STEPS, float(shapely.length(polygon)) / MAX_POINTS)
    dense = shapely.get_coordinates(shapely.segmentize(shapely.boundary(polygon), step))
    edges = shapely.voronoi_polygons(shapely.MultiPoint(np.unique(dense, axis=0)), only_edges=True)
    xy, line = shapely.get_coordinates(shapely.get_parts(edges), return_index=True)
    segments = np.stack([xy[:-1], xy[1:]], axis=1)[line[:-1] == line[1:]]
    shapely.prepare(polygon)
    inner: Floats = segments[shapely.contains_properly(polygon, shapely.linestrings(segments))]
    graph = _Graph(inner)
    radius = shapely.distance(shapely.boundary(polygon), shapely.points(graph.places))
    while True:
        bumps = [
            path
            for path in graph.paths()
            if graph.is_twig(path) and graph.length(path) <= BUMP * radius[graph.root(path)] + detail_m
        ]
        if not bumps:
            break
        graph.remove(bumps)
    return [
        Branch(graph.places[path], radius[path], (graph.degree(path[0]) == 1, graph.degree(path[-1]) == 1))
        for path in graph.paths()
    ]


class _Graph:
    """Places and the links between them; a path leads from junction or end to junction or end."""

    def __init__(self, edges: Floats) -> None:
        self.places, index = np.unique(edges.reshape(-1, 2).round(6), axis=0, return_inverse=True)
        self.links: dict[int, set[int]] = {k: set() for k in range(len(self.places))}
        for one, other in index.reshape(-1, 2).tolist():
            if one != other:
                self.links[one].add(other)
                self.links[other].add(one)

    def degree(self, place: int) -> int:
        return len(self.links[place])

    def length(self, path: list[int]) -> float:
        return float(np.hypot(*np.diff(self.places[path], axis=0).T).sum())

    def is_twig(self, path: list[int]) -> bool:
        """Return whether a path ends freely at one side, or at both."""
        return path[0] != path[-1] and 1 in (self.degree(path[0]), self.degree(path[-1]))

    def root(self, path: list[int]) -> int:
        """Return the end of a twig at which it grows from others."""
        return path[0] if self.degree(path[0]) != 1 else path[-1]

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


@dataclass(frozen=True, slots=True, eq=False)
class Corridor:
    """Lines over one region in the order and direction in which they are flown, and the legs between."""

    lines: tuple[Floats, ...]  # n of (k, 2)
    legs: tuple[Floats, ...]  # n - 1 of (k, 2)

    @property
    def length_m(self) -> float:
        """Length of lines and legs in metres."""
        return sum(path_length(path) for path in (*self.lines, *self.legs))

    @property
    def turns(self) -> int:
        """Number of ends of lines and bends of legs."""
        return sum(len(leg) for leg in self.legs)


def is_long_and_thin(region: Any, spacing_m: float) -> bool:
    """Return whether a region in metres is long, thin and bent: a corridor may be shorter than a survey.

    Examples
    --------
    >>> bent = shapely.LineString([(0, 0), (300, 0), (300, 300)]).buffer(10)
    >>> is_long_and_thin(bent, 10), is_long_and_thin(shapely.box(0, 0, 300, 20), 10)
    (True, False)
    """
    width, length = 2 * region.area / region.length, region.length / 2
    bent = region.area < SLENDER * shapely.convex_hull(region).area
    return bool(width <= THIN * spacing_m and length >= LONG * width and bent)


def corridor(region: Any, spacing_m: float, reach_m: float = 0.0, min_m: float = MIN_LINE_M) -> Corridor:
    """Cover a region with lines along its middle, in a short order.

    The region (shapely, in metres) may fork and have holes. `spacing_m` is the largest distance between
    neighbouring lines, `reach_m` how much ground photographs show past the end of a line, `min_m` the length
    of the shortest line. A ParameterError says that the spacing is not a positive number, a MissionError that
    there would be more lines than a mission holds, that there is no path between them, or that the region has
    too many corners.

    Examples
    --------
    >>> bend = shapely.Point(0, 0).buffer(309) - shapely.Point(0, 0).buffer(291)
    >>> [line] = corridor(bend - shapely.box(0, 0, 400, 400), 20).lines
    >>> round(float(np.hypot(*np.diff(line, axis=0).T).sum()), -1)  # three quarters of the circle
    1410.0
    """
    simple, space = flight_space(region, spacing_m)
    if shapely.get_num_coordinates(simple) > MANY_CORNERS:
        raise MissionError(
            f"the middle of a region is looked for that has more than {MANY_CORNERS} corners at a spacing of "
            f"{spacing_m:g} m; give a larger spacing, simplify it (extract --detail or --simplify), or fly a "
            "survey"
        )
    if shapely.get_num_coordinates(region) > MANY_CORNERS:
        region = simple
    body = shapely.simplify(shapely.buffer(simple, GROWN * spacing_m), spacing_m / 40)
    allowed = shapely.buffer(space.inside, 1e-4)
    lines = [
        line
        for part in shapely.get_parts(body)
        for branch in medial_axis(part, spacing_m / 2)
        for section in _sections(branch, region, spacing_m)
        for line in _section_lines(section, region, (reach_m, min_m))
        if shapely.covers(allowed, shapely.LineString(line))
    ]
    covered = [_swath(line, spacing_m, reach_m) for line in lines]
    rest = shapely.difference(region, shapely.union_all(covered))  # as at forks
    lines += _rest_lines(rest, MISSED * region.area, spacing_m, (reach_m, min_m))
    places = np.concatenate([line[[0, -1]] for line in lines])
    orders = [swaths.to_and_fro([k]) for k in range(len(lines))]
    order = swaths.join_cells(orders, places, space, OrderParams())
    flown = [lines[k // 2][:: -1 if k % 2 else 1] for k in order.tolist()]
    ends = np.array([(before[-1], after[0]) for before, after in pairwise(flown)]).reshape(-1, 2, 2)
    between = space.each_path(ends[:, 0], ends[:, 1])
    return Corridor(tuple(flown), tuple(between))


def _sections(branch: Branch, region: Any, spacing_m: float) -> list[_Section]:
    """Divide a branch where the number of lines changes; lengthen its free ends past the region."""
    over_m = spacing_m if np.array_equal(branch.xy[0], branch.xy[-1]) else 0.0
    # even steps; a loop continues past its start
    at = np.r_[0.0, np.cumsum(np.hypot(*np.diff(branch.xy, axis=0).T))]
    places = np.linspace(0, at[-1] + over_m, max(math.ceil((at[-1] + over_m) / (spacing_m * STEP)), 1) + 1)
    places = np.where(places > at[-1], places - at[-1], places)
    xy = np.column_stack([np.interp(places, at, branch.xy[:, k]) for k in (0, 1)])
    inside = shapely.contains_xy(region, *xy.T)
    distance = shapely.distance(shapely.boundary(region), shapely.points(xy))
    radius = np.where(inside, distance, 0.0) + SMOOTH * spacing_m
    around = sliding_window_view(np.pad(radius, RUN, mode="edge"), 2 * RUN + 1)
    count = np.maximum(np.ceil(2 * around.max(axis=1) / spacing_m), 1).astype(int)
    bounds = [0, *(np.flatnonzero(np.diff(count)) + 1).tolist(), len(xy) - 1]
    sections: list[_Section] = []
    for first, last in pairwise(bounds):
        if last > first:
            outer = (first == 0 and branch.ends_free[0], last == len(xy) - 1 and branch.ends_free[1])
            axis = _lengthened(xy[first : last + 1], outer, 2 * float(radius.max()))
            number, width = int(count[first]), 2 * float(radius[first : last + 1].max())
            line = shapely.simplify(shapely.LineString(axis), SMOOTH * spacing_m)
            sections.append((line, number, max(width / number, spacing_m / 2)))
    return sections


def _lengthened(xy: Floats, free: tuple[bool, bool], by_m: float) -> Floats:
    """Lengthen a path straight at its free ends."""
    for side, is_free in enumerate(free):
        if is_free:
            path = xy if side else xy[::-1]
            away = np.hypot(*(path - path[-1]).T)
            step = path[-1] - path[np.flatnonzero(away >= min(by_m / 2, away.max()))[-1]]
            path = np.concatenate([path, [path[-1] + step / np.hypot(*step) * (by_m + 1)]])
            xy = path if side else path[::-1]
    return xy


def _section_lines(section: _Section, region: Any, ends: tuple[float, float]) -> list[Floats]:
    """Return the lines parallel to a section of the axis, each as long as the region in its strip."""
    axis, count, spacing_m = section
    lines = []
    for k in range(count):
        aside = (k - (count - 1) / 2) * spacing_m
        curve = shapely.offset_curve(axis, aside, join_style="mitre", mitre_limit=2)
        for line in shapely.get_parts(curve if aside else axis):
            if line.geom_type == "LineString" and line.length > 0:
                strip = shapely.buffer(line, spacing_m / 2 + 1e-6, cap_style="flat")
                parts = shapely.get_parts(shapely.intersection(strip, region))
                lines += [_trimmed(line, part, *ends) for part in parts if part.area > 0]
    return lines


def _trimmed(line: Any, part: Any, reach_m: float, min_m: float) -> Floats:
    """Return the piece of a line that covers a part of its strip."""
    if len(part.interiors):  # it runs around: no place has one nearest place on the line
        whole: Floats = shapely.get_coordinates(line)
        return whole
    at = shapely.line_locate_point(line, shapely.points(shapely.get_coordinates(part)))
    low, high = float(at.min()), float(at.max())
    crossed = shapely.get_coordinates(shapely.intersection(line, part))
    if len(crossed):
        inside = shapely.line_locate_point(line, shapely.points(crossed))
        low = min(low + reach_m, float(inside.min()))
        high = max(high - reach_m, float(inside.max()))
    elif low + reach_m <= high - reach_m:
        low, high = low + reach_m, high - reach_m
    else:
        low = high = (low + high) / 2
    if high - low < min_m:
        low, high = max((low + high - min_m) / 2, 0.0), min((low + high + min_m) / 2, float(line.length))
    piece = shapely.get_coordinates(substring(line, low, high))
    return piece if len(piece) > 1 else np.repeat(piece, 2, axis=0)


def _swath(line: Floats, spacing_m: float, reach_m: float) -> Any:
    longer = line.copy()
    for end, step in ((0, line[0] - line[1]), (-1, line[-1] - line[-2])):
        if step.any():
            longer[end] += step / np.hypot(*step) * (reach_m + 1e-6)
    return shapely.buffer(shapely.LineString(longer), spacing_m / 2 + 1e-6, cap_style="flat")


def _rest_lines(rest: Any, missed_m2: float, spacing_m: float, ends: tuple[float, float]) -> list[Floats]:
    """Return straight lines over areas that no other line covers, but for the smallest pieces."""
    parts = sorted((part for part in shapely.get_parts(rest) if part.area > 0), key=lambda part: part.area)
    areas = np.cumsum([part.area for part in parts])
    lines: list[Floats] = []
    for part in parts[int(np.searchsorted(areas, missed_m2)) :]:
        sides = np.diff(shapely.get_coordinates(shapely.minimum_rotated_rectangle(part)), axis=0)
        east, north = sides[np.argmax(np.hypot(*sides.T))]
        turn = axes(math.degrees(math.atan2(east, north)))
        turned = shapely.transform(part, lambda xy, turn=turn: xy @ turn)
        for cell in grid_lines(turned, spacing_m, ends, lambda starts, _: np.zeros(len(starts), bool)):
            lines += list(cell @ turn.T)
    return lines
