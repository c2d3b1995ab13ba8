"""The ellipsoid under a map, and how much of its ground a pixel covers there."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geobox import GeoBox

Floats = NDArray[np.float64]

_STEP = 1 / 1600  # of finite differences, in radii of the globe: 4 km on the Earth


def pixel_on_ground(geobox: GeoBox, row: Floats, col: Floats) -> tuple[Floats, Floats, Floats]:
    """Length of a pixel's step along its row and along its column, and its area, at pixel positions.

    From differences of points in space, of fourth order; not finite where the projection ends.
    """
    globe = globe_under(geobox.wkt)
    row, col = np.broadcast_arrays(row, col)
    if globe is None:
        per_col, per_row, area = (np.full(row.shape, value) for value in pixel_on_map(geobox))
        return per_col, per_row, area
    t = geobox.transform
    steps = globe.radius * _STEP / (globe.unit_m * np.hypot([t.a, t.b], [t.d, t.e]))
    with np.errstate(invalid="ignore", over="ignore"):
        east = _difference(lambda by: globe.place(*geobox.xy_from_pixel(row, col + by)), steps[0])
        south = _difference(lambda by: globe.place(*geobox.xy_from_pixel(row + by, col)), steps[1])
        across = np.cross(east, south)
        per_col, per_row, area = (np.sqrt((v * v).sum(axis=-1)) for v in (east, south, across))
    return per_col, per_row, area


def pixel_on_map(geobox: GeoBox) -> tuple[float, float, float]:
    """Length of a pixel's step along its row and along its column, and its area, in the plane of the map."""
    t, unit = geobox.transform, unit_of_length(geobox.wkt)
    along_row, along_col = np.hypot([t.a, t.b], [t.d, t.e]) * unit
    return float(along_row), float(along_col), abs(t.determinant) * unit**2


@dataclass(frozen=True, slots=True)
class Globe:
    """The ellipsoid under a CRS and the way to it; `inverse` is None where the map is in angles already."""

    inverse: Callable[[Floats, Floats], tuple[Floats, Floats]] | None
    unit: float  # of the angles, in radians
    unit_m: float  # of the map, about, in metres
    radius: float
    eccentricity2: float  # squared

    def radii(self, lat: Floats) -> tuple[Floats, Floats]:
        """Radius of curvature along the meridian, and radius of the parallel, in metres."""
        squeeze = 1 - self.eccentricity2 * np.sin(lat) ** 2
        normal = self.radius / np.sqrt(squeeze)
        return normal * (1 - self.eccentricity2) / squeeze, normal * np.cos(lat)

    def place(self, x: Floats, y: Floats) -> Floats:
        """Map coordinates -> points in space (..., 3), metres from the centre."""
        lon, lat = (x, y) if self.inverse is None else self.inverse(x, y)
        lon, lat = lon * self.unit, lat * self.unit
        normal = self.radius / np.sqrt(1 - self.eccentricity2 * np.sin(lat) ** 2)
        out = normal * np.cos(lat)
        up = normal * (1 - self.eccentricity2) * np.sin(lat)
        return np.stack([out * np.cos(lon), out * np.sin(lon), up], axis=-1)


@lru_cache(maxsize=32)
def globe_under(wkt: str | None) -> Globe | None:
    """None where there is no CRS, or one that has no place on a globe."""
    if wkt is None:
        return None
    import pyproj
    from pyproj.exceptions import ProjError

    try:
        crs = pyproj.CRS.from_wkt(wkt)
        angles = crs.geodetic_crs
        if angles is None:
            return None
        way = (
            None if crs.is_geographic else pyproj.Transformer.from_crs(crs, angles, always_xy=True).transform
        )
    except ProjError:
        return None
    unit = angles.axis_info[0].unit_conversion_factor
    radius = angles.ellipsoid.semi_major_metre
    unit_m = unit * radius if way is None else unit_of_length(wkt)
    squared = 1 - (angles.ellipsoid.semi_minor_metre / radius) ** 2
    return Globe(way, unit, unit_m, radius, squared)


@lru_cache(maxsize=32)
def unit_of_length(wkt: str | None) -> float:
    """Metres in one unit of the map; 1 where that is not known."""
    if wkt is None:
        return 1.0
    import pyproj

    axes = pyproj.CRS.from_wkt(wkt).axis_info
    return float(axes[0].unit_conversion_factor) if axes else 1.0


def _difference(place: Callable[[float], Floats], step: float) -> Floats:
    near, far = place(step) - place(-step), place(2 * step) - place(-2 * step)
    return (8 * near - far) / (12 * step)
