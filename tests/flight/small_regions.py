"""Small regions around a home, and missions over them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from uavseg.flight.mission.items import WAYPOINT
from uavseg.flight.mission.mission import Mission
from uavseg.flight.mission.track import Plane
from uavseg.flight.params.plan import PlanParams
from uavseg.flight.planning.planner import plan_missions

HOME = (47.0, 8.0, 430.0)


def box(east_m: float, north_m: float, width_m: float, height_m: float) -> shapely.Polygon:
    """A box, so many metres from home."""
    return degrees(shapely.box(east_m, north_m, east_m + width_m, north_m + height_m))


def degrees(polygon: shapely.Polygon, plane: Plane = Plane(47.0, 8.0)) -> shapely.Polygon:  # noqa: B008
    return shapely.transform(polygon, lambda xy: np.column_stack(plane.lonlat_from_xy(*xy.T)))


def inside(polygons: Sequence[Any]) -> list[tuple[float, float]]:
    return [tuple(shapely.point_on_surface(polygon).coords[0]) for polygon in polygons]


def plan_mission(
    polygons: Sequence[Any],
    points: Sequence[tuple[float, float]],
    params: PlanParams,
    home: tuple[float, ...],
) -> Mission:
    """A plan of one flight."""
    (mission,) = plan_missions(polygons, points, params, home)
    return mission


def planned(
    polygons: Sequence[Any], home: tuple[float, ...] = HOME, zones: Sequence[Any] = (), **params: Any
) -> Mission:
    (mission,) = flights(polygons, home, zones, **params)
    return mission


def flights(
    polygons: Sequence[Any], home: tuple[float, ...] = HOME, zones: Sequence[Any] = (), **params: Any
) -> tuple[Mission, ...]:
    """Flights over regions; survey lines run north unless another azimuth is given (None: the best one)."""
    north = {"angle_deg": 0.0} if params.get("pattern") == "survey" else {}
    flown = PlanParams(**{"altitude_m": 60} | north | params)
    return plan_missions(polygons, inside(polygons), flown, home, zones)


def waypoints(mission: Mission) -> list[tuple[float, float]]:
    return [(item.lon, item.lat) for item in mission.items if item.command == WAYPOINT]
