"""Flights of a route: divided within the limits of each in the wind that blows, as missions, with notes."""

import math
from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np
import shapely

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import MissionError
from uavseg.flight.mission.duration import CALM, leg_seconds
from uavseg.flight.mission.estimate import estimate, landing_seconds
from uavseg.flight.mission.items import WAYPOINT, HomePosition
from uavseg.flight.mission.mission import BOARD_CAPACITY, Mission
from uavseg.flight.mission.track import SAME_PLACE_M, Plane, Track
from uavseg.flight.mission.vehicle import LEAST_WAY_M_S, Wind
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.along import items_along
from uavseg.flight.planning.split import FlightLimits, RegionRoute, items_of, split_route
from uavseg.flight.safety.check import fence_around, rally_of_flights
from uavseg.flight.safety.keep_out import KeepOut, return_notes
from uavseg.flight.terrain.altitude_profile import LegPoints, points_of_leg
from uavseg.flight.terrain.follow import fewest_changes, follow_ground, speed_notes, with_speeds

FIXED_ITEMS = 5  # takeoff, speed, gimbal, return, and one in reserve
ATTEMPTS = 8
SEPARATION_M = 5.0  # between the heights of vehicles that are in the air at once
USUAL_WIND_M_S = 5.0  # where no wind is given, the reserve holds in this one, from any direction


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
    route: RegionRoute, home: HomePosition, plane: Plane, keep_out: KeepOut, params: PlanParams, wind: Wind
) -> tuple[list[Track], list[Mission]]:
    """Return the tracks and missions of flights, those of one vehicle after those of another."""
    limits, vehicles = params.limits, params.limits.vehicles
    allowed = flight_limits(_worst_costs(route, plane, params, wind), params)
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
        items = math.floor(allowed.items * (0.99 / max(larger, 0.99)))
        allowed = replace(allowed, seconds=allowed.seconds * (0.99 / max(slower, 0.99)), items=items)
    raise MissionError(
        "no way to divide the mission was found whose flights fit; give more --endurance or --max-items"
    )


def flight_limits(costs: "LegCosts", params: PlanParams) -> FlightLimits:
    """Return the limits of flights, with the costs that count against them."""
    vehicle, limits = params.flown_by, params.limits
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
        f"{vehicles} vehicles fly at once, {of_each}: at {params.altitude_m:.1f} m, and each "
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
    vehicle = params.flown_by
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

    def ways(self, home: Floats, places: Floats, length_m: Floats) -> tuple[Floats, Floats]:
        """Return the time from home (2,) to places (n, 2) and back, over level ground, from rest to rest.

        Where ways are longer than straight, `length_m` (n,), they are stretched. A straight way back is a
        return with its speed, height and landing; else it is that of the mission where that takes longer.
        """
        vehicle, height = self.params.flown_by, self.params.altitude_m
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
        path = np.full((2 * len(places) + 1, 3), self.params.altitude_m, np.float64)
        path[::2, :2], path[1::2, :2] = home, places
        stops = np.ones(len(path), bool)
        wind = self.wind
        if self.is_against:
            speed_m_s, wind = min(speed_m_s, self.params.flown_by.airspeed_m_s - wind.speed_m_s), CALM
        seconds = leg_seconds(path, speed_m_s, self.params.flown_by, stops, wind=wind)
        return seconds[::2], seconds[1::2]

    def of(self, track: Track) -> tuple[Floats, Floats]:
        """Return the time of each leg, with the hold at its end, and its items besides corners, (n - 1,).

        Items are changes of speed, and points that are added over uneven ground.
        """
        legs = len(track.is_line)
        if not legs:
            return np.zeros(0), np.zeros(0)
        counts, points = self._points(track, fewest_changes(track, self.params))
        first = np.concatenate([[0], np.cumsum(counts[:-1])])
        of_leg = np.repeat(np.arange(legs), counts)
        xy = track.xy[of_leg] + points.share[:, None] * (track.xy[of_leg + 1] - track.xy[of_leg])
        path = np.column_stack([np.concatenate([track.xy[:1], xy]), points.height_m])
        speed = points.speed_m_s
        hold = np.zeros(len(path))
        hold[np.append(0, first + counts)] = track.hold_s
        seconds = np.add.reduceat(
            leg_seconds(path, speed, self.params.flown_by, hold > 0, hold, self.wind) + hold[1:], first
        )
        change = np.diff(speed, prepend=speed[0])
        slower = (change < 0) & np.isin(np.arange(len(speed)), first)  # with a point before the line
        changes: Floats = np.add.reduceat((change != 0) + slower.astype(float), first)
        return seconds, changes + counts - 1

    def _points(self, track: Track, speeds: Floats) -> tuple[Integers, LegPoints]:
        """Return the number of points of each leg, and those of all legs, one after the other."""
        terrain = self.params.terrain
        if terrain is None or terrain.dem is None:
            ends = np.ones(len(speeds), np.int64)
            height = np.full(len(speeds) + 1, self.params.altitude_m, np.float64)
            return ends, LegPoints(share=ends.astype(np.float64), height_m=height, speed_m_s=speeds)
        lon, lat = self.plane.lonlat_from_xy(*track.xy.T)
        places = np.column_stack([lon[:-1], lat[:-1], lon[1:], lat[1:], speeds])
        keys = [tuple(place) for place in places.tolist()]
        for key in keys:
            if key not in self._known:
                self._known[key] = points_of_leg(terrain.dem, key, self.params)
        legs = [self._known[key] for key in keys]
        heights = [legs[0].height_m[:1], *(leg.height_m[1:] for leg in legs)]
        return np.array([len(leg.share) for leg in legs]), LegPoints(
            share=np.concatenate([leg.share for leg in legs]),
            height_m=np.concatenate(heights),
            speed_m_s=np.concatenate([leg.speed_m_s for leg in legs]),
        )
