"""Keep-out zones: areas, with a margin around them, that no leg of a flight enters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.avoid.enclosing import enclosing, merged, neighbour_groups
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Track

Floats = NDArray[np.float64]

LEAST_TOLERANCE_M, MOST_TOLERANCE_M = 0.5, 100.0
LEAST_REACH_M = 2.0  # of outlines around zones of many corners
MOST_OUTLINED = 10_000  # corners of such outlines
LEAST_FENCE_MARGIN_M = 4.0  # below it, the fence is drawn at the edge of zones
FENCE_TOLERANCES = (
    1 / 2,
    2 / 5,
    1 / 4,
    1 / 8,
    0,
)  # of their distance from zones, by which fences are simplified
MOST_CORNERS = 800  # of zones with their margins: they are simplified until they have no more
ROUND_SEGMENTS = 3  # of a quarter of a circle around a corner
SHORTEST_LINE_M = 1.0  # what zones leave of a line is not flown where it is shorter


@dataclass(frozen=True, eq=False)
class KeepOut:
    """Zones that no leg of a flight enters, and a margin around them.

    Parameters
    ----------
    zones : sequence of shapely Polygon or MultiPolygon
        In metres.
    margin_m : float
        Least distance to the zones, 0 or more.

    Examples
    --------
    >>> wall = KeepOut([shapely.box(40, -100, 60, 20)], margin_m=5)
    >>> bool(wall.space.sees(np.array([[0.0, 0.0]]), np.array([[100.0, 0.0]]))[0])
    False
    """

    zones: Sequence[Any] = ()
    margin_m: float = 0.0

    @cached_property
    def _whole(self) -> Any:
        """The zones; of those with many corners an outline around them."""
        parts = np.array([*self.zones, None], object)[:-1]
        groups = neighbour_groups(parts, shapely.bounds(parts))
        zones = merged([shapely.union_all(shapely.make_valid(parts[group])) for group in groups])
        reach_m = max(self.margin_m / 8, LEAST_REACH_M)
        around = enclosing(zones, reach_m)
        while shapely.get_num_coordinates(around) > MOST_OUTLINED and reach_m < MOST_TOLERANCE_M:
            reach_m *= 2
            around = enclosing(zones, reach_m)
        return around

    @cached_property
    def grown(self) -> Any:
        """The zones grown by the margin and a little more, with few corners."""
        if not self.zones:
            return shapely.MultiPolygon()
        tolerance_m = max(self.margin_m / 8, LEAST_TOLERANCE_M)
        held = _held(self._whole, self.margin_m)
        grown = _grown(self._whole, held, self.margin_m, tolerance_m)
        while shapely.get_num_coordinates(grown) > MOST_CORNERS and tolerance_m < MOST_TOLERANCE_M:
            zones = enclosing(self._whole, tolerance_m)
            grown = _smoothed(zones, held, self.margin_m, tolerance_m)
            tolerance_m *= 2
        shapely.prepare(grown)
        return grown

    @cached_property
    def fence_zones(self) -> list[Any]:
        """The zones with at most half of their margin: a flight may pass along it without a breach."""
        return self._fenced(1 / 2)

    @cached_property
    def simpler_fence_zones(self) -> list[Any]:
        """The same with fewer corners, and at most three quarters of their margin."""
        return self._fenced(3 / 4)

    def _fenced(self, share: float) -> list[Any]:
        """Polygons around the zones with few corners and at most a share of their margin."""
        if not self.zones:
            return []
        fenced = [self._whole]
        if self.margin_m >= LEAST_FENCE_MARGIN_M:
            around = shapely.get_parts(shapely.buffer(self._whole, self.margin_m * share / 2))
            fenced = [_simple(part, self._whole, self.margin_m * share) for part in around]
        parts = shapely.get_parts(fenced)
        return [part for part in parts if part.geom_type == "Polygon" and part.area > 0]

    @cached_property
    def space(self) -> FreeSpace:
        """Where legs may lead."""
        return FreeSpace(obstacles=[self.grown] if self.zones else [])

    def left_of(self, region: Any) -> Any:
        """What the zones and their margins leave of a region."""
        if not self.zones or not shapely.intersects(self.grown, region):
            return region
        return shapely.difference(region, self.grown)

    def clear(self, track: Track) -> Track:
        """A track without what enters the zones: lines are cut, and other legs lead around.

        Raises
        ------
        MissionError
            If there is no way between two of its lines, or nothing is left.
        """
        if not self.zones or self.space.sees(track.xy[:-1], track.xy[1:]).all():
            return track
        kept = [piece for first, last in track.line_runs() for piece in self._pieces(track.part(first, last))]
        if not kept:
            raise MissionError("nothing is left of a flight over a region outside of the keep-out zones")
        tracks = kept[:1]
        for before, after in pairwise(kept):
            tracks += [self._way(track, before.xy[-1], after.xy[0]), after]
        return Track.joined(tracks)

    def _pieces(self, lines: Track) -> list[Track]:
        """What is left of a run of lines, in the order in which it is flown."""
        free = self.space.sees(lines.xy[:-1], lines.xy[1:])
        pieces: list[Track] = []
        for k in range(len(free)):
            line = lines.xy[k : k + 2]
            for xy in [line] if free[k] else _outside(line, self.grown):
                piece = lines.leg(k, xy)
                if pieces and (pieces[-1].xy[-1] == xy[0]).all():
                    pieces[-1] = Track.joined([pieces[-1], piece])
                else:
                    pieces.append(piece)
        return pieces

    def _way(self, track: Track, start: Floats, end: Floats) -> Track:
        """The legs of a track between two of its corners where they are free, else the shortest way."""
        first, last = (np.flatnonzero((track.xy == place).all(axis=1)) for place in (start, end))
        for k in first.tolist():
            for m in last.tolist():
                way = track.part(k, m)
                if k < m and not way.is_line.any() and self.space.sees(way.xy[:-1], way.xy[1:]).all():
                    return way
        return Track.transit(self.space.path(start.tolist(), end.tolist()))


def _held(zones: Any, margin_m: float) -> Any:
    """Zones with their whole margin."""
    return shapely.buffer(zones, margin_m / math.cos(math.pi / 32), quad_segs=8) if margin_m else zones


def _grown(zones: Any, held: Any, margin_m: float, tolerance_m: float) -> Any:
    """Zones that are simplified, and grown so that they hold the margin all the same."""
    simple = shapely.simplify(zones, tolerance_m)
    for more in (1, 2, 4):
        reach = (margin_m + more * tolerance_m) / math.cos(math.pi / 4 / ROUND_SEGMENTS)
        grown = shapely.buffer(simple, reach, quad_segs=ROUND_SEGMENTS)
        if shapely.covers(grown, held):
            return grown
    return held


def _smoothed(zones: Any, held: Any, margin_m: float, tolerance_m: float) -> Any:
    """Zones that are grown and then simplified: fewer corners where outlines have many small steps."""
    for more in (1, 1.5, 2, 4):
        grown = shapely.buffer(zones, (margin_m + more * tolerance_m) / math.cos(math.pi / 16), quad_segs=4)
        simple = shapely.simplify(grown, tolerance_m)
        if shapely.covers(simple, held):
            return simple
    return held


def _simple(around: Any, zones: Any, reach_m: float) -> Any:
    """A polygon around some zones with fewer corners, which holds them and lies within a reach of them."""
    inner = shapely.intersection(zones, around)
    outer = shapely.buffer(inner, reach_m)
    for share in FENCE_TOLERANCES:
        simple = shapely.simplify(around, share * reach_m)
        if _lies_between(simple, inner, outer):
            return simple
    return inner


def _lies_between(area: Any, inner: Any, outer: Any) -> bool:
    return bool(shapely.covers(area, inner) and shapely.covers(outer, area))


def _outside(line: Floats, blocked: Any) -> list[Floats]:
    """The parts of a line outside of an area, from its start to its end."""
    left = shapely.get_parts(shapely.difference(shapely.LineString(line), blocked))
    parts = [shapely.get_coordinates(part)[[0, -1]] for part in left if part.length >= SHORTEST_LINE_M]
    return sorted(parts, key=lambda part: float(np.hypot(*(part[0] - line[0]))))
