"""Flights over a route: missions that each fit their limits, with photographs, fence and estimates."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.estimate import estimate
from uavseg.flight.mission.flown import landing_seconds
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.mission import BOARD_CAPACITY, Mission
from uavseg.flight.mission.plane import Plane
from uavseg.flight.mission.track import Track
from uavseg.flight.mission.vehicle import default_vehicle
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.along import items_along
from uavseg.flight.planning.leg_costs import LegCosts
from uavseg.flight.planning.route import Route
from uavseg.flight.planning.split import FlightLimits, split_route
from uavseg.flight.safety.early_return import return_notes
from uavseg.flight.safety.fence_around import fence_around
from uavseg.flight.safety.fence_check import rally_of_flights
from uavseg.flight.safety.keep_out import KeepOut
from uavseg.flight.terrain.follow import follow_ground
from uavseg.flight.terrain.leg_speeds import speed_notes, with_speeds

Floats = NDArray[np.float64]

FIXED_ITEMS = 5  # takeoff, speed, gimbal, return, and one in reserve
ATTEMPTS = 8


def missions_over(
    route: Route, home: HomePosition, plane: Plane, keep_out: KeepOut, params: PlanParams, notes: list[str]
) -> tuple[Mission, ...]:
    """The missions over a route, each within its limits, as the estimates of complete missions say."""
    vehicle, limits = params.vehicle or default_vehicle(params.autopilot), params.limits
    most_items = limits.max_items or BOARD_CAPACITY[params.autopilot]
    climb_s = params.altitude_m / vehicle.climb_m_s + landing_seconds(params.altitude_m, vehicle)
    costs = LegCosts(plane, params)
    fixed_s = climb_s + vehicle.return_hold_s
    allowed = FlightLimits(
        limits.seconds, most_items, fixed_s, FIXED_ITEMS, costs.level_seconds, costs.of, costs.return_seconds
    )
    for _ in range(ATTEMPTS):
        parts = [track.without_repeats() for track in split_route(route, allowed)]
        tracks = [with_speeds(track, route.home, params) for track in parts]
        missions = [_mission(track, home, plane, keep_out, params) for track in tracks]
        slower = max(estimate(mission).duration_s for mission in missions) / limits.seconds
        larger = max(len(mission.items) for mission in missions) / most_items
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
    """One flight with its fence."""
    path = follow_ground(track.in_degrees(plane), home, params)
    items = items_along(path.track, home, params, path.heights)
    place = np.column_stack(plane.xy_from_lonlat([home.lon], [home.lat]))
    flown = np.concatenate([place, track.xy, place])
    margin_m = params.safety.fence_margin_m
    fence, notes = ((), []) if margin_m is None else fence_around(flown, keep_out, margin_m, plane)
    notes += return_notes(flown, keep_out, plane, params)
    return Mission(
        home,
        items,
        params.autopilot,
        params.name,
        (*path.notes, *notes),
        fence=fence,
        rally=params.safety.rally,
        vehicle=params.vehicle,
        photos=params.photos,
        ground=path.ground,
        endurance_s=None if params.limits.endurance_min is None else 60 * params.limits.endurance_min,
    )
