"""Content of a web map of a raster: a picture in Web Mercator, and block means for ranges."""

import numpy as np
from affine import Affine
from rasterio.io import MemoryFile
from rasterio.warp import Resampling, reproject

from uavseg.arrays import Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError
from uavseg.execution.executors import phase
from uavseg.jobs.divide import block_map_of
from uavseg.jobs.result.result import SourceInfo
from uavseg.jobs.source.open_source import raster_of
from uavseg.jobs.source.source import Source
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open
from uavseg.raster.geodesy.globe import WGS84, is_on_earth, transform_between
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import GroundGrid, ground_grid
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import DatasetOverview
from uavseg.segmentation.blocks.leaves import STEPS as STEPS, leaf_codes
from uavseg.segmentation.params.segment import SegmentParams
from uavseg.units import CELL

MIN_SIZE, MAX_SIZE = 64, 8192
MAX_CELLS = 1 << 22  # about 16384 x 16384 pixels
WEB_MERCATOR = "EPSG:3857"
QUALITY = 80


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
    try:
        with gdal_env():
            for band, method in zip(range(4), [Resampling.bilinear] * 3 + [Resampling.nearest], strict=True):
                reproject(image[band], placed[band], **grids, resampling=method)
            content = webp_of(placed)
    except GDAL_ERRORS as error:
        raise RasterError(f"the picture cannot be drawn in Web Mercator ({cause_of(error)})") from error
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
