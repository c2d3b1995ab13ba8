"""Frame: the sheet a picture is drawn on, north-up where the map is, with equal units along and across."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike, NDArray

from uavseg.errors import RasterError
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.globe import WGS84, Transform, geod_of, is_geographic, transform_between

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """From map coordinates to a sheet around the middle of a raster.

    Map coordinates are large numbers and, in degrees, longer up than across. On the sheet the middle of the
    raster is (0, 0), x points right, y up, and one unit is as long in both directions.

    Parameters
    ----------
    geobox : GeoBox
        Of the raster in the picture.
    """

    geobox: GeoBox

    @cached_property
    def affine(self) -> Affine:
        """From the map to the sheet."""
        rows, cols = self.geobox.shape
        x, y = self.geobox.transform * (cols / 2, rows / 2)
        return Affine.scale(*self._stretch(y)) * Affine.translation(-x, -y)

    def _stretch(self, y: float) -> tuple[float, float]:
        wkt, transform = self.geobox.wkt, self.geobox.transform
        if wkt is None:
            return 1.0, -1.0 if transform.e > 0 else 1.0  # rows that count downwards: pixels, not a map
        return max(math.cos(math.radians(y)), 0.1) if is_geographic(wkt) else 1.0, 1.0

    @property
    def pixels(self) -> Affine:
        """From pixel corners (col, row) to the sheet."""
        return self.affine * self.geobox.transform

    @property
    def corners(self) -> Floats:
        """The raster's corners on the sheet, a (4, 2) array."""
        rows, cols = self.geobox.shape
        return np.array([self.pixels * corner for corner in ((0, 0), (cols, 0), (cols, rows), (0, rows))])

    def sheet_from_xy(self, xy: ArrayLike) -> Floats:
        """Places on the sheet of map coordinates, (n, 2) to (n, 2)."""
        points, t = np.asarray(xy, np.float64), self.affine
        placed: Floats = points * (t.a, t.e) + (t.c, t.f)
        return placed

    def sheet_from_lonlat(self, lon: ArrayLike, lat: ArrayLike) -> Floats:
        """Places on the sheet of degrees (WGS 84), an (n, 2) array.

        Raises
        ------
        RasterError
            If the raster has no CRS.
        """
        if self.geobox.crs is None:
            raise RasterError(
                "a mission has a place on the globe and this raster has none; "
                "give the raster a CRS (gdal_edit.py -a_srs), or leave the mission out"
            )
        x, y = self._from_lonlat(np.asarray(lon, np.float64), np.asarray(lat, np.float64))
        return self.sheet_from_xy(np.column_stack([x, y]))

    @cached_property
    def _from_lonlat(self) -> Transform:
        return transform_between(WGS84, self.geobox.wkt)

    @cached_property
    def metres(self) -> float | None:
        """Ground metres of one unit across the middle of the sheet; None where there is no CRS."""
        wkt = self.geobox.wkt
        if wkt is None:
            return None
        lon, lat = self._around
        _, _, metres = geod_of(wkt).inv(lon[0], lat[0], lon[1], lat[1])
        return float(metres) / self._step if math.isfinite(metres) and metres > 0 else None

    @cached_property
    def north(self) -> tuple[float, float] | None:
        """Direction of true north on the sheet, of length 1; None where there is no CRS."""
        if self.geobox.crs is None:
            return None
        _, lat = self._around
        right, up = float(lat[1] - lat[0]), float(lat[2] - lat[0])
        length = math.hypot(right, up)
        return (right / length, up / length) if math.isfinite(length) and length > 0 else None

    @property
    def _step(self) -> float:
        return float(np.abs(self.corners).max()) / 100

    @cached_property
    def _around(self) -> tuple[Floats, Floats]:
        """Degrees of the middle of the sheet, of a place to its right and of one above it."""
        places = [~self.affine * place for place in ((0, 0), (self._step, 0), (0, self._step))]
        x, y = np.array(places).T
        return self.geobox.lonlat_from_xy(x, y)
