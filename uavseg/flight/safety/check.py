"""Safety check of a mission: every leg against zones, fence, heights and distance from home; fences."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError, ParameterError
from uavseg.flight.mission import items as mav
from uavseg.flight.mission.items import Fence, FenceCircle, FencePolygon
from uavseg.flight.mission.mission import CRUISE_M_S, Mission
from uavseg.flight.mission.track import Plane, plane_around
from uavseg.flight.params.plan import PlanParams, SafetyParams
from uavseg.flight.safety.keep_out import KeepOut
from uavseg.flight.terrain.altitude_profile import (
    climbs_early,
    heights_climbed_early,
    known_heights_m,
    profile_along,
    rates_m_s,
)
from uavseg.raster.elevation.dem import Dem

Name = Callable[[int], str]  # of the part of a mission with this number

SLACK_M = 0.05  # for the decimals of a file and the local plane
HEIGHT_SLACK_M = 0.5
MAX_VERTICES = 64  # of all polygons together: what PX4 stores, and about what boards with ArduPilot do
CIRCLE_QUARTER = 64  # sides of a quarter of a circle
TOLERANCE_M = 0.01
GAP_M = 0.2  # between the bounds of the ground
RALLY_M = 5.0  # minimum height of a rally point above its ground, where flights are not lower
GROUND_SLACK_M = 0.3  # for the decimals of a file on steep ground


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Minimum height of flights above the ground."""

    dem: Dem
    minimum_m: float  # on any leg, from above home on
    # Rates of climb and descent of a vehicle that approaches the height of the next waypoint at once, as PX4
    # does: the heights between its path and the straight line are checked. By default the straight line.
    early: tuple[float, float] | None = None

    def problems(self, mission: Mission, maximum_m: float) -> Iterator[str]:
        """Yield where a leg or rally point comes nearer to the ground than allowed, or is higher above it.

        The return is at the height of the last item. Heights above the terrain that the vehicle itself knows
        are taken for what they say. `maximum_m` is the maximum height above the ground.
        """
        try:
            yield from self._legs(mission, maximum_m)
            minimum_m = min(self.minimum_m, RALLY_M)
            for number, point in enumerate(mission.rally, start=1):
                home_m = self._ground_m(mission.home.lat, mission.home.lon)
                above_m = home_m + point.altitude_m - self._ground_m(point.lat, point.lon)
                place = f"rally point {number} at {point.lat:.6f},{point.lon:.6f}"
                yield from self._outside(above_m, minimum_m, maximum_m, place)
        except MissionError as error:  # the ground is not known
            yield str(error)

    def _legs(self, mission: Mission, maximum_m: float) -> Iterator[str]:
        items = [item for item in mission.items if item.has_position]
        if any(item.frame == mav.FRAME_TERRAIN for item in items):
            yield from self._outside(
                max(item.altitude_m for item in items), self.minimum_m, maximum_m, "an item"
            )
            return
        home_m = self._ground_m(mission.home.lat, mission.home.lon)
        places = [] if items[0].command in mav.TAKEOFFS else [(*_position(mission), home_m, CRUISE_M_S)]
        for item, speed in zip(items, mission.leg_speeds_m_s, strict=True):
            lon, lat = _position(mission) if item.command in mav.TAKEOFFS else (item.lon, item.lat)
            zero_m = 0.0 if item.frame == mav.FRAME_AMSL else home_m
            places.append((lon, lat, zero_m + item.altitude_m, speed))
        if any(item.command == mav.RETURN for item in mission.items):
            places.append((*_position(mission), *places[-1][2:]))
        lon, lat, height, speeds = np.array(places).T
        profile = profile_along(self.dem, lon, lat, GAP_M)
        flight = np.interp(profile.along_m, profile.along_m[profile.corners], height)
        lower = upper = flight
        if self.early is not None:
            early = heights_climbed_early(profile, height, speeds[1:], self.early)
            lower, upper = np.minimum(flight, early), np.maximum(flight, early)
        for above in (lower - profile.upper_m, upper - profile.lower_m):
            for k in (int(above.argmin()), int(above.argmax())):
                place = f"the position {profile.lat[k]:.6f},{profile.lon[k]:.6f}"
                yield from self._outside(float(above[k]), self.minimum_m, maximum_m, place)

    def _ground_m(self, lat: float, lon: float) -> float:
        return float(known_heights_m(self.dem, np.array([lon]), np.array([lat]))[0])

    def _outside(self, above_m: float, minimum_m: float, maximum_m: float, place: str) -> Iterator[str]:
        if above_m < minimum_m - GROUND_SLACK_M:
            yield (
                f"{place} is {above_m:.1f} m above the ground of {self.dem.name}, and at least "
                f"{minimum_m:.1f} m are kept"
            )
        if above_m > maximum_m:
            yield (
                f"{place} is {above_m:.1f} m above the ground of {self.dem.name}, higher than allowed "
                "(--max-altitude): plan it with a lower --altitude or a smaller --terrain-tolerance"
            )


