"""Fence check: every leg of a mission inside of its inclusions and outside of its exclusions."""

import shapely

from uavseg.flight.fence import Fence, FenceCircle
from uavseg.flight.mission import Mission
from uavseg.flight.plane import Plane, plane_around

CIRCLE_QUARTER = 64  # sides of a quarter of a circle
TOLERANCE_M = 0.01


def fence_problems(mission: Mission) -> list[str]:
    """Where a mission leaves its fence or enters a zone to keep out of, one sentence for each shape.

    Legs are straight in a local plane; the height is not considered. Several inclusions are checked one by
    one, as autopilots do: the flight has to stay in each.
    """
    if not mission.fence:
        return []
    lat, lon, _ = mission.path
    bounds = shapely.bounds(shapely.points(lon, lat))
    plane = plane_around(bounds, mission.home.lon)
    x, y = plane.xy_from_lonlat(lon, lat)
    flown = shapely.linestrings([[*zip(x.tolist(), y.tolist(), strict=True)]])[0]
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
    return found


def _area(shape: Fence, plane: Plane) -> shapely.Geometry:
    """The area of a shape, larger by a tolerance for inclusions and smaller for exclusions."""
    slack = TOLERANCE_M if shape.inclusion else -TOLERANCE_M
    if isinstance(shape, FenceCircle):
        x, y = plane.xy_from_lonlat(shape.lon, shape.lat)
        radius = shape.radius_m + slack
        return shapely.buffer(shapely.Point(float(x), float(y)), radius, quad_segs=CIRCLE_QUARTER)
    lat, lon = zip(*shape.vertices, strict=True)
    x, y = plane.xy_from_lonlat(list(lon), list(lat))
    return shapely.buffer(shapely.Polygon(list(zip(x.tolist(), y.tolist(), strict=True))), slack)
