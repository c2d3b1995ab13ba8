"""Mission planner: polygons to targets, a route, flights and their missions. Read this first."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.cover.survey import Survey
from uavseg.flight.mission.duration import CALM, leg_seconds
from uavseg.flight.mission.estimate import estimate, landing_seconds
from uavseg.flight.mission.items import (
    DEGREE_DECIMALS,
    MAX_DISTANCE_M,
    WAYPOINT,
    HomePosition,
    check_near,
    check_position,
    distance_m,
)
from uavseg.flight.mission.mission import BOARD_CAPACITY, NEARLY_CONVEX, Mission, Position, SurveyBlock
from uavseg.flight.mission.track import SAME_PLACE_M, Plane, Track, plane_around
from uavseg.flight.mission.vehicle import LEAST_WAY_M_S, Vehicle, Wind, default_vehicle
from uavseg.flight.params.plan import MAX_MARGIN_M, PARAMS_OF, PerimeterParams, PlanParams
from uavseg.flight.patterns import candidates as patterns
from uavseg.flight.patterns.candidates import RegionPart
from uavseg.flight.planning.along import home_notes, items_along
from uavseg.flight.planning.split import (
    FlightLimits,
    RegionRoute,
    check_order,
    fastest,
    items_of,
    short_route,
    split_route,
)
from uavseg.flight.safety.check import fence_around, rally_of_flights
from uavseg.flight.safety.keep_out import KeepOut, keep_out_of, near_zones, return_notes
from uavseg.flight.terrain.altitude_profile import LegPoints, points_of_leg
from uavseg.flight.terrain.follow import follow_ground, home_on_ground
from uavseg.flight.terrain.leg_speeds import fewest_changes, speed_notes, with_speeds

MAX_LISTED = 10  # places in a message
MIN_SHARE = 0.01  # of a region: smaller pieces that zones leave of it are not flown
SLACK = 0.1  # spacings by which outlines are simplified
NEIGHBOURS = 1.05  # spacings between lines of one block, at most


def plane_of(polygons: Sequence[Any], points: Sequence[tuple[float, float]], home: HomePosition) -> Plane:
    """Return the local plane of regions; refuse regions that are not on Earth, or not near home.

    The polygons are in degrees (lon, lat); `points` are one inside each.
    """
    bounds = shapely.bounds(shapely.get_parts(np.array(polygons, dtype=object)))
    (west, south), (east, north) = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    check_position(south, west, "a region")
    check_position(north, east, "a region")
    lon, lat = min(points, key=lambda point: distance_m(home.lat, home.lon, point[1], point[0]))
    check_near(home, lat, lon)
    plane = plane_around(bounds, home.lon)
    x, y = plane.xy_from_lonlat(bounds[:, [0, 2, 0, 2]], bounds[:, [1, 1, 3, 3]])
    home_x, home_y = plane.xy_from_lonlat(home.lon, home.lat)
    farthest = float(np.hypot(x - home_x, y - home_y).max())
    if not farthest <= MAX_DISTANCE_M:
        raise MissionError(
            f"the regions reach {farthest / 1000:.0f} km from home; "
            f"at most {MAX_DISTANCE_M / 1000:.0f} km are allowed: choose regions that are nearer"
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
        for polygon in _connected_parts(region):
            point = _point_in(polygon, (x, y))
            lon, lat = plane.lonlat_from_xy(*point)
            parts.append(RegionPart(polygon, point, f"{float(lat):.5f},{float(lon):.5f}"))
    return parts


def _connected_parts(region: Any) -> list[Any]:
    if region.geom_type == "MultiPolygon":
        region = shapely.union_all(shapely.get_parts(region), grid_size=1e-3)
    if not shapely.is_valid(region):
        region = shapely.make_valid(region, method="structure", keep_collapsed=False)
    return [part for part in shapely.get_parts(region) if part.geom_type == "Polygon" and part.area > 0]


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


FIXED_ITEMS = 5  # takeoff, speed, gimbal, return, and one in reserve
ATTEMPTS = 8
USUAL_WIND_M_S = 5.0
"""Where no wind is given, the reserve holds in this one, from any direction."""


def missions_over(
    route: RegionRoute,
    home: HomePosition,
    plane: Plane,
    keep_out: KeepOut,
    params: PlanParams,
    notes: list[str],
) -> tuple[Mission, ...]:
    """Split a route into missions that are within their limits by the estimates of complete missions.

    `plane` is that of the route; `notes` are for all missions, and some are added. Without a wind in
    `params`, they are within them in a usual one, or else in the strongest of some in which that is possible.
    """
    winds = [params.wind or CALM]
    if params.wind is None and math.isfinite(params.limits.seconds):
        winds = [Wind(share * USUAL_WIND_M_S) for share in (1.0, 0.6, 0.3)] + winds
    for wind in winds:
        try:
            tracks, missions = _split(route, home, plane, keep_out, params, wind)
            break
        except MissionError:
            if wind is winds[-1]:
                raise
    notes += speed_notes(tracks, params) + wind_notes(missions, params)
    if len(missions) > 1:
        notes.append(f"the mission is divided into {len(missions)} flights, each from home and back")
        notes += _vehicle_notes(tracks, params)
        missions = rally_of_flights(missions) if params.safety.rally else missions
    return tuple(replace(mission, notes=(*notes, *mission.notes)) for mission in missions)


def _split(
    route: RegionRoute,
    home: HomePosition,
    plane: Plane,
    keep_out: KeepOut,
    params: PlanParams,
    wind: Wind,
) -> tuple[list[Track], list[Mission]]:
    """Return the tracks and missions of flights, those of one vehicle after those of another."""
    limits, vehicles = params.limits, params.limits.vehicles
    allowed = _flight_limits(_worst_costs(route, plane, params, wind), params)
    for _ in range(ATTEMPTS):
        parts = split_route(route, allowed)
        if len(parts) % vehicles:
            parts = split_route(route, replace(allowed, flights=vehicles * math.ceil(len(parts) / vehicles)))
        tracks = [with_speeds(track.without_repeats(), route.home, params) for track in parts]
        missions = []
        for number, track in enumerate(tracks):
            above_m = SEPARATION_M * (number * vehicles // len(tracks))
            flown = replace(params, altitude_m=params.altitude_m + above_m)
            missions.append(_mission(track, home, plane, keep_out, flown))
        slower = max(estimate(mission, wind=wind).duration_s for mission in missions) / limits.seconds
        larger = max(_fullness(mission, params) for mission in missions)
        if slower <= 1 and larger <= 1:
            return tracks, missions
        allowed = allowed.tighter(0.99 / max(slower, 0.99), 0.99 / max(larger, 0.99))
    raise MissionError(
        "no way to divide the mission was found whose flights fit; give more --endurance or --max-items"
    )


def _flight_limits(costs: "LegCosts", params: PlanParams) -> FlightLimits:
    vehicle, limits = params.vehicle or default_vehicle(params.autopilot), params.limits
    climb = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, params.altitude_m)])
    slow_m = min(params.altitude_m, vehicle.takeoff_height_m)
    up_s = float(leg_seconds(climb, vehicle.climb_m_s, vehicle)[0]) + vehicle.start_s
    up_s += slow_m * (1 / vehicle.takeoff_m_s - 1 / vehicle.climb_m_s)
    down_s = float(landing_seconds(params.altitude_m, vehicle)) + vehicle.stop_s + vehicle.return_hold_s
    by_waypoints = limits.max_waypoints is not None
    return FlightLimits(
        seconds=limits.seconds,
        items=limits.max_waypoints or limits.max_items or BOARD_CAPACITY[params.autopilot],
        fixed_s=up_s + down_s,
        fixed_items=0 if by_waypoints else FIXED_ITEMS,
        count=(lambda track: len(track.xy)) if by_waypoints else items_of,
        costs=costs.of,
        ways=costs.ways,
        flights=limits.flights,
    )


def _fullness(mission: Mission, params: PlanParams) -> float:
    """Return the share of what a flight may hold in items, and in waypoints."""
    limits = params.limits
    items = len(mission.items) / (limits.max_items or BOARD_CAPACITY[params.autopilot])
    waypoints = sum(item.command == WAYPOINT for item in mission.items)
    return max(items, waypoints / (limits.max_waypoints or math.inf))


SEPARATION_M = 5.0
"""Between the heights of vehicles that are in the air at once."""


def _vehicle_notes(tracks: Sequence[Track], params: PlanParams) -> list[str]:
    """Return what pilots of several vehicles should know."""
    vehicles = params.limits.vehicles
    if vehicles == 1:
        return []
    each = len(tracks) // vehicles
    parts = [
        shapely.MultiLineString([track.xy for track in tracks[k : k + each] if len(track.xy) > 1])
        for k in range(0, len(tracks), each)
    ]
    near_m = min(
        float(shapely.distance(one, other)) for k, one in enumerate(parts) for other in parts[k + 1 :]
    )
    of_each = f"{each} flight{'s' * (each > 1)} each, in turn"
    return [
        f"{vehicles} vehicles fly at once, {of_each}: at {params.altitude_m:g} m, and each "
        f"{SEPARATION_M:g} m above the one before; over ground they come as near as {near_m:.0f} m to each "
        "other, on the ways from and to home nearer",
        "start them one after another, from places some metres apart, and set the height at which each "
        "returns to that of its flight: returns at one height, and landings at one place, would meet",
    ]


def _worst_costs(route: RegionRoute, plane: Plane, params: PlanParams, wind: Wind) -> "LegCosts":
    """Return the costs of legs in the direction of the wind in which the whole route takes longest."""
    costs = [LegCosts(plane, params, one, one is not wind) for one in wind.directions()]
    if len(costs) == 1:
        return costs[0]
    whole = route.flight(0, len(route.pieces) - 1)
    return max(costs, key=lambda one: one.of(whole)[0].sum())


def wind_notes(missions: Sequence[Mission], params: PlanParams) -> list[str]:
    """Return notes of speeds that the vehicle does not reach, and of the wind in which the reserve holds."""
    vehicle = params.vehicle or default_vehicle(params.autopilot)
    notes = []
    if params.speed_m_s > vehicle.airspeed_m_s:
        notes.append(
            f"{params.speed_m_s:g} m/s is more than the {vehicle.airspeed_m_s:g} m/s that a {vehicle.name} "
            "is taken to fly through the air (airspeed_m_s of --vehicle)"
        )
    if params.wind is not None:
        return [*notes, f"estimates are for a wind of {params.wind}"]
    if math.isinf(params.limits.seconds):
        return notes
    holds = 0
    while holds + 1 <= vehicle.airspeed_m_s - LEAST_WAY_M_S:
        stronger = Wind(holds + 1)
        if max(estimate(one, wind=stronger).duration_s for one in missions) > params.limits.seconds:
            break
        holds += 1
    held = f"holds in a wind of up to {holds} m/s from any direction" if holds else "holds in calm air only"
    return [*notes, f"estimates are for calm air; the reserve of {params.limits.reserve:g} % {held} (--wind)"]


def _mission(
    track: Track, home: HomePosition, plane: Plane, keep_out: KeepOut, params: PlanParams
) -> Mission:
    path = follow_ground(track.in_degrees(plane), home, params)
    items = items_along(path.track, home, params, path.heights)
    place = np.column_stack(plane.xy_from_lonlat([home.lon], [home.lat]))
    flown = np.concatenate([place, track.xy, place])
    margin_m = params.safety.fence_margin_m
    fence, notes = ((), []) if margin_m is None else fence_around(flown, keep_out, margin_m, plane)
    notes += return_notes(flown, keep_out, plane, params)
    return Mission(
        home=home,
        items=items,
        autopilot=params.autopilot,
        name=params.name,
        notes=(*path.notes, *notes),
        fence=fence,
        rally=params.safety.rally,
        vehicle=params.vehicle,
        photos=params.photos,
        ground=path.ground,
        endurance_s=None if params.limits.endurance_min is None else 60 * params.limits.endurance_min,
        wind=params.wind,
    )


@dataclass(frozen=True, slots=True, eq=False)
class LegCosts:
    """Time and items of legs, by the functions that make the items of flights; each leg is measured once."""

    plane: Plane
    params: PlanParams
    wind: Wind = CALM  # with a direction
    is_against: bool = False  # whether ways are flown against it, in all directions
    _known: dict[tuple[float, ...], LegPoints] = field(default_factory=dict)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of the plan, or the default one of its autopilot."""
        return self.params.vehicle or default_vehicle(self.params.autopilot)

    def ways(self, home: Floats, places: Floats, length_m: Floats) -> tuple[Floats, Floats]:
        """Return the time from home (2,) to places (n, 2) and back, over level ground, from rest to rest.

        Where ways are longer than straight, `length_m` (n,), they are stretched. A straight way back is a
        return with its speed, height and landing; else it is that of the mission where that takes longer.
        """
        vehicle, height = self.vehicle, self.params.altitude_m
        straight = np.hypot(*(places - home).T)
        stretch = np.where(straight > SAME_PLACE_M, length_m / np.maximum(straight, SAME_PLACE_M), 1.0)
        out, back = self._to_and_fro(home, places, self.params.speed_m_s)
        _, returned = self._to_and_fro(home, places, vehicle.return_speed_m_s)
        above = np.maximum(np.minimum(vehicle.return_height_m, vehicle.return_slope * length_m), height)
        up = np.zeros((2 * len(above), 3))
        up[::2, 2], up[1::2, 2] = height, above
        climb_s = leg_seconds(up, vehicle.climb_m_s, vehicle, np.ones(len(up), bool))[::2]
        climb_s += landing_seconds(above, vehicle) - landing_seconds(height, vehicle)
        returned = returned * stretch + climb_s
        is_bent = length_m > straight + SAME_PLACE_M
        return out * stretch, np.where(is_bent, np.maximum(back * stretch, returned), returned)

    def _to_and_fro(self, home: Floats, places: Floats, speed_m_s: float) -> tuple[Floats, Floats]:
        path = np.full((2 * len(places) + 1, 3), self.params.altitude_m)
        path[::2, :2], path[1::2, :2] = home, places
        stops = np.ones(len(path), bool)
        wind = self.wind
        if self.is_against:
            speed_m_s, wind = min(speed_m_s, self.vehicle.airspeed_m_s - wind.speed_m_s), CALM
        seconds = leg_seconds(path, speed_m_s, self.vehicle, stops, wind=wind)
        return seconds[::2], seconds[1::2]

    def of(self, track: Track) -> tuple[Floats, Floats]:
        """Return the time of each leg, with the hold at its end, and its items besides corners, (n - 1,).

        Items are changes of speed, and points that are added over uneven ground.
        """
        legs = len(track.is_line)
        if not legs:
            return np.zeros(0), np.zeros(0)
        points = self._points(track, fewest_changes(track, self.params))
        counts = np.array([len(leg.share) for leg in points])
        first = np.concatenate([[0], np.cumsum(counts[:-1])])
        of_leg = np.repeat(np.arange(legs), counts)
        share = np.concatenate([leg.share for leg in points])
        xy = track.xy[of_leg] + share[:, None] * (track.xy[of_leg + 1] - track.xy[of_leg])
        height = np.concatenate([points[0].height_m[:1], *(leg.height_m[1:] for leg in points)])
        path = np.column_stack([np.concatenate([track.xy[:1], xy]), height])
        speed = np.concatenate([leg.speed_m_s for leg in points])
        hold = np.zeros(len(path))
        hold[np.append(0, first + counts)] = track.hold_s
        seconds = np.add.reduceat(
            leg_seconds(path, speed, self.vehicle, hold > 0, hold, self.wind) + hold[1:], first
        )
        change = np.diff(speed, prepend=speed[0])
        slower = (change < 0) & np.isin(np.arange(len(speed)), first)  # with a point before the line
        items = np.add.reduceat((change != 0) + slower.astype(float), first) + counts - 1
        return seconds, items

    def _points(self, track: Track, speeds: Floats) -> list[LegPoints]:
        terrain = self.params.terrain
        if terrain is None or terrain.dem is None:
            end, height = np.ones(1), np.full(2, self.params.altitude_m)
            return [LegPoints(end, height, np.array([speed])) for speed in speeds.tolist()]
        lon, lat = self.plane.lonlat_from_xy(*track.xy.T)
        places = np.column_stack([lon[:-1], lat[:-1], lon[1:], lat[1:], speeds])
        keys = [tuple(place) for place in places.tolist()]
        for key in keys:
            if key not in self._known:
                self._known[key] = points_of_leg(terrain.dem, key, self.params)
        return [self._known[key] for key in keys]


