"""Notes for the pilot of a flight over the ground of an elevation model."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from uavseg.flight.mission.vehicle import returning_vehicles
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.params.terrain import FRAME, RELATIVE
from uavseg.flight.terrain.flown import Flown, rates_m_s
from uavseg.flight.terrain.heights import Heights
from uavseg.flight.terrain.way_back import Rise, WaysBack, ways_back

Floats = NDArray[np.float64]

OWN_TERRAIN = (
    "heights are above the terrain that the vehicle itself knows (ArduPilot: TERRAIN_ENABLE 1, data of the "
    "place on board); give --dem to have slopes and the way home checked"
)
RETURN_SLACK_M = 1.0
RAISED_M = 0.05  # a smaller difference is not reported


def terrain_notes(
    flown: Flown, heights: Heights, asked_m_s: Floats, params: PlanParams, leads_home: bool
) -> Iterator[str]:
    """What the pilot of a flight over the ground should know.

    Parameters
    ----------
    flown : Flown
    heights : Heights
    asked_m_s : (n,) float64 array
        The speed on the leg to each waypoint where it is not too steep.
    params : PlanParams
        With a DEM.
    leads_home : bool
        Whether points were added for the way home.
    """
    terrain, profile = params.terrain, flown.profile
    assert terrain is not None and terrain.dem is not None
    dem, ground_m = terrain.dem, float(profile.upper_m[0])
    within = f"{params.altitude_m:g} m above the ground within {terrain.tolerance_for(params.altitude_m):g} m"
    points = int(heights.added.sum())
    added = f"{within}; {points} point{'s are' if points != 1 else ' is'} added where it bends"
    if terrain.mode == FRAME:
        yield (
            "heights are above the terrain that the vehicle itself knows (ArduPilot: TERRAIN_ENABLE 1, data "
            f"of the place on board), not above {dem.name}, by which only slopes and the way home are checked"
        )
    elif terrain.mode == RELATIVE:
        yield (
            f"heights are above home, whose ground ({ground_m:.1f} m) is that of {dem.name} too: {added}; "
            "take off there, a higher or lower place moves the whole flight"
        )
    else:
        yield (
            f"heights are above the sea, from {dem.name}: {added}; before takeoff, compare the vehicle's own "
            f"height above the sea with that of home ({ground_m:.1f} m), a difference moves the whole flight"
        )
    yield from dem.notes()
    yield from _slope_notes(flown, heights, asked_m_s, params)
    back = ways_back(dem, profile)
    yield from _return_notes(back.highest, ground_m, params.altitude_m, leads_home)
    yield from _early_return_notes(back, flown, params)


def _slope_notes(flown: Flown, heights: Heights, asked_m_s: Floats, params: PlanParams) -> Iterator[str]:
    terrain, profile = params.terrain, flown.profile
    assert terrain is not None
    climb, descent = rates_m_s(params, terrain)
    slow = heights.speed_m_s < asked_m_s
    if slow.any():
        legs, speed = int(slow.sum()), float(heights.speed_m_s[slow].min())
        yield (
            f"the speed is lowered on {legs} leg{'s' * (legs != 1)}, down to {speed:g} m/s, where the ground "
            f"is too steep for {float(asked_m_s[slow].max()):g} m/s with a climb of {climb:g} and a descent "
            f"of {descent:g} m/s"
        )
    raised = flown.target_m - params.altitude_m - profile.upper_m
    k = int(raised.argmax())
    if raised[k] > RAISED_M:
        place = f"lat {profile.lat[k]:.6f}, lon {profile.lon[k]:.6f}"
        if terrain.mode == FRAME:
            yield f"the ground at {place} is steeper than the vehicle climbs or descends: it may come nearer"
        else:
            yield (
                f"the flight is up to {raised[k]:.1f} m higher above the ground, at {place}, next to ground "
                "that is steeper than the vehicle climbs or descends"
            )


def _return_notes(rise: Rise, ground_m: float, altitude_m: float, leads_home: bool) -> Iterator[str]:
    if leads_home:
        yield "waypoints lead home above the ground: a level return would be too low or too high somewhere"
    above_home = rise.height_m - ground_m
    if above_home > 0.1 * altitude_m:
        yield (
            f"on straight ways from the flight to home the ground rises to {above_home:.0f} m above home, at "
            f"lat {rise.lat:.6f}, lon {rise.lon:.6f}: for a return that starts early, set the autopilot's "
            f"return altitude (RTL_ALT, RTL_RETURN_ALT) to {np.ceil(above_home + altitude_m):.0f} m at least"
        )
    if rise.is_incomplete:
        yield (
            "the elevation model has holes between the flight and home: returns that start early are not "
            "checked there"
        )


def _early_return_notes(back: WaysBack, flown: Flown, params: PlanParams) -> Iterator[str]:
    """Where a level return that starts early would be too low or too high above the ground."""
    terrain = params.terrain
    assert terrain is not None
    least_m = params.altitude_m - terrain.tolerance_for(params.altitude_m)
    most_m = params.safety.max_altitude_m
    found = [
        back.returns(flown.height_m, vehicle)
        for vehicle in returning_vehicles(params.vehicle, params.autopilot)
    ]
    low = min(found, key=lambda one: one.lowest_m)
    high = max(found, key=lambda one: one.highest_m)
    if low.lowest_m < least_m - RETURN_SLACK_M:
        lat, lon = low.lowest_from
        near = f"comes within {low.lowest_m:.0f} m of" if low.lowest_m > 0 else "leads into"
        yield (
            f"a return that starts early is level: from lat {lat:.6f}, lon {lon:.6f} it "
            f"{near} the ground at the usual return altitude; set it higher"
        )
    if high.highest_m > most_m + RETURN_SLACK_M:
        lat, lon = high.highest_from
        yield (
            f"a return that starts early is level: from lat {lat:.6f}, lon {lon:.6f} it leads "
            f"{high.highest_m:.0f} m above lower ground, and {most_m:g} m are allowed (--max-altitude)"
        )
