"""Points and lines of vector files as areas: discs and strips of a width on the ground (buffers)."""

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import RegionError
from uavseg.flight.mission.track import LONGEST_EDGE_DEG, Plane
from uavseg.raster.geodesy.globe import geod_wgs84, unwrap_lon, wrap_lon
from uavseg.regions.wgs84.antimeridian import cut_at_antimeridian

QUARTER = 8  # sides of a quarter of a circle
PIECE = 100  # edges in one local plane, in which distances are true to 5e-5
HALF_TURN = 180.0
POINT, POLYGON, MULTIPLE, MULTIPOLYGON = 0, 3, 4, 6  # shapely.GeometryType; from 4 on, they have parts


@dataclass(frozen=True, slots=True)
class Widths:
    """Width on the ground, in metres, of the areas that points and lines become; None: they are left out."""

    point_m: float | None
    line_m: float | None
    use: str  # the predicate of those that become areas, after "are"
    left_out: str = ""  # and of those that do not
    flat_ends: bool = False  # whether strips end where their lines end


def as_areas(
    geometries: NDArray[np.object_], name: str, widths: Widths
) -> tuple[NDArray[np.object_], NDArray[np.int64], list[str]]:
    """Return the areas of geometries in degrees (lon, lat), of which features they are, and notes.

    A strip holds what is nearer to its line than half of the width; lines are straight in degrees, and lead
    the short way over the antimeridian, where areas are cut. `name` is that of the file. A RegionError says
    that a coordinate is not finite, a line has no length, or nothing is left.
    """
    parts, owner = geometries, np.arange(len(geometries))
    while (shapely.get_type_id(parts) >= MULTIPLE).any():
        parts, of = shapely.get_parts(parts, return_index=True)
        owner = owner[of]
    kind, drawn = shapely.get_type_id(parts), ~shapely.is_empty(parts)
    if (kind == POLYGON).all():
        return geometries, np.arange(len(geometries)), []
    if not np.isfinite(shapely.get_coordinates(parts)).all():
        raise RegionError(f"{name} has a coordinate that is not a finite number; repair it first")
    areas = parts.copy()
    areas[~drawn] = None
    used: list[str] = []
    left_out: list[str] = []
    for word, width_m, chosen in (
        ("point", widths.point_m, drawn & (kind == POINT)),
        ("line", widths.line_m, drawn & (kind != POINT) & (kind != POLYGON)),
    ):
        which = np.flatnonzero(chosen).tolist()
        for k in which:
            areas[k] = None if width_m is None else _widened(parts[k], width_m, widths.flat_ends, name)
        if which:
            counted = f"{len(which)} {word}{'s' * (len(which) != 1)}"
            (left_out if width_m is None else used).append(counted)
    notes = [
        f"{' and '.join(counted)} of {name} {'is' if counted in (['1 point'], ['1 line']) else 'are'} {what}"
        for counted, what in ((used, widths.use), (left_out, widths.left_out))
        if counted
    ]
    kept = np.flatnonzero(~shapely.is_missing(areas))
    if not len(kept):
        raise RegionError(f"{notes[-1]}, and there is nothing else in it")
    groups = np.split(kept, np.flatnonzero(np.diff(owner[kept])) + 1)
    features = np.array([owner[group[0]] for group in groups])
    result = geometries[features]
    for n in np.flatnonzero(~np.isin(shapely.get_type_id(result), (POLYGON, MULTIPOLYGON))).tolist():
        result[n] = shapely.union_all(shapely.make_valid(areas[groups[n]]))
    return result, features, notes


def _widened(shape: Any, width_m: float, flat_ends: bool, name: str) -> Any:
    """Return the disc around a point, or the strip along a line."""
    reach_m = width_m / 2
    if not flat_ends:
        reach_m /= math.cos(math.pi / (4 * QUARTER))  # the sides touch the circle
    lonlat = shapely.get_coordinates(shape)
    if len(lonlat) == 1:
        turn = np.linspace(360, 0, 4 * QUARTER + 1)
        ends = [np.full_like(turn, value) for value in lonlat[0]]
        ring = np.column_stack(geod_wgs84().fwd(*ends, turn, np.full_like(turn, reach_m))[:2])
        ring[-1] = ring[0]
        return _cut(shapely.Polygon(ring))
    if flat_ends and len(np.unique(lonlat, axis=0)) == 1:
        raise RegionError(f"{name} has a line without length; delete it")
    lonlat[:, 0] = unwrap_lon(lonlat[:, 0])
    lonlat = shapely.get_coordinates(shapely.segmentize(shapely.LineString(lonlat), LONGEST_EDGE_DEG))
    starts = range(0, len(lonlat) - 1, PIECE)  # an edge more, so that pieces overlap where the line bends
    return shapely.union_all([_strip(lonlat[k : k + PIECE + 2], reach_m, flat_ends) for k in starts])


def _strip(lonlat: Floats, reach_m: float, flat_ends: bool) -> Any:
    """Return what is near to a short line (n, 2), in a local plane around it."""
    lon, lat = (lonlat.min(axis=0) + lonlat.max(axis=0)) / 2
    plane = Plane(float(lat), float(wrap_lon(lon)))
    line = shapely.LineString(np.column_stack(plane.xy_from_lonlat(*lonlat.T)))
    area = shapely.buffer(line, reach_m, QUARTER, cap_style="flat" if flat_ends else "round")
    return _cut(shapely.transform(area, lambda xy: np.column_stack(plane.lonlat_from_xy(*xy.T))))


def _cut(area: Any) -> Any:
    """Cut a polygon at the antimeridian, where its longitudes jump, and close it around a pole."""
    west, _, east, _ = area.bounds
    if east - west < HALF_TURN:
        return area
    rings = shapely.get_rings(shapely.orient_polygons(area))
    return cut_at_antimeridian([shapely.get_coordinates(ring) for ring in rings], jumping=True)