MAX_WAYPOINTS = 20_000
"""Of all flights together: 30 full boards."""
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
    start = HomePosition(*home)
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
    _check_count(candidates)
    tracks = _reachable(candidates, place, keep_out)
    chosen = [[[track]] for track in tracks[0]] if len(tracks) == 1 else [tracks]
    routes = [short_route(some, place, keep_out.space) for some in chosen]
    winds = (params.wind or CALM).directions()
    limits = [_flight_limits(LegCosts(plane, params, wind), params) for wind in winds]
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


def _reach_m(regions: NDArray[np.object_], params: PlanParams) -> float:
    """Return an upper bound of the distance of a flight from its regions, with the margin of zones."""
    west, south, east, north = shapely.bounds(regions).T
    around = float(np.hypot(east - west, north - south).max()) + params.speed_m_s**2  # circles, and turns
    lines = 2 * max(one.spacing_m or 0 for one in params.passes) + 2 * params.safety.avoid_margin_m
    for one in params.passes[1:]:  # lines begin outside of the regions
        lines += 2 * abs(one.photos.side_reach_m(one.altitude_m)) if one.photos else 0
    margins = 0 if params.how in (None, PARAMS_OF[params.pattern]()) else 2 * MAX_MARGIN_M
    return MIN_REACH_M + around + lines + margins


def _check_count(candidates: patterns.Candidates) -> None:
    corners = sum(min(len(track.xy) for track in tracks) for tracks in candidates.tracks)
    if corners > MAX_WAYPOINTS:
        raise MissionError(
            f"the mission would have {corners:,} waypoints; at most {MAX_WAYPOINTS:,} are planned: choose "
            "fewer regions, a wider spacing or a larger tolerance"
        )


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
            outline=_positions(_outline(lines), plane),
            waypoints=_positions(lines.reshape(-1, 2), plane),
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


def _positions(xy: Floats, plane: Plane) -> tuple[Position, ...]:
    lon, lat = plane.lonlat_from_xy(*xy.T)
    return tuple(map(tuple, np.round(np.column_stack([lat, lon]), DEGREE_DECIMALS).tolist()))
