"""Points and lines of vector files as areas: discs and strips of a width on the ground (buffers)."""

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import RegionError
from uavseg.raster.geodesy.globe import unwrap_lon, wrap_lon

QUARTER = 8  # sides of a quarter of a circle
POINT, POLYGON, MULTIPOLYGON, OF_PARTS = 0, 3, 6, (4, 5, 7)  # shapely.GeometryType


@dataclass(frozen=True, slots=True)
class Widths:
    """Width on the ground, in metres, of the areas that points and lines become; None: they are left out."""

    point_m: float | None
    line_m: float | None
    use: str  # of those that become areas, for notes
    left_out: str = ""  # what becomes of the others, likewise


def as_areas(
    geometries: NDArray[np.object_], name: str, widths: Widths
) -> tuple[NDArray[np.object_], NDArray[np.int64], list[str]]:
    """Return areas of geometries in degrees (lon, lat), of which features they are, and notes.

    Each point and line is an area of its own, with all that is nearer than half of the width, in the way of
    polygons that cross the antimeridian. Lines are straight in degrees. `name` is that of the file. A
    RegionError says that a coordinate is not finite, or nothing is left.
    """
    parts, owner = geometries, np.arange(len(geometries))
    while (several := np.isin(shapely.get_type_id(parts), OF_PARTS)).any():
        inner, of = shapely.get_parts(parts[several], return_index=True)
        owner = np.concatenate([owner[~several], owner[several][of]])
        parts = np.concatenate([parts[~several], inner])
    order = np.flatnonzero(~shapely.is_empty(parts))
    order = order[np.argsort(owner[order], kind="stable")]
    areas, owner, said = parts[order], owner[order], dict[str, list[str]]()
    kind = shapely.get_type_id(areas)
    is_line = ~np.isin(kind, (POINT, POLYGON, MULTIPOLYGON))
    for word, width_m, mask in (("point", widths.point_m, kind == POINT), ("line", widths.line_m, is_line)):
        chosen = np.flatnonzero(mask).tolist()
        if chosen and not np.isfinite(shapely.get_coordinates(areas[chosen])).all():
            raise RegionError(f"{name} has a coordinate that is not a finite number; repair it first")
        for k in chosen:
            areas[k] = None if width_m is None else _widened(areas[k], width_m)
        if chosen:
            counted = f"{len(chosen)} {word}{'s' * (len(chosen) != 1)}"
            said.setdefault(widths.left_out if width_m is None else widths.use, []).append(counted)
    notes = [f"{' and '.join(counted)} of {name}: {use}" for use, counted in said.items()]
    kept = ~shapely.is_missing(areas)
    if not kept.any():
        raise RegionError(f"{notes[-1]}, and there is nothing else in it")
    return areas[kept], owner[kept], notes


def _widened(shape: Any, width_m: float) -> Any:
    """Return the disc around a point, or the strip along a line, in a local plane around it."""
    from uavseg.flight.mission.track import LONGEST_EDGE_DEG, Plane

    lonlat = shapely.get_coordinates(shape)
    lonlat[:, 0] = unwrap_lon(lonlat[:, 0])
    lon, lat = (lonlat.min(axis=0) + lonlat.max(axis=0)) / 2
    plane = Plane(round(float(lat), 1), round(float(wrap_lon(lon)), 1))  # which neighbours share
    if len(lonlat) > 1:
        shape = shapely.segmentize(shapely.LineString(lonlat), LONGEST_EDGE_DEG)
    metres = shapely.transform(shape, lambda lonlat: np.column_stack(plane.xy_from_lonlat(*lonlat.T)))
    reach_m = width_m / 2 / math.cos(math.pi / (4 * QUARTER))  # the sides touch the circle
    area = shapely.buffer(metres, reach_m, quad_segs=QUARTER)
    return shapely.transform(area, lambda xy: np.column_stack(plane.lonlat_from_xy(*xy.T)))
