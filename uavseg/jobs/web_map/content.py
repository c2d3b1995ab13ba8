"""Content of a web map of a raster: a picture in Web Mercator, block means for ranges, and tiles (XYZ).

Tiles are those of raster files, read by rio-tiler from overviews, and of cell codes.
"""

import importlib.util
import threading
import warnings
from functools import lru_cache
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.io import MemoryFile
from rasterio.warp import Resampling, reproject

from uavseg.arrays import Bools, Floats, Integers, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError, RasterReadError, caused_errors
from uavseg.execution.executors import phase
from uavseg.jobs.divide import block_map_of
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import raster_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open
from uavseg.raster.geodesy.globe import WGS84, Transform, is_on_earth, lonlat_transform, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import GroundGrid, ground_grid
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset, DatasetOverview
from uavseg.raster.read.mosaic import with_formula
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.warp import bends, bilinear
from uavseg.raster.spectral.bands import BandChoice
from uavseg.segmentation.blocks.leaves import NO_CODE, STEPS as STEPS, leaf_codes
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.units import CELL
from uavseg.warning_filters import changing_filters

MIN_SIZE, MAX_SIZE = 64, 8192
MAX_CELLS = 1 << 22  # about 16384 x 16384 pixels
WEB_MERCATOR = "EPSG:3857"
QUALITY = 80
_importing = threading.Lock()  # two threads that import rio-tiler at once fail

Tile = tuple[NDArray[Any], NDArray[np.bool_]]
"""Values (1 or 3, 256, 256) and where they are valid (256, 256)."""
SIDE = 256
TOLERANCE = 1 / 64  # of the interpolation, in pixels of the raster
_INTERVALS = 32
_EDGE_PARTS = 32  # in which a side of the raster is divided to find its bounds
_RIM = 0.05  # by which bounds are widened, as a part of their width


@dataclass(frozen=True)
class MercatorImage:
    """A north-up WebP file in Web Mercator, its rows and columns, its outer edges W, S, E, N in degrees."""

    webp: bytes
    shape: tuple[int, int]
    bounds: tuple[float, float, float, float]


def to_mercator(image: Uint8s, geobox: GeoBox, ground: GroundGrid, size: int) -> MercatorImage:
    """Reproject an RGBA picture, (4, rows, cols), to Web Mercator.

    rasterio's `calculate_default_transform` is not used: it makes the quarry of the samples 640 pixels wide,
    here it is up to 850, and the picture would have other bytes.

    `geobox` is its grid, `ground` are places of the same extent. `size` is the longest side of the result in
    pixels, at most; the picture is not enlarged. RasterError is raised if it cannot be reprojected or
    encoded.
    """
    x, y = transform_between(WGS84, WEB_MERCATOR)(ground.lon, ground.lat)
    left, right, bottom, top = float(x.min()), float(x.max()), float(y.min()), float(y.max())
    longest = min(size, round(float(np.hypot(*image.shape[1:]))))
    step = max(right - left, top - bottom) / longest
    shape = (max(round((top - bottom) / step), 1), max(round((right - left) / step), 1))
    transform = Affine((right - left) / shape[1], 0, left, 0, -(top - bottom) / shape[0], top)
    placed = np.zeros((4, *shape), np.uint8)
    grids = {"src_transform": geobox.transform, "src_crs": geobox.crs}
    grids |= {"dst_transform": transform, "dst_crs": WEB_MERCATOR}
    with caused_errors("the picture cannot be drawn in Web Mercator", RasterError, *GDAL_ERRORS), gdal_env():
        for band, method in zip(range(4), [Resampling.bilinear] * 3 + [Resampling.nearest], strict=True):
            reproject(image[band], placed[band], **grids, resampling=method)
        content = webp_of(placed)
    lon, lat = transform_between(WEB_MERCATOR, WGS84)(np.array([left, right]), np.array([bottom, top]))
    west, east, south, north = float(lon[0]), float(lon[1]), float(lat[0]), float(lat[1])
    return MercatorImage(content, shape, (west, south, east, north))


def webp_of(image: Uint8s) -> bytes:
    """Return a (4, rows, cols) picture of red, green, blue and alpha as the content of a WebP file."""
    bands, rows, cols = image.shape
    with MemoryFile(ext=".webp") as memory:
        how = {"driver": "WEBP", "height": rows, "width": cols, "count": bands, "dtype": "uint8"}
        with quiet_open(memory.name, "w", **how, QUALITY=QUALITY) as file:
            file.write(image)
        return bytes(memory.read())


