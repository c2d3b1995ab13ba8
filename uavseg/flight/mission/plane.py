"""Local plane (azimuthal equidistant projection): metres east and north of a centre, and degrees."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.raster.geodesy.globe import wrap_lon

LONGEST_EDGE_DEG = 0.005  # a straight edge in degrees bends by less than a centimetre over it


@dataclass(frozen=True, slots=True)
class Plane:
    """Azimuthal equidistant projection (WGS 84) around a centre: accurate to 5e-5 within 100 km of it."""

    lat: float
    lon: float

    def xy_from_lonlat(self, lon: Any, lat: Any) -> tuple[Floats, Floats]:
        """Return metres east and north of the centre."""
        x, y = _projection(self.lat, self.lon)(np.asarray(lon, float), np.asarray(lat, float))
        return x, y

    def lonlat_from_xy(self, x: Any, y: Any) -> tuple[Floats, Floats]:
        """Return degrees, longitude in [-180, 180]."""
        lon, lat = _projection(self.lat, self.lon)(np.asarray(x, float), np.asarray(y, float), inverse=True)
        return lon, lat

    def project_polygons(self, polygons: Sequence[Any] | NDArray[np.object_]) -> NDArray[np.object_]:
        """Densify polygons in degrees (lon, lat) and project them to metres, all at once.

        They are densified ring by ring: what GEOS densifies whole it also makes valid, and a hole that
        touches the border was seen to be lost.
        """
        count = len(polygons)
        parts, owners = shapely.get_parts(np.array([*polygons, None], object)[:-1], return_index=True)
        rings, owned = shapely.get_rings(parts, return_index=True)
        rings = shapely.segmentize(shapely.force_2d(rings), LONGEST_EDGE_DEG)
        lonlat = shapely.get_coordinates(rings)
        ends = np.cumsum([0, *shapely.get_num_coordinates(rings)])
        flat = shapely.from_ragged_array(
            shapely.GeometryType.POLYGON,
            np.column_stack(self.xy_from_lonlat(lonlat[:, 0], lonlat[:, 1])),
            (ends, np.searchsorted(owned, np.arange(len(parts) + 1))),
        )
        first = np.searchsorted(owners, np.arange(count + 1))
        drawn = np.empty(count, object)
        single = np.diff(first) == 1
        drawn[single] = flat[first[:-1][single]]
        for k in np.flatnonzero(~single).tolist():
            drawn[k] = shapely.MultiPolygon(list(flat[first[k] : first[k + 1]]))
        return drawn


def plane_around(bounds: NDArray[np.float64], lon: float) -> Plane:
    """Return the plane around the middle of bounding boxes.

    `bounds` (N, 4) are west, south, east, north in degrees. Longitudes are relative to `lon`, so boxes on
    both sides of the antimeridian are neighbours.
    """
    east = wrap_lon(bounds[:, [0, 2]] - lon)
    middle = lon + (east.min() + east.max()) / 2
    return Plane((bounds[:, 1].min() + bounds[:, 3].max()) / 2, float(wrap_lon(middle)))


@lru_cache(maxsize=8)
def _projection(lat: float, lon: float) -> Any:
    from pyproj import Proj

    return Proj(proj="aeqd", lat_0=lat, lon_0=lon, datum="WGS84")
