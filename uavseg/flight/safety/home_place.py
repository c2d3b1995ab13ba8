"""A place for home outside of all regions and keep-out zones, near to what is flown."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import shapely

from uavseg.errors import MissionError
from uavseg.flight.avoid.enclosing import MANY_CORNERS, enclosing
from uavseg.flight.plane import plane_around
from uavseg.flight.safety.keep_out import KeepOut

IsGround = Callable[[float, float], bool]

CLEARANCE_M = 15.0
"""Distance from home to regions and to zones with their margin."""
STEP_M = 5.0
MOST_TRIED = 5000
_DECIMALS = 7  # of degrees: a centimetre


def home_outside(
    polygons: Sequence[Any],
    points: Sequence[tuple[float, float]],
    zones: Sequence[Any] = (),
    avoid_margin_m: float = 0.0,
    is_ground: IsGround | None = None,
) -> tuple[float, float]:
    """The place nearest to the middle of all regions that lies outside of them and of keep-out zones.

    A place that a region or zone encloses, such as an island, is not taken: people may not get there.

    Parameters
    ----------
    polygons : sequence of shapely Polygon or MultiPolygon
        In degrees (lon, lat; WGS 84).
    points : sequence of (lon, lat)
        A point inside each.
    zones : sequence of shapely Polygon or MultiPolygon
        In degrees.
    avoid_margin_m : float
    is_ground : function, optional
        Whether a place (lat, lon) may be home; by default every place may.

    Returns
    -------
    lat, lon : float

    Raises
    ------
    MissionError
        If there are no regions, or none of the nearest places may be home.
    """
    if not len(polygons):
        raise MissionError("there is no region to fly to; choose at least one")
    bounds = shapely.bounds(shapely.get_parts(np.array(polygons, dtype=object)))
    plane = plane_around(bounds, points[0][0])
    regions = shapely.make_valid(plane.project_polygons(polygons))
    keep_out = KeepOut(list(plane.project_polygons(zones)), avoid_margin_m)
    area = shapely.union_all([*regions, keep_out.grown])
    if shapely.get_num_coordinates(area) > MANY_CORNERS:
        area = enclosing(_without_holes(area), CLEARANCE_M / 10)
    grown = shapely.buffer(area, CLEARANCE_M, quad_segs=4)
    outlines = shapely.get_exterior_ring(shapely.get_parts(_without_holes(grown)))
    places = shapely.get_coordinates(shapely.segmentize(outlines, STEP_M))
    middle = np.mean(np.column_stack(plane.xy_from_lonlat(*np.array(points).T)), axis=0)
    nearest = places[np.argsort(np.hypot(*(places - middle).T), kind="stable")[:MOST_TRIED]]
    for lon, lat in np.round(np.column_stack(plane.lonlat_from_xy(*nearest.T)), _DECIMALS).tolist():
        if is_ground is None or is_ground(lat, lon):
            return lat, lon
    raise MissionError(
        "no place for home was found near the regions on valid pixels of the raster; give --home LAT,LON"
    )


def _without_holes(polygons: Any) -> Any:
    filled = [shapely.Polygon(ring) for ring in shapely.get_exterior_ring(shapely.get_parts(polygons))]
    return shapely.union_all(filled)
