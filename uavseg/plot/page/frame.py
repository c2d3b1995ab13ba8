"""Plot coordinates: north up where there is a CRS, centred on the raster, with equal units in x and y."""

import math
from functools import cached_property

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike

from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.raster.geodesy.globe import WGS84, Transform, geod_of, is_geographic, transform_between
from uavseg.raster.grid.geobox import GeoBox


@dataclass(frozen=True)
class Frame:
    """Transforms from map coordinates of the raster in the picture to plot coordinates.

    Map coordinates are large numbers and, in degrees, not equally long in x and y. In plot coordinates the
    middle of the raster is (0, 0), x points right, y up, and one unit is equally long in both directions.
    `local_metres` tells whether coordinates without a CRS are metres.
    """

    geobox: GeoBox
    local_metres: bool = False

    @cached_property
    def plot_from_map(self) -> Affine:
        """Return the transform from map to plot coordinates."""
        rows, cols = self.geobox.shape
        x, y = self.geobox.transform * (cols / 2, rows / 2)
        return Affine.scale(*self._scale(y)) * Affine.translation(-x, -y)

    def _scale(self, y: float) -> tuple[float, float]:
        wkt, transform = self.geobox.wkt, self.geobox.transform
        if wkt is None:
            return 1.0, -1.0 if transform.e > 0 else 1.0  # rows that count downwards: pixels, not a map
        return max(math.cos(math.radians(y)), 0.1) if is_geographic(wkt) else 1.0, 1.0

    @property
    def plot_from_pixel(self) -> Affine:
        """Return the transform from pixel corners (col, row) to plot coordinates."""
        return self.plot_from_map * self.geobox.transform

    @property
    def corners(self) -> Floats:
        """Return the raster's corners in plot coordinates, a (4, 2) array."""
        rows, cols = self.geobox.shape
        pixels = ((0, 0), (cols, 0), (cols, rows), (0, rows))
        return np.array([self.plot_from_pixel * corner for corner in pixels])

    def plot_from_xy(self, xy: ArrayLike) -> Floats:
        """Convert map coordinates to plot coordinates, (n, 2) to (n, 2)."""
        points, t = np.asarray(xy, np.float64), self.plot_from_map
        placed: Floats = points * (t.a, t.e) + (t.c, t.f)
        return placed

    def plot_from_lonlat(self, lon: ArrayLike, lat: ArrayLike) -> Floats:
        """Convert degrees (WGS 84), each (n,), to plot coordinates, (n, 2)."""
        if self.geobox.crs is None:
            raise RasterError(
                "a mission has a place on the globe and this raster has none; "
                "give the raster a CRS (gdal_edit.py -a_srs), or leave the mission out"
            )
        x, y = self._map_from_lonlat(np.asarray(lon, np.float64), np.asarray(lat, np.float64))
        return self.plot_from_xy(np.column_stack([x, y]))

    @cached_property
    def _map_from_lonlat(self) -> Transform:
        return transform_between(WGS84, self.geobox.wkt)

    @cached_property
    def metres_per_unit(self) -> float | None:
        """Return the ground metres of one unit in x at the middle of the plot; None where it is not known."""
        wkt = self.geobox.wkt
        if wkt is None:
            return 1.0 if self.local_metres else None
        lon, lat = self._around_middle
        _, _, metres = geod_of(wkt).inv(lon[0], lat[0], lon[1], lat[1])
        return float(metres) / self._offset if math.isfinite(metres) and metres > 0 else None

    @cached_property
    def north(self) -> tuple[float, float] | None:
        """Return the unit vector towards true north in plot coordinates; None without a CRS."""
        if self.geobox.crs is None:
            return None
        _, lat = self._around_middle
        right, up = float(lat[1] - lat[0]), float(lat[2] - lat[0])
        length = math.hypot(right, up)
        return (right / length, up / length) if math.isfinite(length) and length > 0 else None

    @property
    def _offset(self) -> float:
        return float(np.abs(self.corners).max()) / 100

    @cached_property
    def _around_middle(self) -> tuple[Floats, Floats]:
        """Return longitudes and latitudes of the middle of the plot, a point to its right and one above."""
        points = [~self.plot_from_map * point for point in ((0, 0), (self._offset, 0), (0, self._offset))]
        x, y = np.array(points).T
        return self.geobox.lonlat_from_xy(x, y)
