"""Small regions around a home, and missions over them."""

from typing import Any

import numpy as np
import shapely

from uavseg.flight.items import WAYPOINT
from uavseg.flight.mission import Mission
from uavseg.flight.params import PlanParams
from uavseg.flight.plane import Plane
from uavseg.flight.planner import plan_mission

HOME = (47.0, 8.0, 430.0)


def box(east_m: float, north_m: float, width_m: float, height_m: float) -> shapely.Polygon:
    """A box, so many metres from home."""
    return degrees(shapely.box(east_m, north_m, east_m + width_m, north_m + height_m))


def degrees(polygon: shapely.Polygon, plane: Plane = Plane(47.0, 8.0)) -> shapely.Polygon:  # noqa: B008
    return shapely.transform(polygon, lambda xy: np.column_stack(plane.lonlat_from_xy(*xy.T)))


def inside(polygons: list[shapely.Polygon]) -> list[tuple[float, float]]:
    return [tuple(shapely.point_on_surface(polygon).coords[0]) for polygon in polygons]


def planned(polygons: list[shapely.Polygon], home: tuple[float, ...] = HOME, **params: Any) -> Mission:
    return plan_mission(polygons, inside(polygons), PlanParams(**{"altitude_m": 60} | params), home)


def waypoints(mission: Mission) -> list[tuple[float, float]]:
    return [(item.lon, item.lat) for item in mission.items if item.command == WAYPOINT]
