"""Sample areas: discs, files of polygons, and the masks of the pixels that they cover."""

import math
import os
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats, Integers, Objects, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RegionError, SampleError
from uavseg.raster.geodesy.globe import geod_of, is_geographic, transform_between, wrap_lon
from uavseg.raster.grid.geobox import GeoBox, pixels_inside
from uavseg.raster.grid.tiling import Window
from uavseg.regions.formats.read import read_local_regions, read_regions, regions_of_frame
from uavseg.regions.table import Regions
from uavseg.units import CELL
from uavseg.warning_filters import changing_filters

MAX_SAMPLE_PIXELS = 1 << 24  # of the bounding box of a sample, which is held in memory
_CORNERS = 256  # of the polygon that approximates a disc
_CLASS = "class"  # column of a file of samples


@dataclass(frozen=True, slots=True)
class Disc:
    """Disc on the map, in its coordinates; the radius in metres if they are degrees."""

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y) and 0 < self.radius < math.inf):
            raise ParameterError(
                f"a sample X,Y,RADIUS has a centre on the map and a radius above 0, not "
                f"{self.x:g},{self.y:g},{self.radius:g}"
            )

    @property
    def word(self) -> str:
        """As options of the command line take it."""
        return f"{self.x:.15g},{self.y:.15g},{self.radius:.15g}"


