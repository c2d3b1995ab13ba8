"""Georeferenced grid: a shape, an affine transform and a CRS; lengths in metres or in pixels."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike, NDArray
from rasterio.crs import CRS

from uavseg.arguments import checked
from uavseg.arrays import Bools, Floats
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError, RasterError, caused_errors
from uavseg.plain_text import shown
from uavseg.raster.geodesy.globe import is_in_metres, lonlat_transform, unit_name
from uavseg.raster.grid.tiling import Window
from uavseg.warning_filters import changing_filters


@dataclass(frozen=True, slots=True)
class Length:
    """A length in metres, or in pixels; finite and above 0 (ParameterError).

    Examples
    --------
    >>> as_length("8px")
    Length(value=8.0, in_pixels=True)
    """

    value: float
    in_pixels: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.value < float("inf"):
            raise ParameterError(f"a detail or a width is a finite length above 0, not {self.value:g}")

    def __str__(self) -> str:
        return f"{self.value:.12g} {'pixels' if self.in_pixels else 'm'}"

    @property
    def word(self) -> str:
        """As options of the command line take it."""
        return f"{self.value!r}".removesuffix(".0") + ("px" if self.in_pixels else "")


def as_length(given: "Length | float | str | None") -> Length | None:
    """Return a length in metres, or of text such as "8px"; None for None; ParameterError if not above 0."""
    if given is None or isinstance(given, Length):
        return given
    expected = "a detail or a width is metres such as 2.5, or pixels such as 8px"
    return Length(*parse_size(given, expected, {"m": 1.0}))


def as_bounds(given: Any) -> tuple[float, float, float, float] | None:
    """Return west, south, east and north as numbers; ParameterError if they are not, or not in this order."""
    if given is None:
        return None
    try:
        west, south, east, north = (float(number) for number in given)
    except (TypeError, ValueError, OverflowError):
        west = math.nan
    if not (-math.inf < west < east < math.inf and -math.inf < south < north < math.inf):
        raise ParameterError(
            f"bounds are west, south, east and north in the raster's coordinates, not {shown(given)}"
        )
    return west, south, east, north


def parse_size(given: float | str, expected: str, units: Mapping[str, float]) -> tuple[float, bool]:
    """Parse a number, or text that may end in one of the units or in px, and whether it does in px.

    A ParameterError says what is `expected`.
    """
    if not isinstance(given, str):
        return float(given), False
    number = given.strip().lower()
    unit = next((name for name in ("px", *units) if number.endswith(name)), "")
    with caused_errors(f"{expected}, not {given!r}", ParameterError, ValueError, form="{}"):
        return float(number.removesuffix(unit)) * units.get(unit, 1.0), unit == "px"


@checked
@dataclass(frozen=True, slots=True)
class GeoBox:
    """A georeferenced grid of pixels.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    transform : affine.Affine
        From pixel corners (col, row) to the map (x, y); the outer corner of the first pixel is (0, 0).
    crs : rasterio.crs.CRS or None
        None if coordinates are local.

    Raises
    ------
    RasterError
        If the transform is not finite, or does not tell the pixels apart.

    Examples
    --------
    >>> box = GeoBox((100, 200), Affine(2.0, 0.0, 5000.0, 0.0, -2.0, 9000.0), None)
    >>> box.window(Window(10, 20, 64, 64)).transform.c
    5040.0
    >>> box.coarsen(8).shape
    (13, 25)
    """

    shape: tuple[int, int]
    transform: Affine
    crs: CRS | None

    def __post_init__(self) -> None:
        check_transform(self.transform, self.shape)

    @property
    def wkt(self) -> str | None:
        """The CRS as WKT 2, or None."""
        return None if self.crs is None else str(self.crs.to_wkt(version="WKT2_2019"))

    @property
    def corners(self) -> tuple[Floats, Floats]:
        """Return x and y, (4,) each, of its corners: upper left, upper right, lower left, lower right."""
        rows, cols = self.shape
        return self.xy_from_pixel([0, 0, rows, rows], [0, cols, 0, cols])

    @checked
    def xy_from_pixel(self, row: ArrayLike, col: ArrayLike) -> tuple[Floats, Floats]:
        """Map coordinates of pixel corners; (row + 0.5, col + 0.5) is the centre of a pixel.

        Parameters
        ----------
        row, col : arrays of one shape

        Returns
        -------
        x, y : float64 arrays of that shape
        """
        rows, cols = np.asarray(row, np.float64), np.asarray(col, np.float64)
        if rows.shape != cols.shape and rows.ndim and cols.ndim:
            raise ParameterError(f"row and col have one shape, not {rows.shape} and {cols.shape}")
        t = self.transform
        with np.errstate(over="ignore", invalid="ignore"):  # of positions far away, or infinite
            return t.a * cols + t.b * rows + t.c, t.d * cols + t.e * rows + t.f

    @checked
    def lonlat_from_xy(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Longitude and latitude in degrees of map coordinates.

        WGS 84 on the Earth; on another celestial body, the geographic CRS that the CRS is based on. Infinite
        for points outside the domain of the projection.

        Raises
        ------
        RasterError
            If there is no CRS, or one without longitude and latitude.
        """
        if self.crs is None:
            raise RasterError("no coordinate reference system, so no longitude and latitude")
        lon, lat = lonlat_transform(self.wkt)(np.asarray(x, np.float64), np.asarray(y, np.float64))
        return np.asarray(lon, np.float64), np.asarray(lat, np.float64)

    @checked
    def window(self, window: Window) -> "GeoBox":
        """Return the part of the grid inside `window`."""
        place = shifted(self.transform, window.row, window.col)
        return replace(self, shape=(window.rows, window.cols), transform=place)

    @checked
    def coarsen(self, side: int) -> "GeoBox":
        """Return the grid of cells of `side` x `side` pixels; the last cells may extend past the edge."""
        if side < 1:
            raise ParameterError(f"the side of a cell is at least 1 pixel, not {side}")
        rows, cols = (-(-length // side) for length in self.shape)
        return replace(self, shape=(rows, cols), transform=scaled(self.transform, side, side))


def check_transform(transform: Affine, shape: tuple[int, int]) -> None:
    """Refuse a transform that does not give every pixel of a raster a place of its own (RasterError).

    A number in it is not finite or too large, it makes the pixels lines, or they are smaller than what
    coordinates as large as theirs can tell apart.
    """
    a, b, c, d, e, f = tuple(transform)[:6]
    across, down = math.hypot(a, d), math.hypot(b, e)
    largest = max(abs(c), abs(f), across * shape[1], down * shape[0])
    wrong = ""
    if not (all(map(math.isfinite, (a, b, c, d, e, f))) and largest <= _MAX_COORDINATE):
        wrong = "is not finite, or too large"
    elif not abs(a * e - b * d) > _MIN_SHEAR * across * down > 0:
        wrong = "makes its pixels lines or points"
    elif not min(across, down) > _MIN_PIXEL * max(largest, _MIN_PIXEL):
        wrong = "has pixels too small for its coordinates to tell them apart"
    if wrong:
        numbers = ", ".join(f"{number:g}" for number in (c, a, b, f, d, e))
        raise RasterError(f"the geotransform ({numbers}) {wrong}; correct it, for instance with gdal_edit.py")


_MAX_COORDINATE = 1e15
_MIN_SHEAR = 1e-9  # sine of the angle between rows and columns
_MIN_PIXEL = 1e-13  # of the largest coordinate: 2^-53 is what float64 tells apart


def shifted(transform: Affine, row: float, col: float) -> Affine:
    """Return the transform of a grid whose first pixel is at (row, col) of another."""
    a, b, c, d, e, f = tuple(transform)[:6]
    return Affine(a, b, a * col + b * row + c, d, e, d * col + e * row + f)


def scaled(transform: Affine, rows: float, cols: float) -> Affine:
    """Return the transform of a grid whose pixels are `rows` x `cols` pixels of another."""
    a, b, c, d, e, f = tuple(transform)[:6]
    return Affine(a * cols, b * rows, c, d * cols, e * rows, f)


@checked
def local_geobox(shape: tuple[int, int], cell_m: float, origin: tuple[float, float]) -> GeoBox:
    """Return a north-up grid of square cells in local metres, with its lower left corner at `origin`."""
    return GeoBox(shape, Affine(cell_m, 0.0, origin[0], 0.0, -cell_m, origin[1] + shape[0] * cell_m), None)


def azimuthal_geobox(lat: float, lon: float, bounds: tuple[float, float, float, float]) -> GeoBox:
    """Return a box in metres around a centre: azimuthal equidistant projection (WGS 84), one pixel, north up.

    The centre is in degrees; `bounds` are left, bottom, right and top in metres from it.
    """
    left, bottom, right, top = bounds
    crs = CRS.from_dict(proj="aeqd", lat_0=lat, lon_0=lon, datum="WGS84", units="m")
    return GeoBox((1, 1), Affine(right - left, 0.0, left, 0.0, bottom - top, top), crs)


def check_metres(geobox: GeoBox) -> None:
    """Refuse a map whose coordinates are not metres (MapError); local coordinates are taken for metres."""
    if not is_in_metres(geobox.wkt):
        unit = unit_name(geobox.wkt)
        raise MapError(f"a robot's map is in metres and this one in {unit}; warp it first (gdalwarp -t_srs)")


def pixels_inside(polygons: Iterable[Any], window: Window, touched: bool = False) -> Bools:
    """Return the mask (rows, cols) of the pixels of a window whose centres lie inside polygons.

    With `touched`, of all pixels that these touch. They (shapely) are in pixels as (col, row); the
    outer corner of the first pixel is (0, 0).
    """
    from rasterio.features import geometry_mask

    shape, place = (window.rows, window.cols), Affine.translation(window.col, window.row)
    with changing_filters():  # rasterio changes them itself
        mask: NDArray[Any] = geometry_mask(list(polygons), shape, place, touched, invert=True)
    return mask
