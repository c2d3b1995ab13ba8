"""Mission planner: polygons to targets, a route, flights and their missions. Read this first."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats, Objects
from uavseg.errors import MissionError
from uavseg.flight.cover.survey import Survey
from uavseg.flight.mission import items
from uavseg.flight.mission.duration import CALM
from uavseg.flight.mission.mission import NEARLY_CONVEX, Mission, SurveyBlock
from uavseg.flight.mission.track import Plane, Track, plane_around
from uavseg.flight.params.plan import MAX_MARGIN_M, PARAMS_OF, PerimeterParams, PlanParams
from uavseg.flight.patterns import candidates as patterns
from uavseg.flight.patterns.candidates import RegionPart
from uavseg.flight.planning.along import home_notes
from uavseg.flight.planning.flights import LegCosts, flight_limits, missions_over
from uavseg.flight.planning.split import check_order, fastest, short_route
from uavseg.flight.safety.keep_out import KeepOut, keep_out_of, near_zones
from uavseg.flight.terrain.follow import home_on_ground

MAX_LISTED = 10  # places in a message
MIN_SHARE = 0.01  # of a region: smaller pieces that zones leave of it are not flown
SLACK = 0.1  # spacings by which outlines are simplified
NEIGHBOURS = 1.05  # spacings between lines of one block, at most


def plane_of(
    polygons: Sequence[Any], points: Sequence[tuple[float, float]], home: items.HomePosition
) -> Plane:
    """Return the local plane of regions; refuse regions that are not on Earth, or not near home.

    The polygons are in degrees (lon, lat); `points` are one inside each.
    """
    bounds = shapely.bounds(shapely.get_parts(np.array(polygons, dtype=object)))
    (west, south), (east, north) = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    items.check_position(south, west, "a region")
    items.check_position(north, east, "a region")
    lon, lat = min(points, key=lambda point: items.distance_m(home.lat, home.lon, point[1], point[0]))
    items.check_near(home, lat, lon)
    plane = plane_around(bounds, home.lon)
    x, y = plane.xy_from_lonlat(bounds[:, [0, 2, 0, 2]], bounds[:, [1, 1, 3, 3]])
    home_x, home_y = plane.xy_from_lonlat(home.lon, home.lat)
    farthest = float(np.hypot(x - home_x, y - home_y).max())
    if not farthest <= items.MAX_DISTANCE_M:
        raise MissionError(
            f"the regions reach {farthest / 1000:.0f} km from home; "
            f"at most {items.MAX_DISTANCE_M / 1000:.0f} km are allowed: choose regions that are nearer"
        )
    return plane


def region_parts(
    regions: Iterable[Any], plane: Plane, points: Sequence[tuple[float, float]]
) -> list[RegionPart]:
    """Return the connected parts of regions, each with the given point if it lies inside, else another one.

    The regions are in metres, the points degrees (lon, lat).
    """
    parts = []
    places = np.column_stack(plane.xy_from_lonlat(*np.array(points).T)).tolist()
    for region, (x, y) in zip(regions, places, strict=True):
        if region.geom_type == "MultiPolygon":
            region = shapely.union_all(shapely.get_parts(region), grid_size=1e-3)
        if not shapely.is_valid(region):
            region = shapely.make_valid(region, method="structure", keep_collapsed=False)
        for polygon in shapely.get_parts(region):
            if polygon.geom_type == "Polygon" and polygon.area > 0:
                point = _point_in(polygon, (x, y))
                lon, lat = plane.lonlat_from_xy(*point)
                parts.append(RegionPart(polygon, point, f"{float(lat):.5f},{float(lon):.5f}"))
    return parts


def _point_in(polygon: Any, point: tuple[float, float]) -> tuple[float, float]:
    """Return a point if it lies inside, else another one."""
    if shapely.contains_xy(polygon, *point):
        return point
    x, y = shapely.get_coordinates(shapely.point_on_surface(polygon))[0].tolist()
    return x, y


def clear_parts(parts: list[RegionPart], keep_out: KeepOut) -> tuple[list[RegionPart], list[str]]:
    """Return the parts of regions outside of keep-out zones, and a note of the area inside."""
    cleared, taken_m2 = [], 0.0
    lost: list[str] = []
    for part in parts:
        pieces = [
            piece
            for piece in shapely.get_parts(keep_out.left_of(part.polygon))
            if piece.geom_type == "Polygon" and piece.area >= MIN_SHARE * part.polygon.area
        ]
        if not pieces:
            lost.append(part.place)
        taken_m2 += part.polygon.area - sum(piece.area for piece in pieces)
        cleared += [replace(part, polygon=piece, point=_point_in(piece, part.point)) for piece in pieces]
    if lost:
        more = f" and {len(lost) - MAX_LISTED} more" if len(lost) > MAX_LISTED else ""
        places = "; ".join(lost[:MAX_LISTED]) + more
        which = f"the region at {places} lies" if len(lost) == 1 else f"{len(lost)} regions lie ({places})"
        raise MissionError(
            f"{which} in a keep-out zone or its margin; leave out what is not to be flown, or use a smaller "
            "--avoid-margin"
        )
    if taken_m2 < 0.5:
        return cleared, []
    share = taken_m2 / sum(part.polygon.area for part in parts)
    note = f"{taken_m2:,.0f} m2 of the regions ({100 * share:.2g} %) lie in keep-out zones or their margin"
    return cleared, [f"{note}, and are not flown over"]


MAX_WAYPOINTS = 20_000  # of all flights together: 30 full boards
MIN_REACH_M = 100.0
_PATTERN_FUNCTIONS = {
    "visit": patterns.visits,
    "perimeter": patterns.perimeters,
    "corridor": patterns.corridors,
    "orbit": patterns.orbits,
}


def plan_missions(
    polygons: Sequence[Any],
    points: Sequence[tuple[float, float]],
    params: PlanParams,
    home: tuple[float, ...],
    zones: Sequence[Any] = (),
) -> tuple[Mission, ...]:
    """Plan missions over regions: take off, fly their pattern in a short order, return.

    Regions and keep-out zones (shapely) are in degrees (lon, lat; WGS 84), with a point (lon, lat) inside
    each region. The parts of a region are flown one by one; parts that touch, as at the antimeridian, are
    merged. `home` is (lat, lon), perhaps with its altitude in metres above the sea. No leg comes nearer to a
    zone than the margin of `params`. There are more missions than one where the limits of `params` require
    it. A MissionError says that there are no regions, that they are not near home, that zones make a region
    or home unreachable, that a part of the mission does not fit into a flight, or that the mission would not
    be safe.
    """
    if len(polygons) == 0:
        raise MissionError("there is no region to fly to; choose at least one")
    check_regions(len(polygons), params)
    home, at_home = home_on_ground(home, params)
    start = items.HomePosition(*home)
    plane = plane_of(polygons, points, start)
    place = np.column_stack(plane.xy_from_lonlat([start.lon], [start.lat]))[0]
    regions = plane.project_polygons(polygons)
    near = near_zones(
        list(plane.project_polygons(zones)), [*regions, shapely.Point(place)], _reach_m(regions, params)
    )
    keep_out, height_notes = keep_out_of(near, place, plane, params)
    parts, zone_notes = clear_parts(region_parts(regions, plane, points), keep_out)
    if params.pattern == "survey":
        candidates = patterns.surveys(parts, params, place)
    else:
        candidates = _PATTERN_FUNCTIONS[params.pattern](parts, params)
    corners = sum(min(len(track.xy) for track in tracks) for tracks in candidates.tracks)
    if corners > MAX_WAYPOINTS:
        raise MissionError(
            f"the mission would have {corners:,} waypoints; at most {MAX_WAYPOINTS:,} are planned: choose "
            "fewer regions, a wider spacing or a larger tolerance"
        )
    tracks = _reachable(candidates, place, keep_out)
    winds = (params.wind or CALM).directions()
    limits = [flight_limits(LegCosts(plane, params, wind), params) for wind in winds]
    chosen = [[[track]] for track in tracks[0]] if len(tracks) == 1 else [tracks]
    routes = [short_route(some, place, keep_out.space, limits, params.speed_m_s) for some in chosen]
    route = fastest(routes, limits)
    notes = [*home_notes(home), *at_home, *height_notes, *zone_notes, *candidates.notes]
    if len(params.passes) > 1 and tracks != candidates.tracks:
        notes.append(
            "keep-out zones lie in the way: beside them, the ground may not be photographed from all sides"
        )
    missions = missions_over(route, start, plane, keep_out, params, notes)
    blocks = blocks_of_surveys(candidates.surveys, plane, params)
    return tuple(replace(mission, blocks=blocks) for mission in missions)


def check_regions(count: int, params: PlanParams) -> None:
    """Refuse more regions than can be ordered, before any work (MissionError).

    Perimeters inside of regions are counted later: small regions have none.
    """
    if not (isinstance(params.how, PerimeterParams) and params.how.offset_m < 0):
        check_order(count)


def _reach_m(regions: Objects, params: PlanParams) -> float:
    """Return an upper bound of the distance of a flight from its regions, with the margin of zones."""
    west, south, east, north = shapely.bounds(regions).T
    around = float(np.hypot(east - west, north - south).max()) + params.speed_m_s**2  # circles, and turns
    lines = 2 * max(one.spacing_m or 0 for one in params.passes) + 2 * params.safety.avoid_margin_m
    for one in params.passes[1:]:  # lines begin outside of the regions
        lines += 2 * abs(one.photos.side_reach_m(one.altitude_m)) if one.photos else 0
    margins = 0 if params.how in (None, PARAMS_OF[params.pattern]()) else 2 * MAX_MARGIN_M
    return MIN_REACH_M + around + lines + margins


def _reachable(candidates: patterns.Candidates, home: Floats, keep_out: KeepOut) -> list[list[Track]]:
    """Split tracks where zones block them, and drop those that cannot be reached from home."""
    cleared = [[keep_out.clear(track) for track in tracks] for tracks in candidates.tracks]
    ends = np.array([track.xy[[0, -1]] for tracks in cleared for track in tracks]).reshape(-1, 2)
    lengths = keep_out.space.lengths_from(home, ends).reshape(-1, 2)
    is_reached = iter(np.isfinite(lengths.max(axis=1)))
    reachable = [[track for track in tracks if next(is_reached)] for tracks in cleared]
    for tracks, place in zip(reachable, candidates.places, strict=True):
        if not tracks:
            raise MissionError(
                f"the region at {place} cannot be reached: keep-out zones and their margin enclose it, "
                "or home; leave it out, or use a smaller --avoid-margin"
            )
    return reachable


def blocks_of_surveys(surveys: Iterable[Survey], plane: Plane, params: PlanParams) -> tuple[SurveyBlock, ...]:
    """Return the runs of neighbouring lines of surveys, with the positions of their waypoints in the mission.

    Surveys whose lines have straight legs before and after them have none, nor have those that are not
    photographed by distance: a ground station would fly them differently.
    """
    if params.spacing_m is None or (params.photos is not None and params.photos.trigger != "distance"):
        return ()
    return tuple(
        SurveyBlock(
            outline=plane.positions(_outline(lines)),
            waypoints=plane.positions(lines.reshape(-1, 2)),
            angle_deg=flown.angle_deg,
            spacing_m=float(params.spacing_m),
            height_m=float(params.altitude_m),
            photos=params.photos,
        )
        for flown in surveys
        if np.array_equal(flown.lines, flown.outer)
        for lines in _runs(flown, params.spacing_m)
    )


def _runs(flown: Survey, spacing_m: float) -> Iterator[Floats]:
    """Yield lines (k, 2, 2), k > 1, that follow each other a spacing apart, joined by straight legs."""
    lines = flown.lines
    along = np.array([np.sin(np.radians(flown.angle_deg)), np.cos(np.radians(flown.angle_deg))])
    across = lines.mean(axis=1) @ np.array([along[1], -along[0]])
    is_parallel = np.abs((lines[:, 1] - lines[:, 0]) @ np.array([along[1], -along[0]])) < 1e-3
    near = np.abs(np.diff(across)) <= NEIGHBOURS * spacing_m
    straight = np.array([len(leg) == 2 for leg in flown.legs], bool)
    same = near & straight & is_parallel[1:] & is_parallel[:-1]
    same[1:] &= np.sign(np.diff(across))[1:] == np.sign(np.diff(across))[:-1]
    todo = np.split(lines, np.flatnonzero(~same) + 1)[::-1]
    while todo:  # runs over concave places are divided where the ends of lines jump most
        run = todo.pop()
        if len(run) < 2:
            continue
        outline = shapely.Polygon(_outline(run))
        if len(run) == 2 or outline.area >= NEARLY_CONVEX * outline.convex_hull.area:
            yield run
            continue
        ends = np.sort(run @ along, axis=1)
        split = int(np.abs(np.diff(ends, axis=0)).sum(axis=1).argmax()) + 1
        todo += [run[split:], run[:split]]


def _outline(lines: Floats) -> Floats:
    """Return the outline of the strips of evenly spaced lines, with few corners."""
    along = lines[0, 1] - lines[0, 0]
    ahead = (lines @ along)[:, 1] > (lines @ along)[:, 0]
    turned = np.where(ahead[:, None, None], lines, lines[:, ::-1])
    step = (lines[-1] - lines[0]).mean(axis=0)
    across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
    spacing_m = abs(float(step @ across)) / (len(lines) - 1)
    half = np.sign(step @ across) * across * spacing_m / 2
    left = np.concatenate([turned[:1, 0] - half, turned[1:-1, 0], turned[-1:, 0] + half])
    right = np.concatenate([turned[:1, 1] - half, turned[1:-1, 1], turned[-1:, 1] + half])
    simple = shapely.simplify(shapely.Polygon(np.concatenate([left, right[::-1]])), SLACK * spacing_m)
    corners: Floats = shapely.get_coordinates(simple)[:-1]
    return corners