def clearance_of(params: PlanParams) -> Clearance | None:
    """Return the clearance that missions with these parameters keep; None without a DEM."""
    terrain = params.terrain
    if terrain is None or terrain.dem is None:
        return None
    minimum_m = params.altitude_m - terrain.tolerance_for(params.altitude_m)
    return Clearance(terrain.dem, minimum_m, rates_m_s(params) if climbs_early(params.autopilot) else None)


def _position(mission: Mission) -> tuple[float, float]:
    return mission.home.lon, mission.home.lat


def fence_around(
    path: Floats, keep_out: KeepOut, margin_m: float, plane: Plane
) -> tuple[tuple[FencePolygon, ...], list[str]]:
    """Draw the fence around a path; return it with notes.

    `path` (n, 2) are all corners of the flight with home, in metres; the hull is at least `margin_m` from it.

    The fence is the hull (inclusion), and each zone that it meets with half of its margin, or less
    (exclusion). Where these have more vertices than boards store, zones end at the hull, and may have up to
    three quarters of their margin.
    """
    hull = shapely.convex_hull(shapely.multipoints(path))
    outer = shapely.simplify(shapely.buffer(hull, 1.2 * margin_m, quad_segs=2), margin_m / 20)
    reach = shapely.buffer(outer, margin_m)
    whole, simpler = keep_out.fence_zones, keep_out.simpler_fence_zones
    clipped = [shapely.get_parts(shapely.intersection(zones, reach)) for zones in (whole, simpler)]
    near = [
        [zone for zone in zones if zone.area > 0 and shapely.intersects(outer, zone)]
        for zones in (whole, *clipped)
    ]
    # Zones by the first method with few enough vertices, or the fewest.
    maximum = MAX_VERTICES - shapely.get_num_coordinates(outer)
    counts = [int(shapely.get_num_coordinates(zones).sum()) for zones in near]
    enough = [k for k, count in enumerate(counts) if count <= maximum]
    zones = near[enough[0] if enough else int(np.argmin(counts))]
    fence = [_polygon(outer, plane, True), *(_polygon(zone, plane, False) for zone in zones)]
    notes = []
    count = sum(len(shape.vertices) for shape in fence)
    if count > MAX_VERTICES:
        notes.append(
            f"the fence has {count} vertices, and many boards store {MAX_VERTICES}; where the vehicle "
            "refuses it, give fewer or simpler zones, or --fence none"
        )
    if any(shapely.get_num_interior_rings(zone) for zone in zones):
        notes.append("holes of keep-out zones are closed in the fence")
    return tuple(fence), notes


def _polygon(ring: Any, plane: Plane, inclusion: bool) -> FencePolygon:
    xy = shapely.get_coordinates(shapely.get_exterior_ring(ring))[:-1]
    return FencePolygon(plane.positions(xy), inclusion)


