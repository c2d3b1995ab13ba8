"""Flights over a route: missions that each fit their limits, with photographs, fence and estimates."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.duration import leg_seconds
from uavseg.flight.mission.estimate import estimate
from uavseg.flight.mission.flown import landing_seconds
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.mission import BOARD_CAPACITY, Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.track import Track
from uavseg.flight.mission.vehicle import Vehicle, default_vehicle
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.along import items_along
from uavseg.flight.planning.route import RegionRoute
from uavseg.flight.planning.split import FlightLimits, split_route
from uavseg.flight.safety.fence import fence_around, rally_of_flights
from uavseg.flight.safety.keep_out import KeepOut, return_notes
from uavseg.flight.terrain.altitude_profile import LegPoints, points_of_leg
from uavseg.flight.terrain.follow import follow_ground
from uavseg.flight.terrain.leg_speeds import fewest_changes, speed_notes, with_speeds

Floats = NDArray[np.float64]

FIXED_ITEMS = 5  # takeoff, speed, gimbal, return, and one in reserve
ATTEMPTS = 8


def missions_over(
    route: RegionRoute,
    home: HomePosition,
    plane: Plane,
    keep_out: KeepOut,
    params: PlanParams,
    notes: list[str],
) -> tuple[Mission, ...]:
    """Split a route into missions that are within their limits by the estimates of complete missions.

    Parameters
    ----------
    route : RegionRoute
    home : HomePosition
    plane : Plane
        Of the route.
    keep_out : KeepOut
    params : PlanParams
    notes : list of str
        For all missions; some are added.
    """
    vehicle, limits = params.vehicle or default_vehicle(params.autopilot), params.limits
    max_items = limits.max_items or BOARD_CAPACITY[params.autopilot]
    climb_s = params.altitude_m / vehicle.climb_m_s + landing_seconds(params.altitude_m, vehicle)
    costs = LegCosts(plane, params)
    allowed = FlightLimits(
        seconds=limits.seconds,
        items=max_items,
        fixed_s=climb_s + vehicle.return_hold_s,
        fixed_items=FIXED_ITEMS,
        leg_seconds=costs.level_seconds,
        costs=costs.of,
        return_seconds=costs.return_seconds,
    )
    for _ in range(ATTEMPTS):
        parts = [track.without_repeats() for track in split_route(route, allowed)]
        tracks = [with_speeds(track, route.home, params) for track in parts]
        missions = [_mission(track, home, plane, keep_out, params) for track in tracks]
        slower = max(estimate(mission).duration_s for mission in missions) / limits.seconds
        larger = max(len(mission.items) for mission in missions) / max_items
        if slower <= 1 and larger <= 1:
            break
        allowed = allowed.tighter(0.99 / max(slower, 0.99), 0.99 / max(larger, 0.99))
    else:
        raise MissionError(
            "no way to divide the mission was found whose flights fit; give more --endurance or --max-items"
        )
    notes += speed_notes(tracks, params)
    if len(missions) > 1:
        notes.append(f"the mission is divided into {len(missions)} flights, each from home and back")
        missions = rally_of_flights(missions) if params.safety.rally else missions
    return tuple(replace(mission, notes=(*notes, *mission.notes)) for mission in missions)


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
    )


@dataclass(frozen=True, slots=True, eq=False)
class LegCosts:
    """Time and items of legs, by the functions that make the items of flights; each leg is measured once."""

    plane: Plane
    params: PlanParams
    _known: dict[tuple[float, ...], LegPoints] = field(default_factory=dict)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of the plan, or the default one of its autopilot."""
        return self.params.vehicle or default_vehicle(self.params.autopilot)

    def level_seconds(self, xy: Floats) -> Floats:
        """Return the time of each leg of a path (n, 2) in metres over level ground."""
        height = np.full(len(xy), self.params.altitude_m)
        return leg_seconds(np.column_stack([xy, height]), self.params.speed_m_s, self.vehicle)

    def return_seconds(self, length_m: float) -> float:
        """Return the minimum time of a return over level ground, with its speed, height and landing."""
        vehicle, height = self.vehicle, self.params.altitude_m
        above = max(min(vehicle.return_height_m, vehicle.return_slope * length_m), height)
        path = np.array([(0.0, 0.0, height), (0.0, 0.0, above), (length_m, 0.0, above)])
        landing_s = landing_seconds(above, vehicle) - landing_seconds(height, vehicle)
        return float(leg_seconds(path, vehicle.return_speed_m_s, vehicle).sum()) + landing_s

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
        seconds = np.add.reduceat(leg_seconds(path, speed, self.vehicle, hold > 0, hold) + hold[1:], first)
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
