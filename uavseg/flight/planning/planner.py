"""Mission planner: polygons to missions. Read this first."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.items import HomePosition
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Track
from uavseg.flight.params.plan import MAX_MARGIN_M, PARAMS_OF, PerimeterParams, PlanParams
from uavseg.flight.patterns import candidates as patterns
from uavseg.flight.patterns.survey_blocks import blocks_of_surveys
from uavseg.flight.planning.along import home_notes
from uavseg.flight.planning.flights import missions_over
from uavseg.flight.planning.route import check_order, short_route
from uavseg.flight.planning.targets import clear_parts, plane_of, region_parts
from uavseg.flight.safety.keep_out import KeepOut, near_zones
from uavseg.flight.terrain.follow import home_on_ground

Floats = NDArray[np.float64]

MAX_WAYPOINTS = 20_000
"""Of all flights together: 30 full boards."""
MIN_REACH_M = 100.0
_PATTERN_FUNCTIONS = {
    "visit": patterns.visits,
    "perimeter": patterns.perimeters,
    "survey": patterns.surveys,
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

    Parameters
    ----------
    polygons : sequence of shapely Polygon or MultiPolygon
        The regions in degrees (lon, lat; WGS 84). The parts of a region are flown one by one; parts that
        touch, as at the antimeridian, are merged.
    points : sequence of (lon, lat)
        A point inside each region.
    params : PlanParams
    home : (lat, lon) or (lat, lon, altitude_m)
        Where the vehicle starts; its altitude is in metres above the sea.
    zones : sequence of shapely Polygon or MultiPolygon
        Keep-out zones in degrees: no leg comes nearer to them than the margin of `params`.

    Returns
    -------
    missions : tuple of Mission
        More than one where the limits of `params` require it.

    Raises
    ------
    MissionError
        If there are no regions, they are not near home, zones make a region or home unreachable, a part of
        the mission does not fit into a flight, or the mission would not be safe.
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
    keep_out = KeepOut(near, params.safety.avoid_margin_m)
    if not keep_out.space.is_free(place[None])[0]:
        raise MissionError(
            "home lies in a keep-out zone or its margin; choose another home or a smaller --avoid-margin"
        )
    parts, zone_notes = clear_parts(region_parts(regions, plane, points), keep_out)
    candidates = _PATTERN_FUNCTIONS[params.pattern](parts, params)
    _check_count(candidates)
    route = short_route(_reachable(candidates, place, keep_out), place, keep_out.space)
    notes = [*home_notes(home), *at_home, *zone_notes, *candidates.notes]
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
    lines = 2 * (params.spacing_m or 0) + 2 * params.safety.avoid_margin_m
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
