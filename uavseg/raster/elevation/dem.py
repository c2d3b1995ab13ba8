"""Digital elevation model (DEM): heights of the ground in metres at positions in degrees."""

import math
import os
import warnings
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import rasterio
from numpy.typing import ArrayLike

from uavseg.arrays import Floats, Integers, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError, RasterReadError, named_errors
from uavseg.plain_text import cause_of, shown
from uavseg.raster.access.open_checked import open_checked
from uavseg.raster.access.opening import as_file_name, open_errors
from uavseg.raster.geodesy import globe
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.source_list import expand_sources
from uavseg.warning_filters import changing_filters

SIDE = 256
"""Pixels by which neighbouring tiles are apart; each also holds the first row and column of the next."""
MAX_TILES = 64  # tiles that are kept: 34 MB
SeaHeights = Callable[[Floats, Floats, Floats], Floats]
"""From longitude and latitude in degrees and ellipsoidal heights to heights above the sea, in metres."""

UNITS_M = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 0.01),
    **dict.fromkeys(("dm", "decimeter", "decimeters", "decimetre", "decimetres"), 0.1),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international feet"), 0.3048),
    **dict.fromkeys(("us survey foot", "us survey feet", "ftus", "us-ft", "ft-us", "us-foot"), 1200 / 3937),
    **dict.fromkeys(("foot_us", "us_survey_foot", "us foot", "us feet", "us_foot"), 1200 / 3937),
}  # metres in a unit of heights, by its names in files (in lower case)
LOWEST_M, HIGHEST_M = -500.0, 9000.0  # of the ground of the Earth; other values are voids that are not marked


@dataclass(frozen=True, slots=True)
class VerticalReference:
    """What heights are measured from: a geoid, the level of a tide gauge, or the ellipsoid of satellites."""

    zero: Literal["sea", "ellipsoid", "unknown"] = "unknown"
    name: str = ""  # the name of the vertical CRS, such as "EGM96 height"; empty where there is none
    unit_m: float | None = None  # metres in a unit; None where the CRS does not say


def vertical_reference(wkt: str) -> VerticalReference:
    """Return the vertical part of a CRS, which is compound or has three axes; unknown where there is none.

    A RasterError says that its axis points down: it holds depths.

    Examples
    --------
    >>> from pyproj import CRS
    >>> vertical_reference(CRS("EPSG:26918+6360").to_wkt()).name
    'NAVD88 height (ftUS)'
    >>> vertical_reference(CRS("EPSG:4979").to_wkt()).zero, vertical_reference(CRS("EPSG:4326").to_wkt()).zero
    ('ellipsoid', 'unknown')
    """
    crs = globe.parse_crs(wkt)
    parts = [part for part in crs.sub_crs_list if part.is_vertical]
    vertical, axes = (parts[0], parts[0].axis_info) if parts else (crs, crs.axis_info[2:])
    if not axes:
        return VerticalReference()
    if axes[0].direction.lower() == "down":
        raise RasterError(f"it holds depths below {vertical.name}, not heights")
    ellipsoidal = not parts or "ellipsoid" in vertical.name.lower()
    unit_m = float(axes[0].unit_conversion_factor) or None
    return VerticalReference("ellipsoid" if ellipsoidal else "sea", str(vertical.name), unit_m)


@lru_cache(maxsize=32)
def horizontal_crs(wkt: str) -> Any:
    """Return the pyproj CRS of the plane or globe alone, without heights."""
    crs = globe.parse_crs(wkt)
    parts = [part for part in crs.sub_crs_list if not part.is_vertical]
    return parts[0] if parts else crs.to_2d()


def sea_from_ellipsoid() -> SeaHeights | None:
    """Return the conversion of ellipsoidal heights to those above EGM96; None without its grid."""
    from pyproj import network
    from pyproj.transformer import TransformerGroup

    before = network.is_network_enabled()
    network.set_network_enabled(False)
    try:
        with changing_filters():
            warnings.simplefilter("ignore", UserWarning)  # that the grid is missing: see the result
            group = TransformerGroup("EPSG:4979", "EPSG:4326+5773", always_xy=True, allow_ballpark=False)
    finally:
        network.set_network_enabled(before)
    if not group.transformers:
        return None
    transformer = group.transformers[0]

    def heights(lon: Floats, lat: Floats, height_m: Floats) -> Floats:
        return np.asarray(transformer.transform(lon, lat, height_m)[2], np.float64)

    return heights