@dataclass(frozen=True, slots=True)
class FieldMapRequest:
    """Options of a web map."""

    segment: SegmentParams = SegmentParams()
    size: int = 2048  # the longest side of the picture in pixels, 64 to 8192
    all_cells: bool = False  # compute cells even where they are too many for a page

    def __post_init__(self) -> None:
        if not MIN_SIZE <= self.size <= MAX_SIZE:
            bounds = f"{MIN_SIZE} to {MAX_SIZE} pixels"
            raise ParameterError(f"the longest side of the picture is {bounds}, not {self.size}")


@dataclass(frozen=True)
class CellCodes:
    """Position of the mean of each cell's leaf among the steps of a slider."""

    shape: tuple[int, int]  # rows and columns of the raster
    codes: Uint16s  # (m, n), see `leaf_codes`
    counts: Uint8s  # (m, n) valid pixels


@dataclass(frozen=True)
class FieldMap:
    """A raster for a web map; without cells where it is too large for a page, unless all were requested."""

    image: MercatorImage
    ground: GroundGrid
    cells: CellCodes | None
    info: SourceInfo
    warnings: tuple[str, ...]

    @property
    def fits_page(self) -> bool:
        """Return whether a page can hold the cells."""
        return self.cells is not None and self.cells.codes.size <= MAX_CELLS