def parse_like(text: str) -> Disc | str:
    """Parse a sample: a disc if the text is three numbers between commas, else the name of a file.

    Examples
    --------
    >>> parse_like("500,-20.5,8")
    Disc(x=500.0, y=-20.5, radius=8.0)
    >>> parse_like("field.geojson")
    'field.geojson'
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return text
    if len(numbers) != 3:
        raise ParameterError(f"a sample is X,Y,RADIUS or a file of polygons, not {text!r}")
    return Disc(*numbers)


@dataclass(frozen=True)
class SampleMask:
    """Mask of the pixels of a sample, in its bounding box of whole cells, clipped to the raster.

    `bits` are 1 for each pixel of the sample, packed along rows.
    """

    window: Window
    bits: Uint8s

    @property
    def mask(self) -> Bools:
        """Pixels of the sample, (rows, cols)."""
        return np.unpackbits(self.bits, axis=1, count=self.window.cols).view(bool)

    def part(self, window: Window) -> Bools:
        """Return the mask of a window within the bounding box."""
        row, col = window.row - self.window.row, window.col - self.window.col
        return self.mask[row : row + window.rows, col : col + window.cols]

    def cell_counts(self) -> Integers:
        """Return the number of pixels of the sample in each cell of the bounding box."""
        mask = self.mask
        rows, cols = (-(-length // CELL) for length in mask.shape)
        padded = np.pad(mask, ((0, rows * CELL - mask.shape[0]), (0, cols * CELL - mask.shape[1])))
        return np.asarray(padded.reshape(rows, CELL, cols, CELL).sum((1, 3), dtype=np.int64))

    def meets(self, other: "SampleMask") -> bool:
        """Check whether two samples have pixels in common."""
        common = self.window.common(other.window)
        return bool(common.rows and common.cols and (self.part(common) & other.part(common)).any())


def sample_mask(like: Disc | str, geobox: GeoBox) -> SampleMask:
    """Return the mask of the pixels of a raster whose centres lie in a sample.

    It is a disc, or the name of a file of polygons in any CRS, see `read_regions`. A SampleError says that
    the sample lies outside of the raster, or that its bounding box has more than 2^24 pixels, a RegionError
    that the file cannot be read as polygons.
    """
    if isinstance(like, Disc):
        return _mask(to_pixels(disc_polygon(like, geobox), geobox), geobox, "the sample")
    return _mask(_read_polygons(like, geobox)[1], geobox, f"the sample {like}")


def class_masks(name: str, geobox: GeoBox) -> dict[str, list[SampleMask]]:
    """Return masks of the samples of each class, in the order in which classes first appear.

    `name` is a file of polygons with a column `class`, in any coordinate system. A SampleError says that the
    raster has no CRS, the file has no such column, a sample has no class or lies outside of the raster, or
    there are fewer than two classes; a RegionError that the file cannot be read as polygons.
    """
    regions, polygons = _read_polygons(name, geobox)
    if _CLASS not in regions.columns:
        raise SampleError(
            f"{name} has no column {_CLASS!r}, which names the class of each sample; it has "
            f"{', '.join(regions.columns)}"
        )
    classes = [_class_name(value) for value in regions.columns[_CLASS]]
    if None in classes:
        raise SampleError(
            f"sample {classes.index(None) + 1} of {name} has no class; give it one, or remove it"
        )
    masks: dict[str, list[SampleMask]] = {}
    for k, label in enumerate(classes):
        one = polygons[k : k + 1]
        masks.setdefault(str(label), []).append(_mask(one, geobox, f"a sample of {name}"))
    if len(masks) < 2:
        raise SampleError(f"{name} has samples of one class; give some of another one, or use --like {name}")
    return masks


def _class_name(value: object) -> str | None:
    """Return a class as text; None for a missing value or empty text."""
    if value is None or (isinstance(value, float | np.floating) and not np.isfinite(value)):
        return None
    if isinstance(value, float | np.floating) and float(value).is_integer():
        value = int(value)  # a column of whole numbers with a gap is read as floats
    return str(value).strip() or None


def _mask(on_grid: Objects, geobox: GeoBox, name: str) -> SampleMask:
    with changing_filters():  # shapely changes them itself
        bounds = shapely.total_bounds(on_grid)
    if not np.isfinite(bounds).all():
        raise SampleError(f"{name} has no coordinates in the raster's CRS")
    window = bounding_cells(bounds, geobox.shape)
    if window.rows == 0 or window.cols == 0:
        raise SampleError(f"{name} lies outside of the raster, which is {extent(geobox)}")
    if window.rows * window.cols > MAX_SAMPLE_PIXELS:
        raise SampleError(
            f"{name} spans {window.rows:,} x {window.cols:,} pixels; at most {MAX_SAMPLE_PIXELS:,} are read: "
            "give a smaller one"
        )
    return SampleMask(window, np.packbits(pixels_inside(on_grid, window), axis=1))


def disc_polygon(disc: Disc, geobox: GeoBox) -> Objects:
    """Return a disc as a polygon in map coordinates, (1,); geodesic if they are degrees."""
    angles = np.linspace(0, 360, _CORNERS, endpoint=False)
    wkt = geobox.wkt
    if wkt is not None and is_geographic(wkt):
        x, y, radius = (np.full(_CORNERS, number) for number in (disc.x, disc.y, disc.radius))
        x, y, _ = geod_of(wkt).fwd(x, y, angles, radius)
        x = wrap_lon(x, around=disc.x)
    else:
        x = disc.x + disc.radius * np.sin(np.radians(angles))
        y = disc.y + disc.radius * np.cos(np.radians(angles))
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise SampleError(f"the sample lies outside of the raster, which is {extent(geobox)}")
    return np.array([shapely.Polygon(np.stack([x, y], axis=1))], object)


def _read_polygons(name: str, geobox: GeoBox) -> tuple[Regions, Objects]:
    """Read regions, and their polygons in the pixels of a raster."""
    if geobox.wkt is None:
        raise SampleError(
            f"the raster has no CRS, so the position of {name} in it is unknown; "
            "give the sample as X,Y,RADIUS"
        )
    regions = read_regions(name)
    return regions, to_pixels(np.asarray(regions.polygons), geobox, regions.wkt)


def polygons_on(geobox: GeoBox, source: Any, layer: str | None = None) -> tuple[Objects, list[str]]:
    """Read polygons from a file (a layer of it) or a GeoDataFrame, in pixels of a grid, with notes.

    On a grid without a CRS they have its coordinates. A RegionError says that they cannot be read, or that
    one of the two alone has a CRS.
    """
    local = geobox.crs is None
    if not isinstance(source, str | os.PathLike):
        regions = regions_of_frame(source, local)
    else:
        regions = read_local_regions(source, layer) if local else read_regions(source, layer)
    if local and regions.wkt is not None:
        name = source if isinstance(source, str | os.PathLike) else "the frame"
        raise RegionError(
            f"{name} has a CRS and the raster has none, so where it lies is unknown; give polygons without "
            "one, in the raster's coordinates"
        )
    polygons = to_pixels(np.asarray(regions.polygons), geobox, regions.wkt)
    return polygons, list(regions.metadata.get("notes", []))


def to_pixels(polygons: Objects, geobox: GeoBox, wkt: str | None = None) -> Objects:
    """Return polygons, of the raster's CRS or another, in pixel coordinates (col, row)."""
    if wkt is not None:
        polygons = shapely.transform(polygons, transform_between(wkt, geobox.wkt), interleaved=False)
    back = ~geobox.transform

    def pixels(x: Any, y: Any) -> tuple[Any, Any]:
        return back.a * x + back.b * y + back.c, back.d * x + back.e * y + back.f

    return np.asarray(shapely.transform(polygons, pixels, interleaved=False))


def bounding_cells(bounds: Floats, shape: tuple[int, int]) -> Window:
    """Return the window of the cells that bounds (col, row, col, row) intersect, clipped to the raster."""
    limit = np.array([shape[1], shape[0]])
    first = np.clip(np.floor(bounds[:2]), 0, limit).astype(int) // CELL * CELL
    end = np.clip(np.ceil(bounds[2:]), 0, limit).astype(int)
    cols, rows = np.maximum(end - first, 0).tolist()
    nothing = (bounds[2:] <= 0).any() or (bounds[:2] >= limit).any()
    return Window(int(first[1]), int(first[0]), 0 if nothing else rows, 0 if nothing else cols)


def extent(geobox: GeoBox) -> str:
    """Return the coordinates between which a grid lies, for messages."""
    x, y = geobox.corners
    return f"x {x.min():.10g} to {x.max():.10g} by y {y.min():.10g} to {y.max():.10g}"
