"""Table of longitudes and latitudes of evenly spaced pixel corners, for linear interpolation."""

import numpy as np

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.raster.geodesy.globe import geod_wgs84
from uavseg.raster.grid.geobox import GeoBox

TOLERANCE_DEG = 5e-8  # of the interpolation: half a centimetre
MAX_INTERVALS = 256
AREA_TOLERANCE = 1e-3  # of the area of a pixel, between neighbouring parts
MAX_AREA_INTERVALS = 64  # more would make a page large; only rasters of a continent need them
MAX_LATITUDE = 85.0  # Web Mercator ends at 85.05 degrees


@dataclass(frozen=True)
class GroundGrid:
    """Longitude and latitude of pixel corners that divide a raster evenly."""

    lon: Floats  # (n + 1, n + 1), in degrees
    lat: Floats
    pixel_m2: Floats  # (n, n), area of a pixel on the ellipsoid, as the mean of each part


def ground_grid(geobox: GeoBox) -> GroundGrid:
    """Return the coarsest table between whose places interpolation errs by half a centimetre at most.

    A RasterError says that a part of the raster has no longitude and latitude or lies beyond 85 degrees of
    latitude, or that it crosses the antimeridian: a map in Web Mercator cannot show it.
    """
    intervals = 4
    lon, lat = _corners(geobox, 2 * intervals)
    areas = _pixel_areas(geobox, lon[::2, ::2], lat[::2, ::2])
    while (intervals < MAX_INTERVALS and _error(lon, lat) > TOLERANCE_DEG) or (
        intervals < MAX_AREA_INTERVALS and _largest_step(areas) > AREA_TOLERANCE
    ):
        intervals *= 2
        lon, lat = _corners(geobox, 2 * intervals)
        areas = _pixel_areas(geobox, lon[::2, ::2], lat[::2, ::2])
    return GroundGrid(lon[::2, ::2], lat[::2, ::2], areas)


def _pixel_areas(geobox: GeoBox, lon: Floats, lat: Floats) -> Floats:
    intervals = len(lon) - 1
    rows, cols = geobox.shape
    areas = [
        abs(geod_wgs84().polygon_area_perimeter(x, y)[0])
        for x, y in zip(_quadrilaterals(lon), _quadrilaterals(lat), strict=True)
    ]
    pixels = rows / intervals * (cols / intervals)
    return np.reshape(areas, (intervals, intervals)) / pixels


def _largest_step(areas: Floats) -> float:
    """Return largest relative difference between neighbouring parts."""
    steps = max(float(np.abs(np.diff(areas, axis=axis)).max()) for axis in (0, 1))
    return steps / float(areas.min())


def _corners(geobox: GeoBox, intervals: int) -> tuple[Floats, Floats]:
    rows, cols = (np.linspace(0, length, intervals + 1) for length in geobox.shape)
    lon, lat = geobox.lonlat_from_xy(*geobox.xy_from_pixel(*np.meshgrid(rows, cols, indexing="ij")))
    if not (np.isfinite(lon).all() and np.isfinite(lat).all()):
        raise RasterError("a part of the raster has no longitude and latitude, so a map cannot show it")
    if np.abs(lat).max() > MAX_LATITUDE:
        raise RasterError(
            f"the raster reaches {np.abs(lat).max():.1f} degrees of latitude; a map in Web Mercator shows "
            f"up to {MAX_LATITUDE:g}: draw it with uavseg preview"
        )
    if lon.max() - lon.min() > 180:
        raise RasterError(
            "the raster crosses the antimeridian, where a map in Web Mercator is cut: split it there, or "
            "draw it with uavseg preview"
        )
    return lon, lat


def _error(lon: Floats, lat: Floats) -> float:
    """Return largest difference between every second place and the mean of its neighbours."""
    worst = 0.0
    for values in (lon, lat):
        known = values[::2, ::2]
        rows, cols = (known[1:] + known[:-1]) / 2, (known[:, 1:] + known[:, :-1]) / 2
        centres = (cols[1:] + cols[:-1]) / 2
        for found, true in (
            (rows, values[1::2, ::2]),
            (cols, values[::2, 1::2]),
            (centres, values[1::2, 1::2]),
        ):
            worst = max(worst, float(np.abs(found - true).max()))
    return worst


def _quadrilaterals(values: Floats) -> Floats:
    corners = [values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]]
    return np.stack(corners, axis=-1).reshape(-1, 4)
