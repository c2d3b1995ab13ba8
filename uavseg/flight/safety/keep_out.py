"""Keep-out zones: areas, with a margin around them, that no leg of a flight enters."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.execution.executors import steps_done
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing, filled_parts, merged, neighbour_groups
from uavseg.flight.avoid.free_space import FreeSpace
from uavseg.flight.mission.track import Plane, Track, leg_lengths, plane_around
from uavseg.flight.mission.vehicle import returning_vehicles
from uavseg.flight.params.plan import PlanParams

MIN_TOLERANCE_M, MAX_TOLERANCE_M = 0.5, 100.0
MIN_REACH_M = 2.0  # of outlines around zones of many corners
MAX_OUTLINE_CORNERS = 10_000  # corners of such outlines
MIN_FENCE_MARGIN_M = 4.0  # below it, the fence is drawn at the edge of zones
FENCE_TOLERANCES = (0.5, 0.4, 0.25, 0.125, 0.0)  # for fences, in their distance from zones
MAX_CORNERS = 800  # of zones with their margins: they are simplified until they have no more
ROUND_SEGMENTS = 3  # of a quarter of a circle around a corner
MIN_LINE_M = 1.0  # what zones leave of a line is not flown where it is shorter
STEP_M = 5.0
STARTS = 2000  # maximum number of places from which returns are examined
NAMES = {"ardupilot": ("ArduPilot", "RTL_ALT"), "px4": ("PX4", "RTL_RETURN_ALT")}
NAMES["generic"] = "the autopilot", "RTL_ALT, RTL_RETURN_ALT"
IsGround = Callable[[float, float], bool]

CLEARANCE_M = 15.0  # from home to regions and to zones with their margin
SIMPLIFIED_M = 0.75  # tolerance for outlines of many corners; GEOS moves the ends of rings by up to twice it
HOME_STEP_M = 5.0
HOME_GAP_M = 1.0  # from zones with their margin to a place that is named instead of a home in them
MAX_TRIES = 5000
_DECIMALS = 7  # of degrees: a centimetre


@dataclass(frozen=True, eq=False)
class KeepOut:
    """Zones that no leg of a flight enters, and a margin around them.

    Examples
    --------
    >>> wall = KeepOut([shapely.box(40, -100, 60, 20)], margin_m=5)
    >>> bool(wall.space.sees(np.array([[0.0, 0.0]]), np.array([[100.0, 0.0]]))[0])
    False
    """

    zones: Sequence[Any] = ()  # shapely, in metres
    margin_m: float = 0.0  # minimum distance of legs to the zones
    deviation_m: float = 0.0  # of it, by which the vehicle may leave its legs

    @cached_property
    def _merged(self) -> Any:
        """Zones, or where these have many corners an outline around them."""
        parts = np.array([*self.zones, None], object)[:-1]
        groups = neighbour_groups(parts, shapely.bounds(parts))
        zones = merged([shapely.union_all(shapely.make_valid(parts[group])) for group in groups])
        reach_m = max(self.margin_m / 8, MIN_REACH_M)
        around = enclosing(zones, reach_m)
        while shapely.get_num_coordinates(around) > MAX_OUTLINE_CORNERS and reach_m < MAX_TOLERANCE_M:
            reach_m *= 2
            around = enclosing(zones, reach_m)
        return around

    @cached_property
    def grown(self) -> Any:
        """Zones grown by the margin and a little more, with few corners."""
        if not self.zones:
            return shapely.MultiPolygon()
        tolerance_m = max(self.margin_m / 8, MIN_TOLERANCE_M)
        required = self._merged
        if self.margin_m:
            required = shapely.buffer(required, self.margin_m / math.cos(math.pi / 32), quad_segs=8)
        grown = _grown(self._merged, required, self.margin_m, tolerance_m)
        while shapely.get_num_coordinates(grown) > MAX_CORNERS and tolerance_m < MAX_TOLERANCE_M:
            grown = _smoothed(enclosing(self._merged, tolerance_m), required, self.margin_m, tolerance_m)
            tolerance_m *= 2
        shapely.prepare(grown)
        return grown

    @cached_property
    def fence_zones(self) -> list[Any]:
        """Zones with at most half of their margin: a flight may pass along it without a breach."""
        return self._fenced(1 / 2)

    @cached_property
    def simpler_fence_zones(self) -> list[Any]:
        """Zones with fewer corners, and at most three quarters of their margin."""
        return self._fenced(3 / 4)

    def _fenced(self, share: float) -> list[Any]:
        """Draw polygons around the zones with few corners and at most a share of their margin."""
        if not self.zones:
            return []
        fenced, margin_m = [self._merged], self.margin_m - self.deviation_m
        if margin_m >= MIN_FENCE_MARGIN_M:
            around = shapely.get_parts(shapely.buffer(self._merged, margin_m * share / 2))
            fenced = [_simple(part, self._merged, margin_m * share) for part in around]
        return [part for part in shapely.get_parts(fenced) if part.geom_type == "Polygon" and part.area > 0]

    @cached_property
    def space(self) -> FreeSpace:
        """Free space for legs."""
        return FreeSpace(obstacles=[self.grown] if self.zones else [])

    def left_of(self, region: Any) -> Any:
        """Subtract the zones and their margins from a region."""
        if not self.zones or not shapely.intersects(self.grown, region):
            return region
        return shapely.difference(region, self.grown)

    def clear(self, track: Track) -> Track:
        """Clip the lines of a track outside of the zones, and lead other legs around them.

        A MissionError says that there is no path between two of its lines, or that nothing is left.
        """
        if not self.zones or self.space.sees(track.xy[:-1], track.xy[1:]).all():
            return track
        kept = [piece for first, last in track.line_runs() for piece in self._pieces(track.part(first, last))]
        if not kept:
            raise MissionError("nothing is left of a flight over a region outside of the keep-out zones")
        tracks = kept[:1]
        for before, after in pairwise(kept):
            tracks += [self._connection(track, before.xy[-1], after.xy[0]), after]
        return Track.joined(tracks)

    def _pieces(self, lines: Track) -> list[Track]:
        """Clip a run of lines; pieces are in the order in which they are flown."""
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

    def _connection(self, track: Track, start: Floats, end: Floats) -> Track:
        """Return the legs of a track between two corners where they are free, else the shortest path."""
        first, last = (np.flatnonzero((track.xy == place).all(axis=1)) for place in (start, end))
        for k in first.tolist():
            for m in last.tolist():
                legs = track.part(k, m)
                if k < m and not legs.is_line.any() and self.space.sees(legs.xy[:-1], legs.xy[1:]).all():
                    return legs
        return Track.transit(self.space.path(start.tolist(), end.tolist()))


def _grown(zones: Any, required: Any, margin_m: float, tolerance_m: float) -> Any:
    """Simplify zones, and grow them so that they hold the margin all the same."""
    simple = shapely.simplify(zones, tolerance_m)
    for more in (1, 2, 4):
        reach = (margin_m + more * tolerance_m) / math.cos(math.pi / 4 / ROUND_SEGMENTS)
        grown = shapely.buffer(simple, reach, quad_segs=ROUND_SEGMENTS)
        if shapely.covers(grown, required):
            return grown
    return required


def _smoothed(zones: Any, required: Any, margin_m: float, tolerance_m: float) -> Any:
    """Grow zones, then simplify them: fewer corners where outlines have many small steps."""
    for more in (1, 1.5, 2, 4):
        grown = shapely.buffer(zones, (margin_m + more * tolerance_m) / math.cos(math.pi / 16), quad_segs=4)
        simple = shapely.simplify(grown, tolerance_m)
        if shapely.covers(simple, required):
            return simple
    return required


def _simple(around: Any, zones: Any, reach_m: float) -> Any:
    """Simplify a polygon around zones, so that it still holds them and lies within a reach of them."""
    inner = shapely.intersection(zones, around)
    outer = shapely.buffer(inner, reach_m)
    for share in FENCE_TOLERANCES:
        simple = shapely.simplify(around, share * reach_m)
        if shapely.covers(simple, inner) and shapely.covers(outer, simple):
            return simple
    return inner


def _outside(line: Floats, blocked: Any) -> list[Floats]:
    """Return the parts of a line outside of an area, from its start to its end."""
    left = shapely.get_parts(shapely.difference(shapely.LineString(line), blocked))
    parts = [shapely.get_coordinates(part)[[0, -1]] for part in left if part.length >= MIN_LINE_M]
    return sorted(parts, key=lambda part: float(np.hypot(*(part[0] - line[0]))))


def near_zones(zones: Sequence[Any], places: Sequence[Any], reach_m: float) -> list[Any]:
    """Select the zones that the shortest paths between places may meet.

    A shortest path among obstacles stays within the convex hull of its ends and of the obstacles that it
    touches, so a zone outside the hull of all places, and of the zones that are near to it, changes nothing.

    The zones, and the places that are flown over, with home, are in metres. `reach_m` is how far a flight may
    lead outside of these places, and the margin of zones. The order of the zones is kept.

    Examples
    --------
    >>> boxes = [shapely.box(x, -5, x + 10, 5) for x in (20, 500)]
    >>> [zone.bounds for zone in near_zones(boxes, shapely.points([[0, 0], [100, 0]]), 50)]
    [(20.0, -5.0, 30.0, 5.0)]
    """
    if not len(zones):
        return []
    parts = shapely.make_valid(np.array(zones, object))
    hull = shapely.convex_hull(shapely.union_all(shapely.convex_hull(np.array(places, object))))
    near = np.zeros(len(parts), bool)
    while True:
        reached = shapely.dwithin(parts, hull, reach_m)
        if (reached == near).all():
            return [zone for zone, is_near in zip(zones, near.tolist(), strict=True) if is_near]
        near = reached
        hull = shapely.convex_hull(shapely.union_all([hull, *shapely.convex_hull(parts[near])]))


def keep_out_of(
    zones: Sequence[Any], home: Floats, plane: Plane, params: PlanParams
) -> tuple[KeepOut, list[str]]:
    """Return what a flight keeps out of, with notes; nothing where it is above the zones.

    Zones and home, (2,), are in metres of the plane. A MissionError says that home lies in a zone or its
    margin, and where the nearest place is that does not.
    """
    safety = params.safety
    vehicles = returning_vehicles(params.vehicle, params.autopilot)
    deviation_m = max(vehicle.deviation_m(params.speed_m_s) for vehicle in vehicles)
    keep_out = KeepOut(zones, safety.avoid_margin_m + deviation_m, deviation_m)
    if not keep_out.space.is_free(home[None])[0]:
        outlines = shapely.get_exterior_ring(shapely.get_parts(shapely.buffer(keep_out.grown, HOME_GAP_M)))
        free = shapely.union_all(shapely.polygons(outlines)).boundary  # outside of islands in zones
        x, y = shapely.get_coordinates(shapely.shortest_line(shapely.Point(home), free))[1]
        lon, lat = plane.lonlat_from_xy(x, y)
        raise MissionError(
            f"home lies in a keep-out zone or its margin, {keep_out.margin_m:.3g} m with what the vehicle "
            f"may leave its legs by at {params.speed_m_s:g} m/s; the nearest free place is {float(lat):.7f},"
            f"{float(lon):.7f}: look at it and start there (--home), or give a smaller --avoid-margin"
        )
    if not zones or safety.zone_height_m is None:
        return keep_out, []
    over = params.altitude_m >= safety.over_zones_m
    note = (
        f"keep-out zones are {safety.zone_height_m:g} m tall (--zone-height): from {safety.over_zones_m:g} m "
        "on, flights may pass over them, and fences do not exclude them; this one "
        f"{'may' if over else 'leads around them'}, at {params.altitude_m:g} m"
    )
    return KeepOut() if over else keep_out, [note]


def return_notes(path: Floats, keep_out: KeepOut, plane: Plane, params: PlanParams) -> Iterator[str]:
    """Yield notes on a return that the pilot or a failsafe starts during the flight.

    The vehicle may climb before it and flies straight, while the end of the mission leads around zones.
    `path` (n, 2) are the corners of the flight in metres, home first and last.
    """
    name, setting = NAMES[params.autopilot]
    maximum_m, away_m = params.safety.max_altitude_m, float(np.hypot(*(path - path[0]).T).max())
    vehicles = returning_vehicles(params.vehicle, params.autopilot)
    # the maximum; within a cone around home a return climbs less
    height_m = max(min(one.return_height_m, one.return_slope * away_m) for one in vehicles)
    if height_m > maximum_m:
        yield (
            f"for a return, {name} climbs to {height_m:.0f} m above home unless it is set otherwise, above "
            f"the {maximum_m:g} m of --max-altitude: set {setting} to {maximum_m:g} m at most"
        )
    if not keep_out.zones:
        return
    length = np.concatenate([[0.0], np.cumsum(leg_lengths(path))])
    at = np.linspace(0, length[-1], min(int(length[-1] / STEP_M) + 2, STARTS))
    starts = np.column_stack([np.interp(at, length, path[:, 0]), np.interp(at, length, path[:, 1])])
    returns = shapely.linestrings(np.stack([np.broadcast_to(path[0], starts.shape), starts], axis=1))
    crosses = shapely.intersects(keep_out.grown, returns)
    if crosses.any():
        x, y = starts[int(crosses.argmax())]
        lon, lat = plane.lonlat_from_xy(x, y)
        yield (
            "a return that starts early is straight: it leads through a keep-out zone or its margin from "
            f"{max(100 * crosses.mean(), 1):.0f} % of the flight, the first at "
            f"{float(lat):.6f},{float(lon):.6f}; there, lead the vehicle by hand, or give rally points"
        )


def home_outside(
    polygons: Sequence[Any],
    points: Sequence[tuple[float, float]],
    zones: Sequence[Any] = (),
    avoid_margin_m: float = 0.0,
    is_ground: IsGround | None = None,
) -> tuple[float, float]:
    """Find the place nearest to the middle of all regions that lies outside of them and of keep-out zones.

    A place that a region or zone encloses, such as an island, is not taken: people may not get there. The
    polygons, with a point (lon, lat) inside each, and the zones are in degrees (WGS 84). `is_ground` says
    whether a place (lat, lon) may be home; by default every place may. A MissionError says that there are no
    regions, or that no place near them may be home.
    """
    if not len(polygons):
        raise MissionError("there is no region to fly to; choose at least one")
    regions = np.array([*polygons, None], object)[:-1]
    plane = plane_around(shapely.bounds(shapely.get_parts(regions)), points[0][0])
    keep_out = KeepOut(list(plane.project_polygons(zones)), avoid_margin_m)
    west, south, east, north = shapely.bounds(regions).T
    bounds = np.column_stack([*plane.xy_from_lonlat(west, south), *plane.xy_from_lonlat(east, north)])
    groups = neighbour_groups(regions, bounds)  # a hole that several regions enclose lies within their group
    areas = []
    for k, group in enumerate(groups):
        steps_done(k, len(groups))
        metres = shapely.make_valid(plane.project_polygons(regions[group]))
        areas.append(_cleared(metres if k else np.append(metres, keep_out.grown)))
    outlines = shapely.get_exterior_ring(shapely.get_parts(merged(areas, fill=True)))
    places = shapely.get_coordinates(shapely.segmentize(outlines, HOME_STEP_M))
    middle = np.mean(np.column_stack(plane.xy_from_lonlat(*np.array(points).T)), axis=0)
    nearest = places[np.argsort(np.hypot(*(places - middle).T), kind="stable")[:MAX_TRIES]]
    for lon, lat in np.round(np.column_stack(plane.lonlat_from_xy(*nearest.T)), _DECIMALS).tolist():
        if is_ground is None or is_ground(lat, lon):
            return lat, lon
    raise MissionError(
        "no place for home was found near the regions on valid pixels of the raster; give --home LAT,LON"
    )


def _cleared(areas: NDArray[np.object_]) -> Any:
    """Grow areas by the clearance, without holes; those of many corners are simplified first."""
    if shapely.get_num_coordinates(areas).sum() <= MANY_CORNERS:
        grown = shapely.buffer(shapely.union_all(areas), CLEARANCE_M, quad_segs=4)
    else:
        simple = shapely.simplify(filled_parts(areas), SIMPLIFIED_M)
        grown = shapely.union_all(shapely.buffer(simple, CLEARANCE_M + 2 * SIMPLIFIED_M, quad_segs=4))
    return shapely.union_all(filled_parts(grown))
