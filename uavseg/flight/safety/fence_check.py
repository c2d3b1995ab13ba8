"""Fence check: legs and rally points of a mission inside of its inclusions and outside of its exclusions."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely

from uavseg.flight.mission.fence import Fence, FenceCircle, RallyPoint
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.plane import Plane, plane_around

CIRCLE_QUARTER = 64  # sides of a quarter of a circle
TOLERANCE_M = 0.01


def fence_problems(mission: Mission) -> list[str]:
    """Where a mission leaves its fence or enters a zone to keep out of, one sentence for each shape.

    Legs are straight in a local plane; the height is not considered. Several inclusions are checked one by
    one, as autopilots do: the flight has to stay in each. Rally points are checked likewise.
    """
    if not mission.fence:
        return []
    lat, lon, _ = mission.path
    bounds = shapely.bounds(shapely.points(lon, lat))
    plane = plane_around(bounds, mission.home.lon)
    flown = shapely.linestrings(np.column_stack(plane.xy_from_lonlat(lon, lat)))
    found = []
    for number, shape in enumerate(mission.fence, start=1):
        area = _area(shape, plane)
        wrong = flown.difference(area) if shape.inclusion else flown.intersection(area)
        if wrong.length > 0 or (not shape.inclusion and not wrong.is_empty):
            at_x, at_y = shapely.get_coordinates(wrong)[0]
            at_lon, at_lat = plane.lonlat_from_xy(at_x, at_y)
            what = "leaves the fence" if shape.inclusion else "enters the zone to keep out of"
            found.append(
                f"the flight {what} (shape {number}) near {float(at_lat):.6f},{float(at_lon):.6f}, "
                f"for {wrong.length:.1f} m"
            )
        found += _rally_problems(mission, area, shape.inclusion, number, plane)
    return found


def rally_of_flights(missions: Sequence[Mission]) -> list[Mission]:
    """Several flights, each with those rally points that lie in its own fence; a note names the others.

    A rally point that lies in no fence at all stays, for `fence_problems`.
    """
    inside = np.array([[_keeps(mission, point) for point in mission.rally] for mission in missions])
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


def _keeps(mission: Mission, point: RallyPoint) -> bool:
    return not fence_problems(replace(mission, rally=(point,)))


def _rally_problems(
    mission: Mission, area: shapely.Geometry, inclusion: bool, number: int, plane: Plane
) -> Iterator[str]:
    for rally, point in enumerate(mission.rally, start=1):
        x, y = plane.xy_from_lonlat(point.lon, point.lat)
        if shapely.intersects(area, shapely.Point(float(x), float(y))) != inclusion:
            where = "outside of the fence" if inclusion else "in the zone to keep out of"
            yield f"rally point {rally} at {point.lat:.6f},{point.lon:.6f} lies {where} (shape {number})"


def _area(shape: Fence, plane: Plane) -> shapely.Geometry:
    """The area of a shape; inclusions are larger by a tolerance, and exclusions hold all of their circle."""
    slack = TOLERANCE_M if shape.inclusion else 0.0
    if isinstance(shape, FenceCircle):
        x, y = plane.xy_from_lonlat(shape.lon, shape.lat)
        around = 1.0 if shape.inclusion else 1 / math.cos(math.pi / (4 * CIRCLE_QUARTER))
        radius = shape.radius_m * around + slack
        return shapely.buffer(shapely.Point(float(x), float(y)), radius, quad_segs=CIRCLE_QUARTER)
    lat, lon = np.array(shape.vertices).T
    return shapely.buffer(shapely.Polygon(np.column_stack(plane.xy_from_lonlat(lon, lat))), slack)
