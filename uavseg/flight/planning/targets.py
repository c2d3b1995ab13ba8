"""Targets of a flight: the connected parts of regions in a local plane, outside of keep-out zones."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import MissionError
from uavseg.flight.mission.items import MAX_DISTANCE_M, HomePosition, check_near, check_position, distance_m
from uavseg.flight.mission.plane import Plane, plane_around
from uavseg.flight.patterns.candidates import RegionPart
from uavseg.flight.safety.keep_out import KeepOut

Floats = NDArray[np.float64]

MAX_LISTED = 10  # places in a message
MIN_SHARE = 0.01  # of a region: smaller pieces that zones leave of it are not flown


def plane_of(polygons: Sequence[Any], points: Sequence[tuple[float, float]], home: HomePosition) -> Plane:
    """Return the local plane of regions; refuse regions that are not on Earth, or not near home.

    Parameters
    ----------
    polygons : sequence of shapely Polygon or MultiPolygon
        In degrees (lon, lat).
    points : sequence of (lon, lat)
        A point inside each region.
    home : HomePosition
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

    Parameters
    ----------
    regions : iterable of shapely Polygon or MultiPolygon
        In metres.
    plane : Plane
    points : sequence of (lon, lat)
    """
    parts = []
    for region, lonlat in zip(regions, points, strict=True):
        x, y = map(float, plane.xy_from_lonlat(*lonlat))
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
    """Return the parts of regions outside of keep-out zones, and a note of the area inside.

    Parameters
    ----------
    parts : list of RegionPart
    keep_out : KeepOut
    """
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