@dataclass(eq=False)
class BilinearSampler:
    """Values of the one band of a dataset between the centres of its pixels."""

    dataset: Dataset
    _tiles: OrderedDict[tuple[int, int], Floats] = field(default_factory=OrderedDict, repr=False)

    def sample(self, row: Floats, col: Floats) -> Floats:
        """Return values at positions, NaN outside of the raster and where a pixel that counts is invalid.

        In the outer half of the pixels at the edge, beyond their centres, the value is that at the nearest
        point of the line between the centres. Corners of pixels are integers in `row` and `col`, (n,) both,
        and centres are at + 0.5; see `GeoBox.xy_from_pixel`.
        """
        rows, cols = self.dataset.geobox.shape
        values = np.full(row.shape, np.nan)
        inside = np.flatnonzero((row >= 0) & (row <= rows) & (col >= 0) & (col <= cols))
        top, down = _between(row[inside], rows)
        left, right = _between(col[inside], cols)
        tile_row, tile_col = top // SIDE, left // SIDE
        order = np.lexsort((tile_col, tile_row))
        changes = np.diff(tile_row[order]).astype(bool) | np.diff(tile_col[order]).astype(bool)
        for group in np.split(order, np.flatnonzero(changes) + 1):
            if not len(group):
                continue
            i, j = int(tile_row[group[0]]), int(tile_col[group[0]])
            local = top[group] - i * SIDE, left[group] - j * SIDE
            values[inside[group]] = _interpolate(self._tile(i, j), *local, down[group], right[group])
        return values

    def _tile(self, i: int, j: int) -> Floats:
        """Return pixels of a tile, NaN where invalid; the least recently used is dropped."""
        key = i, j
        if key not in self._tiles:
            window = Window(i * SIDE, j * SIDE, SIDE + 1, SIDE + 1).clipped(self.dataset.geobox.shape)
            pixels, valid = self.dataset.read(window)
            found = pixels[0].astype(np.float64)
            if valid is not None:
                found[~valid] = np.nan
            self._tiles[key] = found
            if len(self._tiles) > MAX_TILES:
                self._tiles.popitem(last=False)
        self._tiles.move_to_end(key)
        return self._tiles[key]


def _between(position: Floats, count: int) -> tuple[Integers, Floats]:
    """Return the pixel whose centre comes before each position, and the share of the way to the next one."""
    centre = np.clip(position - 0.5, 0, count - 1)
    before = np.minimum(centre.astype(np.int64), max(count - 2, 0))
    return before, centre - before


def _interpolate(tile: Floats, row: Integers, col: Integers, down: Floats, right: Floats) -> Floats:
    below, beside = np.minimum(row + 1, tile.shape[0] - 1), np.minimum(col + 1, tile.shape[1] - 1)
    total = np.zeros(row.shape)
    for i, j, weight in (
        (row, col, (1 - down) * (1 - right)),
        (row, beside, (1 - down) * right),
        (below, col, down * (1 - right)),
        (below, beside, down * right),
    ):
        total += np.where(weight > 0, weight * tile[i, j], 0.0)  # an invalid pixel without weight is none
    return total


@dataclass(frozen=True, slots=True)
class Heights:
    """How the numbers of a file become heights: metres = offset_m + scale_m * number."""

    wkt: str  # the CRS, with its vertical part where the file has one
    reference: VerticalReference
    scale_m: float
    offset_m: float
    has_unit: bool  # whether the file says what its unit is; else it is taken for the metre