def fence_problems(mission: Mission) -> list[str]:
    """Return where a mission leaves its fence or enters a zone to keep out of, one sentence for each shape.

    Legs are straight in a local plane; the height is not considered. Several inclusions are checked one by
    one, as autopilots do: the flight has to stay in each. Rally points are checked likewise.
    """
    if not mission.fence:
        return []
    lat, lon, _ = mission.path
    bounds = shapely.bounds(shapely.points(lon, lat))
    plane = plane_around(bounds, mission.home.lon)
    flown = shapely.linestrings(np.column_stack(plane.xy_from_lonlat(lon, lat)))
    problems = []
    for number, shape in enumerate(mission.fence, start=1):
        area = area_of(shape, plane)
        wrong = flown.difference(area) if shape.inclusion else flown.intersection(area)
        if wrong.length > 0 or (not shape.inclusion and not wrong.is_empty):
            at_x, at_y = shapely.get_coordinates(wrong)[0]
            at_lon, at_lat = plane.lonlat_from_xy(at_x, at_y)
            breach = "leaves the fence" if shape.inclusion else "enters the zone to keep out of"
            problems.append(
                f"the flight {breach} (shape {number}) near {float(at_lat):.6f},{float(at_lon):.6f}, "
                f"for {wrong.length:.1f} m"
            )
        for rally, point in enumerate(mission.rally, start=1):
            x, y = plane.xy_from_lonlat(point.lon, point.lat)
            if shapely.intersects(area, shapely.Point(float(x), float(y))) != shape.inclusion:
                where = "outside of the fence" if shape.inclusion else "in the zone to keep out of"
                at = f"{point.lat:.6f},{point.lon:.6f}"
                problems.append(f"rally point {rally} at {at} lies {where} (shape {number})")
    return problems


def rally_of_flights(missions: Sequence[Mission]) -> list[Mission]:
    """Leave each flight the rally points that lie in its fence; a note names the others.

    A rally point that lies in no fence at all stays, for `fence_problems`.
    """
    inside = np.array(
        [[not fence_problems(replace(one, rally=(point,))) for point in one.rally] for one in missions]
    )
    flights = []
    for mission, here in zip(missions, inside, strict=True):
        left_out = ~here & inside.any(axis=0)
        notes = [
            f"rally point {number} lies outside of the fence of this flight, which has it not"
            for number in np.flatnonzero(left_out) + 1
        ]
        rally = tuple(point for point, out in zip(mission.rally, left_out, strict=True) if not out)
        flights.append(replace(mission, rally=rally, notes=(*mission.notes, *notes)))
    return flights


def area_of(shape: Fence, plane: Plane) -> shapely.Geometry:
    """Return the area of a shape; inclusions grow by a tolerance, exclusions hold all of their circle."""
    slack = TOLERANCE_M if shape.inclusion else 0.0
    if isinstance(shape, FenceCircle):
        x, y = plane.xy_from_lonlat(shape.lon, shape.lat)
        around = 1.0 if shape.inclusion else 1 / math.cos(math.pi / (4 * CIRCLE_QUARTER))
        radius = shape.radius_m * around + slack
        return shapely.buffer(shapely.Point(float(x), float(y)), radius, quad_segs=CIRCLE_QUARTER)
    lat, lon = np.array(shape.vertices).T
    return shapely.buffer(shapely.Polygon(np.column_stack(plane.xy_from_lonlat(lon, lat))), slack)