def field_map(source: Source, request: FieldMapRequest = FieldMapRequest(), work: Work = SERIAL) -> FieldMap:
    """Compute the picture and block means of a raster; RasterError if Web Mercator cannot show it."""
    work = work.begun()
    raster = raster_of(source, "a block map holds no picture; name the raster that it was made from")
    if raster.geobox.crs is None or not is_on_earth(raster.geobox.wkt):
        raise RasterError(
            f"{raster.name} has no coordinate system on Earth, so it has no place on a map; give it one "
            "(gdal_edit.py -a_srs), or draw it with uavseg preview"
        )
    ground = ground_grid(raster.geobox)
    tile_pass = work.over(raster)
    saved, info = block_map_of(raster, tile_pass)
    with phase("picture"), work.reading_here():
        coarse = DatasetOverview.of(raster.cleaned(tile_pass.silent), request.size)
        picture = saved.stretch.colored(*coarse.read(Window(0, 0, *coarse.geobox.shape)))
        image = to_mercator(picture, coarse.geobox, ground, request.size)
    cells, notes = None, info.warnings
    rows, cols = raster.geobox.shape
    here = np.s_[: -(-rows // CELL), : -(-cols // CELL)]
    if request.all_cells or here[0].stop * here[1].stop <= MAX_CELLS:
        codes = np.ascontiguousarray(leaf_codes(saved.blocks, request.segment.division)[here])
        cells = CellCodes(saved.blocks.shape, codes, np.ascontiguousarray(saved.blocks.counts[here]))
    else:
        size = f"{cols} x {rows} pixels are too many for the slider of a page"
        notes = (*notes, f"{size}, so it is left out; uavseg serve has one")
    return work.finished(FieldMap(image=image, ground=ground, cells=cells, info=info, warnings=notes))


def has_map_tiles(dataset: Dataset) -> bool:
    """Return whether tiles can be read: rio-tiler is installed, and the raster consists of files."""
    has_reader = importlib.util.find_spec("rio_tiler") is not None
    return has_reader and all(isinstance(file, RasterFile) for file in dataset.mosaic.files)


def read_map_tile(dataset: Dataset, place: tuple[int, int, int]) -> Tile | None:
    """Read the values of a tile and where they are valid; of several files the first valid pixel wins.

    The dataset is one of `has_map_tiles`, whose masks are not valid. None where no pixel is.
    """
    tile: Tile | None = None
    for file in dataset.mosaic.files:
        assert isinstance(file, RasterFile)
        below = tile_pixels(GeoBox(file.shape, file.transform, file.crs), place)
        part = None if below is None else _file_tile(file, dataset.choice, place, below.inside)
        if part is None:
            continue
        if tile is None:
            tile = part
        else:
            values, valid = tile
            tile = np.where(valid, values, part[0]), valid | part[1]
        if tile[1].all():
            break
    below = tile_pixels(dataset.geobox, place)  # of files a part may be read
    if tile is None or below is None:
        return None
    values, valid = tile[0], tile[1] & below.inside
    for mask in dataset.masks:
        valid &= ~mask.at(below.rows, below.cols)
    return (values, valid) if valid.any() else None


def _file_tile(
    file: RasterFile, choice: BandChoice, place: tuple[int, int, int], inside: Bools
) -> Tile | None:
    """Read the tile of a file, which has the pixels that are `inside`."""
    with _importing:
        from rio_tiler.errors import NoOverviewWarning, RioTilerError, TileOutsideBounds
        from rio_tiler.io import Reader

    zoom, x, y = place
    nodata, alpha = file.nodatas[choice.bands[0] - 1], file.layout.alpha
    options = {
        "indexes": choice.bands if alpha is None else (*choice.bands, alpha),
        "nodata": nodata,
        "vrt_options": {"dtype": file.layout.dtypes[choice.bands[0] - 1]},
    }
    try:
        with gdal_env(file.online), changing_filters(), quiet_open(file.path, driver=file.driver) as source:
            warnings.simplefilter("ignore", NoOverviewWarning)
            with Reader(file.path, dataset=source) as reader:
                tile = reader.tile(x, y, zoom, tilesize=SIDE, **options)
    except TileOutsideBounds:
        return None
    except (*GDAL_ERRORS, RioTilerError) as error:
        raise RasterReadError(f"{file.path} cannot be read ({cause_of(error)})") from error
    stored = np.asarray(tile.array.data)
    if file.masks:
        inside = inside & ~np.ma.getmaskarray(tile.array)[: len(choice.bands)].any(axis=0)
    opacity = None if alpha is None else stored[-1]
    values, valid = file.decode(stored[: len(choice.bands)], opacity, inside, choice)
    values, valid = with_formula(file, choice, values, valid)
    valid = np.ones((SIDE, SIDE), bool) if valid is None else valid
    return (values, valid) if valid.any() else None


@dataclass(frozen=True)
class CellTiles:
    """Tiles of the codes of cells, which a page that cannot hold all colours for any range of a slider."""

    codes: Uint16s  # (m, n): see `leaf_codes`; 65535 where a cell has no valid pixel
    geobox: GeoBox
    areas: Floats  # (2001,): square metres of the cells of each code

    @classmethod
    def of(cls, field_map: FieldMap) -> "CellTiles":
        """Make tiles of the cells of a web map, which has them."""
        assert field_map.cells is not None
        codes = np.where(field_map.cells.counts > 0, field_map.cells.codes, np.uint16(NO_CODE))
        return cls(codes, field_map.info.geobox, areas_by_code(field_map.cells, field_map.ground))

    def tile(self, place: tuple[int, int, int]) -> bytes | None:
        """Look up the code of the cell below the centre of each pixel of a tile, at a place as of `map_tile`.

        The content is 256 rows of 256 little-endian 16-bit integers, 65535 beside the raster; None where all
        are.
        """
        pixels = tile_pixels(self.geobox, place)
        if pixels is None:
            return None
        below = self.codes[pixels.rows // CELL, pixels.cols // CELL]
        return np.where(pixels.inside, below, np.uint16(NO_CODE)).astype("<u2").tobytes()


def areas_by_code(cells: CellCodes, ground: GroundGrid) -> Floats:
    """Sum the square metres of the cells with valid pixels, by their codes from 0 to 2000: (2001,).

    The areas of pixels are those of the parts of the ground in which the centres of cells lie.
    """
    starts = (CELL * np.arange(-(-length // CELL)) for length in cells.shape)
    heights, widths = (np.minimum(CELL, end - each) for end, each in zip(cells.shape, starts, strict=True))
    row, col = (_parts(*pair) for pair in zip(cells.shape, ground.pixel_m2.shape, strict=True))
    areas = np.zeros(NO_CODE + 1)
    for n, (codes, counts) in enumerate(zip(cells.codes, cells.counts, strict=True)):
        weights = heights[n] * widths * ground.pixel_m2[row[n], col]
        valid = counts > 0
        areas += np.bincount(codes[valid], weights[valid], len(areas))
    return areas[: 2 * STEPS + 1]


def _parts(length: int, parts: int) -> Integers:
    """Return the part of the ground in which the middle of each row of cells lies; the same for columns."""
    middles = CELL * np.arange(-(-length // CELL)) + CELL // 2
    return np.minimum(middles * parts // length, parts - 1)


@dataclass(frozen=True)
class TilePixels:
    """Pixels of a raster below the pixels of a tile."""

    rows: Integers  # (256, 256); 0 outside of the raster
    cols: Integers
    inside: Bools  # (256, 256), whether the centre of the tile's pixel lies on the raster


def tile_pixels(geobox: GeoBox, place: tuple[int, int, int]) -> TilePixels | None:
    """Return the pixel of a raster that holds the centre of each pixel of a tile.

    Not `rasterio.warp.transform` of each centre: the same pixels, but 33 ms a tile in place of 2.

    Rows and columns are interpolated between 33 x 33 places where that errs by less than 1/64 of a pixel, and
    computed for every centre elsewhere.

    The raster is on Earth, and `place` is (zoom, x, y) in the usual numbering of tiles of Web Mercator. None
    where the tile lies beside the raster.
    """
    west, south, east, north = _bounds(geobox.shape, geobox.transform, geobox.wkt)
    lon, lat = _lonlat_of(place, (np.arange(SIDE) + 0.5) / SIDE)
    within = ((lat >= south) & (lat <= north))[:, None] & ((lon >= west) & (lon <= east))
    if not within.any():
        return None
    rows, cols = _interpolated(geobox, place)
    if rows is None or cols is None:
        rows, cols = _rows_cols(geobox, lon, lat)
    with np.errstate(invalid="ignore"):
        inside = within & (rows >= 0) & (cols >= 0) & (rows < geobox.shape[0]) & (cols < geobox.shape[1])
    if not inside.any():
        return None
    return TilePixels(_whole(rows, inside), _whole(cols, inside), inside)


def _whole(values: Floats, inside: Bools) -> Integers:
    return np.floor(np.where(inside, values, 0)).astype(np.int64)


def _lonlat_of(place: tuple[int, int, int], shares: Floats) -> tuple[Floats, Floats]:
    """Return longitudes and latitudes in degrees at shares of the sides of a tile."""
    zoom, x, y = place
    lon = (x + shares) / 2**zoom * 360 - 180
    lat = np.degrees(np.arctan(np.sinh(np.pi * (1 - 2 * (y + shares) / 2**zoom))))
    return lon, lat


def _rows_cols(geobox: GeoBox, lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
    """Return rows and columns, not whole, at the crossings of longitudes and latitudes."""
    x, y = _from_lonlat(geobox.wkt)(*np.meshgrid(lon, lat))
    t = ~geobox.transform
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):  # infinite outside of the domain of a projection
        return t.d * x + t.e * y + t.f, t.a * x + t.b * y + t.c


def _interpolated(geobox: GeoBox, place: tuple[int, int, int]) -> tuple[Floats, Floats] | tuple[None, None]:
    """Return rows and columns of all centres, bilinear between nodes; None where that is not exact enough."""
    known = _rows_cols(geobox, *_lonlat_of(place, np.linspace(0, 1, _INTERVALS + 1)))
    if not all((bends(values) < 4 * TOLERANCE).all() for values in known):
        return None, None
    along = (np.arange(SIDE) + 0.5) / SIDE * _INTERVALS
    rows, cols = (bilinear(values, along, along) for values in known)
    return rows, cols


@lru_cache(maxsize=4096)
def _bounds(shape: tuple[int, int], transform: Affine, wkt: str | None) -> tuple[float, float, float, float]:
    """Return the bounds of a raster in degrees, widened: beyond them its projection may be ambiguous."""
    share = np.linspace(0, 1, _EDGE_PARTS + 1)
    rows, cols = np.meshgrid(share * shape[0], share * shape[1], indexing="ij")
    t = transform
    lon, lat = lonlat_transform(wkt)(t.a * cols + t.b * rows + t.c, t.d * cols + t.e * rows + t.f)
    lon, lat = lon[np.isfinite(lon)], lat[np.isfinite(lat)]
    if not (lon.size and lat.size):
        return 180.0, 90.0, -180.0, -90.0
    wide, high = _RIM * (lon.max() - lon.min()), _RIM * (lat.max() - lat.min())
    return lon.min() - wide, lat.min() - high, lon.max() + wide, lat.max() + high


@lru_cache(maxsize=32)
def _from_lonlat(wkt: str | None) -> Transform:
    lonlat_transform(wkt)  # says what is wrong where the CRS has no longitude and latitude
    return transform_between(WGS84, wkt)