@dataclass(frozen=True, eq=False)
class Dem:
    """Heights of the ground, interpolated between the pixels of one raster or of a mosaic."""

    sampler: BilinearSampler = field(repr=False)
    heights: Heights
    to_xy: globe.Transform = field(repr=False)  # from longitude and latitude (WGS 84) to those of the raster
    # from ellipsoidal heights to those above the sea, where it is needed and possible
    to_sea: SeaHeights | None = field(default=None, repr=False)

    @classmethod
    def open(cls, sources: Path_ | Sequence[Path_]) -> "Dem":
        """Open a DEM: one raster, or several that make a mosaic, such as a VRT; no pixel is read.

        A RasterReadError says that a file cannot be opened, a RasterError that it has no CRS, more than one
        band or pixels of 8 bits, depths instead of heights, a unit that is not known, or none although its
        coordinates are in feet, or that files differ in these, a MosaicError that they do not fit together.
        """
        paths = expand_sources([sources] if isinstance(sources, str | os.PathLike) else sources)
        if not paths:
            raise ParameterError("there is no elevation model to open; give at least one")
        dataset = Dataset.open(paths, band=1, warp=None)
        found = [_heights_of(as_file_name(os.fspath(path))) for path in paths]
        for path, one in zip(paths, found, strict=True):
            if one != found[0]:
                raise RasterError(
                    f"{os.fspath(path)} differs from {os.fspath(paths[0])} in its CRS, its unit or in what "
                    "its heights are above; the files of one elevation model must agree"
                )
        if dataset.geobox.crs is None:
            raise RasterError(f"{os.fspath(paths[0])} has no place on the map (no geotransform)")
        heights = found[0]
        to_sea = sea_from_ellipsoid() if heights.reference.zero == "ellipsoid" else None
        to_xy = globe.transform_between(globe.WGS84, horizontal_crs(heights.wkt))
        return cls(BilinearSampler(dataset), heights, to_xy, to_sea)

    @property
    def name(self) -> str:
        """The name of the first file, and how many there are besides."""
        more = len(self.sampler.dataset.paths) - 1
        return self.sampler.dataset.source + (f" and {more} more" if more else "")

    @property
    def is_above_sea(self) -> bool:
        """Whether heights are above the sea, as far as is known: not above the ellipsoid."""
        return self.heights.reference.zero != "ellipsoid" or self.to_sea is not None

    def pixels(self, lon: ArrayLike, lat: ArrayLike) -> tuple[Floats, Floats]:
        """Return row and column of positions in degrees; infinite where the CRS has no such place."""
        box = self.sampler.dataset.geobox
        x, y = self.to_xy(np.asarray(lon, np.float64), np.asarray(lat, np.float64))
        t = box.transform
        with np.errstate(invalid="ignore"):
            if horizontal_crs(self.heights.wkt).is_geographic:
                middle = float(box.xy_from_pixel(box.shape[0] / 2, box.shape[1] / 2)[0])
                turn = math.tau / globe.unit_factor(self.heights.wkt)
                x = middle + globe.wrap_lon((x - middle) * (360 / turn)) * (turn / 360)
            dx, dy, size = x - t.c, y - t.f, t.a * t.e - t.b * t.d
            return (t.a * dy - t.d * dx) / size, (t.e * dx - t.b * dy) / size

    def heights_m(self, lon: ArrayLike, lat: ArrayLike) -> Floats:
        """Return heights of the ground in metres at longitudes and latitudes (n,), in degrees (WGS 84).

        They are above the sea, or the ellipsoid if not `is_above_sea`; NaN outside of the raster, next to
        pixels without value, and where the value is no height on Earth. A RasterReadError says that the file
        is damaged there.
        """
        lons, lats = np.asarray(lon, np.float64), np.asarray(lat, np.float64)
        return self.heights_at(*self.pixels(lons, lats), lons, lats)

    def heights_at(self, row: Floats, col: Floats, lon: Floats, lat: Floats) -> Floats:
        """Return heights as `heights_m` at places of which `pixels` is known already, (n,) each."""
        try:
            numbers = self.sampler.sample(row, col)
        except RasterReadError as error:
            raise RasterReadError(
                f"{self.name} cannot be read where heights of the ground are needed "
                f"({cause_of(error.__cause__ or error)}); the file is damaged or incomplete: repair it"
            ) from error
        result = self.heights.offset_m + self.heights.scale_m * numbers
        if self.to_sea is not None:
            result = self.to_sea(lon, lat, result)
        result[~((result >= LOWEST_M) & (result <= HIGHEST_M))] = np.nan
        return result

    def covered(self) -> str:
        """Return the box in degrees that holds the raster, as words."""
        box = self.sampler.dataset.geobox
        rows, cols = box.shape
        along = np.linspace(0, 1, 9)
        row = np.concatenate([0 * along, 0 * along + rows, rows * along, rows * along])
        col = np.concatenate([cols * along, cols * along, 0 * along, 0 * along + cols])
        lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(row, col))
        finite = np.isfinite(lon) & np.isfinite(lat)
        if not finite.any():
            return "no place on Earth"
        lon, lat = lon[finite], lat[finite]
        lon = globe.wrap_lon(lon, around=float(lon[0]))
        west, east = (float(globe.wrap_lon(edge)) for edge in (lon.min(), lon.max()))
        return f"lat {lat.min():.6f} to {lat.max():.6f}, lon {west:.6f} to {east:.6f}"

    def notes(self) -> list[str]:
        """Return what was assumed of its heights, for the pilot."""
        zero, has_unit = self.heights.reference.zero, self.heights.has_unit
        if zero == "unknown":
            unit = "" if has_unit else ", nor in which unit"
            return [
                f"{self.name} does not say what its heights are above{unit}: they are taken for "
                f"{'heights' if has_unit else 'metres'} above the sea"
            ]
        result = [] if has_unit else [f"{self.name} does not name the unit of its heights: taken for metres"]
        if zero == "ellipsoid":
            use = "only their differences are used" if self.to_sea is None else "converted to the geoid EGM96"
            result.append(f"{self.name} has heights above the ellipsoid: {use}")
        return result