@dataclass(frozen=True, eq=False)
class SafetyCheck:
    """Requirements that a mission is checked against."""

    safety: SafetyParams = SafetyParams()
    zones: Sequence[Any] = ()  # keep-out zones, shapely in degrees (lon, lat; WGS 84)
    clearance: Clearance | None = None  # above the ground; without it, heights above home are checked

    def __post_init__(self) -> None:
        if self.safety.zone_height_m is not None and not len(self.zones):
            raise ParameterError("--zone-height is for keep-out zones; give some (--avoid), or leave it out")

    def check(self, mission: Mission) -> None:
        """Raise MissionError with the first of the `problems` of a mission."""
        for problem in self.problems(mission):
            raise MissionError(problem)

    def problems(self, mission: Mission) -> Iterator[str]:
        """Yield why a mission must not be flown, one sentence each.

        A leg or rally point comes too near to a zone or to the ground, lies outside of the fence, is too
        high, or too far from home.
        """
        plane = Plane(mission.home.lat, mission.home.lon)
        lat, lon, height = mission.path
        xy = np.column_stack(plane.xy_from_lonlat(lon, lat))
        rally = mission.rally
        rally_xy = [plane.xy_from_lonlat(point.lon, point.lat) for point in rally]

        def corner_name(k: int) -> str:
            return f"the position {lat[k]:.6f},{lon[k]:.6f}"

        def leg_name(k: int) -> str:
            return f"the leg from {lat[k]:.6f},{lon[k]:.6f} to {lat[k + 1]:.6f},{lon[k + 1]:.6f}"

        def rally_name(k: int) -> str:
            return f"rally point {k + 1} at {rally[k].lat:.6f},{rally[k].lon:.6f}"

        if len(self.zones):
            zones = shapely.STRtree(shapely.make_valid(plane.project_polygons(self.zones)))
            above = np.minimum(height[:-1], height[1:]) >= self.safety.over_zones_m - SLACK_M
            # certain where heights are above home, and landings on the ground
            positions = [item for item in mission.items if item.has_position]
            above &= all(item.frame == mav.FRAME_RELATIVE for item in positions)
            above &= not any(item.altitude_m for item in positions if item.command in mav.LANDINGS)
            legs = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
            legs[above] = None
            yield from self._near_zones(zones, legs, leg_name)
            yield from self._near_zones(zones, [shapely.Point(place) for place in rally_xy], rally_name)
        yield from fence_problems(mission)
        highest_m = self.safety.max_altitude_m
        if self.clearance is not None:
            yield from self.clearance.problems(mission, highest_m + HEIGHT_SLACK_M)
        else:
            rally_m = [point.altitude_m for point in rally]
            for heights, name in ((height, corner_name), (rally_m, rally_name)):
                for place, height_m in _greatest_above(heights, highest_m + HEIGHT_SLACK_M, name):
                    yield (
                        f"{place} is {height_m:.1f} m high, above the {highest_m:g} m that are allowed "
                        "(--max-altitude)"
                    )
        farthest_m = self.safety.max_distance_m
        if farthest_m is None:
            return
        rally_away = [float(np.hypot(*place)) for place in rally_xy]
        for distances, name in ((np.hypot(*xy.T), corner_name), (rally_away, rally_name)):
            for place, distance_m in _greatest_above(distances, farthest_m, name):
                yield (
                    f"{place} is {distance_m:.0f} m from home, farther than the {farthest_m:g} m that are "
                    "allowed (--max-distance)"
                )

    def _near_zones(self, zones: shapely.STRtree, shapes: Any, name: Name) -> Iterator[str]:
        (which, _), distance = zones.query_nearest(shapes, return_distance=True, all_matches=False)
        if not len(which):
            return
        nearest, safety = int(distance.argmin()), self.safety
        if distance[nearest] < safety.avoid_margin_m - SLACK_M or distance[nearest] == 0:
            yield (
                f"{name(int(which[nearest]))} comes within {distance[nearest]:.1f} m of a keep-out zone, "
                f"and at least {safety.avoid_margin_m:g} m are kept"
            )


def _greatest_above(
    values: Sequence[float] | Floats, limit: float, name: Name
) -> Iterator[tuple[str, float]]:
    """Yield the name and value of the greatest value, if it is above a limit."""
    if len(values) and values[k := int(np.argmax(values))] > limit:
        yield name(k), float(values[k])
