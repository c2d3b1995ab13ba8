"""Ellipsoid under a map: radii of curvature, points in space, and the ground length and area of a pixel."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.geodesy.globe import Transform, geodetic_base, is_geographic, unit_factor
from uavseg.raster.grid.geobox import GeoBox

Floats = NDArray[np.float64]

_STEP = 1 / 1600  # of finite differences, in radii of the ellipsoid: 4 km on the Earth


def pixel_on_ground(geobox: GeoBox, row: Floats, col: Floats) -> tuple[Floats, Floats, Floats]:
    """Ground size of pixels.

    From finite differences, of fourth order, of points in space.

    Parameters
    ----------
    geobox : GeoBox
    row, col : float64 arrays that broadcast
        Pixel positions; whole numbers are pixel corners.

    Returns
    -------
    along_row, along_col, area : float64 arrays of the broadcast shape
        Metres per pixel along a row and along a column, and square metres per pixel (units of the map where
        there is no CRS); not finite where the projection ends.
    """
    ellipsoid = ellipsoid_under(geobox.wkt)
    row, col = np.broadcast_arrays(row, col)
    if ellipsoid is None:
        along_row, along_col, area = (np.full(row.shape, value) for value in pixel_on_map(geobox))
        return along_row, along_col, area
    t = geobox.transform
    steps = ellipsoid.radius * _STEP / (ellipsoid.unit_m * np.hypot([t.a, t.b], [t.d, t.e]))

    def point(row: Floats, col: Floats) -> Floats:
        return ellipsoid.xyz_from_xy(*geobox.xy_from_pixel(row, col))

    with np.errstate(invalid="ignore", over="ignore"):
        per_col = _derivative(lambda by: point(row, col + by), steps[0])
        per_row = _derivative(lambda by: point(row + by, col), steps[1])
        normal = np.cross(per_col, per_row)
        along_row, along_col, area = (np.sqrt((v * v).sum(axis=-1)) for v in (per_col, per_row, normal))
    return along_row, along_col, area


def pixel_on_map(geobox: GeoBox) -> tuple[float, float, float]:
    """Length of a pixel along a row and along a column, and its area, in the plane of the map.

    Metres and square metres where the unit of the map is known.
    """
    t, unit = geobox.transform, unit_factor(geobox.wkt)
    along_row, along_col = np.hypot([t.a, t.b], [t.d, t.e]) * unit
    return float(along_row), float(along_col), abs(t.determinant) * unit**2


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """The ellipsoid under a CRS, and the transform from the map to its longitude and latitude.

    Parameters
    ----------
    inverse : Transform or None
        From map coordinates to longitude and latitude; None where they are that already.
    unit : float
        Radians in one unit of longitude and latitude.
    unit_m : float
        Metres, roughly, in one unit of the map.
    radius : float
        Semi-major axis in metres.
    eccentricity2 : float
        Square of the first eccentricity.
    """

    inverse: Transform | None
    unit: float
    unit_m: float
    radius: float
    eccentricity2: float

    def radii(self, lat: Floats) -> tuple[Floats, Floats]:
        """Radius of curvature along the meridian, and radius of the parallel, in metres; `lat` in radians."""
        squeeze = 1 - self.eccentricity2 * np.sin(lat) ** 2
        normal = self.radius / np.sqrt(squeeze)
        return normal * (1 - self.eccentricity2) / squeeze, normal * np.cos(lat)

    def xyz_from_xy(self, x: Floats, y: Floats) -> Floats:
        """Map coordinates (...) as geocentric coordinates (..., 3), in metres."""
        lon, lat = (x, y) if self.inverse is None else self.inverse(x, y)
        lon, lat = lon * self.unit, lat * self.unit
        normal = self.radius / np.sqrt(1 - self.eccentricity2 * np.sin(lat) ** 2)
        out = normal * np.cos(lat)
        up = normal * (1 - self.eccentricity2) * np.sin(lat)
        return np.stack([out * np.cos(lon), out * np.sin(lon), up], axis=-1)


@lru_cache(maxsize=32)
def ellipsoid_under(wkt: str | None) -> Ellipsoid | None:
    """The ellipsoid of a CRS; None where there is no CRS, or one without longitude and latitude."""
    base = geodetic_base(wkt)
    if base is None:
        return None
    angles, inverse = base
    unit = angles.axis_info[0].unit_conversion_factor
    radius = angles.ellipsoid.semi_major_metre
    unit_m = unit_factor(wkt) * (radius if is_geographic(wkt) else 1.0)
    eccentricity2 = 1 - (angles.ellipsoid.semi_minor_metre / radius) ** 2
    return Ellipsoid(inverse, unit, unit_m, radius, eccentricity2)


def _derivative(point: Callable[[float], Floats], step: float) -> Floats:
    """Derivative of points by central differences of fourth order."""
    near, far = point(step) - point(-step), point(2 * step) - point(-2 * step)
    return (8 * near - far) / (12 * step)