def _heights_of(path: str) -> Heights:
    """Return the CRS, unit and vertical reference of a file; refuses what is no elevation model."""
    try:
        with open_errors(path), rasterio.Env(GTIFF_REPORT_COMPD_CS="YES"), open_checked(path) as source:
            crs, dtypes, roles = source.crs, source.dtypes, [role.name for role in source.colorinterp]
            unit, scale, offset = source.units[0], float(source.scales[0]), float(source.offsets[0])
    except IndexError:
        raise RasterError(f"{path} has no bands") from None
    if not crs:
        raise RasterError(
            f"{path} has no coordinate reference system, so where its heights belong is not known; give it "
            "one with gdal_edit.py -a_srs"
        )
    planes = [dtype for dtype, role in zip(dtypes, roles, strict=True) if role != "alpha"]
    if len(planes) != 1:
        raise RasterError(
            f"{path} has {len(planes)} bands, and an elevation model has one: take the band of heights out "
            f"with gdal_translate -b N {shown(Path(path).name, quoted=False)} heights.tif"
        )
    if np.dtype(planes[0]).itemsize == 1:
        raise RasterError(f"{path} has pixels of 8 bits: it looks like a picture, not like heights")
    wkt = str(crs.to_wkt(version="WKT2_2019"))
    if not globe.is_on_earth(wkt):
        raise RasterError(f"{path} has a coordinate reference system that is not one of the Earth")
    if not (math.isfinite(scale) and math.isfinite(offset) and scale != 0):
        raise RasterError(f"{path} scales its heights by {scale:g} and moves them by {offset:g}; correct it")
    with named_errors(path, RasterError):
        reference = vertical_reference(wkt)
    unit_m = _unit_m(path, unit, reference, wkt)
    factor = unit_m or 1.0
    return Heights(wkt, reference, scale * factor, offset * factor, unit_m is not None)


def _unit_m(path: str, unit: str | None, reference: VerticalReference, wkt: str) -> float | None:
    """Return metres in the unit of heights, from the band or the CRS; None where neither says."""
    named = None
    if unit:
        named = UNITS_M.get(unit.strip().lower())
        if named is None:
            raise RasterError(
                f"{path} has heights in {shown(unit)}, a unit that is not known; known are m, dm, cm, ft and "
                "US survey foot"
            )
    known = reference.unit_m
    if named is not None and known is not None and not math.isclose(named, known, rel_tol=1e-5):
        raise RasterError(
            f"{path} contradicts itself: its band is in {shown(unit)}, and its vertical CRS "
            f"({reference.name}) in units of {known:g} m; correct it with gdal_edit.py -a_srs"
        )
    if named is None and known is None:
        plane = horizontal_crs(wkt)
        if not plane.is_geographic and not math.isclose(plane.axis_info[0].unit_conversion_factor, 1):
            raise RasterError(
                f"{path} does not name the unit of its heights, and its coordinates are in "
                f"{plane.axis_info[0].unit_name}: feet or metres? Name it with a compound CRS, for "
                "instance gdal_edit.py -a_srs EPSG:2263+6360 (heights in US survey feet) or EPSG:2263+5703 "
                "(metres)"
            )
    return known if known is not None else named
