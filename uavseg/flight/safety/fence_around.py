"""The fence of a flight: a hull around its path to stay inside of, and its keep-out zones to stay out of."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.flight.mission.fence import FencePolygon
from uavseg.flight.mission.plane import Plane
from uavseg.flight.safety.keep_out import KeepOut

Floats = NDArray[np.float64]

MAX_VERTICES = 64
"""Of all polygons together: what PX4 stores for its fence, and about what common boards with ArduPilot do."""
_DECIMALS = 8  # of degrees: a millimetre


def fence_around(
    path: Floats, keep_out: KeepOut, margin_m: float, plane: Plane
) -> tuple[tuple[FencePolygon, ...], list[str]]:
    """The fence around a path, and notes on it.

    Parameters
    ----------
    path : (n, 2) float64 array
        All corners of the flight with home, in metres.
    keep_out : KeepOut
    margin_m : float
        Distance from the path to the hull, at least.
    plane : Plane

    Returns
    -------
    fence : tuple of FencePolygon
        The hull (inclusion), and each zone that it meets with half of its margin, or less (exclusion).
        Where these have more vertices than boards store, zones end at the hull, and may have up to three
        quarters of their margin.
    notes : list of str
    """
    hull = shapely.convex_hull(shapely.multipoints(path))
    outer = shapely.simplify(shapely.buffer(hull, 1.2 * margin_m, quad_segs=2), margin_m / 20)
    zones = _few_corners(keep_out, outer, margin_m)
    fence = [_polygon(outer, plane, True), *(_polygon(zone, plane, False) for zone in zones)]
    notes = []
    count = sum(len(shape.vertices) for shape in fence)
    if count > MAX_VERTICES:
        notes.append(
            f"the fence has {count} vertices, and many boards store {MAX_VERTICES}; where the vehicle "
            "refuses it, give fewer or simpler zones, or --fence none"
        )
    if any(shapely.get_num_interior_rings(zone) for zone in zones):
        notes.append("holes of keep-out zones are closed in the fence")
    return tuple(fence), notes


def _few_corners(keep_out: KeepOut, outer: Any, margin_m: float) -> list[Any]:
    """The zones that meet a hull, in the first way that makes few enough vertices, or the fewest."""
    reach = shapely.buffer(outer, margin_m)
    ways = [
        keep_out.fence_zones,
        *(
            shapely.get_parts(shapely.intersection(zones, reach))
            for zones in (keep_out.fence_zones, keep_out.simpler_fence_zones)
        ),
    ]
    near = [[zone for zone in zones if zone.area > 0 and shapely.intersects(outer, zone)] for zones in ways]
    most = MAX_VERTICES - shapely.get_num_coordinates(outer)
    counts = [int(shapely.get_num_coordinates(zones).sum()) for zones in near]
    enough = [k for k, count in enumerate(counts) if count <= most]
    return near[enough[0] if enough else int(np.argmin(counts))]


def _polygon(ring: Any, plane: Plane, inclusion: bool) -> FencePolygon:
    xy = shapely.get_coordinates(shapely.get_exterior_ring(ring))[:-1]
    lon, lat = plane.lonlat_from_xy(*xy.T)
    places = zip(np.round(lat, _DECIMALS).tolist(), np.round(lon, _DECIMALS).tolist(), strict=True)
    return FencePolygon(tuple(places), inclusion)
