"""Tiles of web maps (XYZ, Web Mercator): of raster files, read by rio-tiler from overviews; of cell codes."""

import importlib.util
import threading
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import RasterReadError
from uavseg.jobs.web_map.content import CellCodes, FieldMap, colored
from uavseg.jobs.web_map.mercator import webp_of
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground_grid import GroundGrid
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.mosaic import with_formula
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.tile_pixels import SIDE, tile_pixels
from uavseg.raster.spectral.bands import BandChoice
from uavseg.segmentation.blocks.leaves import NO_CODE, STEPS
from uavseg.units import CELL
from uavseg.warning_filters import changing_filters

_importing = threading.Lock()  # two threads that import rio-tiler at once fail

Tile = tuple[NDArray[Any], NDArray[np.bool_]]
"""Values (1 or 3, 256, 256) and where they are valid (256, 256)."""


def has_map_tiles(dataset: Dataset) -> bool:
    """Return whether tiles can be read: rio-tiler is installed, and the raster consists of files."""
    has_reader = importlib.util.find_spec("rio_tiler") is not None
    return has_reader and all(isinstance(file, RasterFile) for file in dataset.mosaic.files)


def map_tile(dataset: Dataset, stretch: Stretch, place: tuple[int, int, int]) -> bytes | None:
    """Draw a tile of a web map in the colours of its picture, as WebP; None where the raster has nothing.

    The dataset is without its collar, the stretch that of the picture. The place is zoom, x and y in the
    usual numbering of tiles of Web Mercator.
    """
    tile = read_map_tile(dataset, place)
    return None if tile is None else webp_of(colored(*tile, stretch, dataset))


def read_map_tile(dataset: Dataset, place: tuple[int, int, int]) -> Tile | None:
    """Read the values of a tile and where they are valid; of several files the first valid pixel wins.

    The dataset is one of `has_map_tiles`, whose collar is not valid. None where no pixel is.
    """
    tile: Tile | None = None
    for file in dataset.mosaic.files:
        assert isinstance(file, RasterFile)
        below = tile_pixels(GeoBox(file.shape, file.transform, dataset.geobox.crs), place)
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
    if tile is None or dataset.collar is None:
        return tile
    values, valid = tile
    below = tile_pixels(dataset.geobox, place)
    if below is None:
        return None
    valid = valid & below.inside & ~dataset.collar.at(below.rows, below.cols)
    return (values, valid) if valid.any() else None


def _file_tile(
    file: RasterFile, choice: BandChoice, place: tuple[int, int, int], inside: NDArray[np.bool_]
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
    """Tiles of the codes of cells, which a page colours for any range of a slider, where it cannot hold all.

    For codes, (m, n), see `leaf_codes`; they are 65535 where a cell has no valid pixel. `areas`, (2001,), are
    the square metres of the cells of each code.
    """

    codes: NDArray[np.uint16]
    geobox: GeoBox
    areas: NDArray[np.float64]

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


def areas_by_code(cells: CellCodes, ground: GroundGrid) -> NDArray[np.float64]:
    """Sum the square metres of the cells with valid pixels, by their codes from 0 to 2000: (2001,).

    The areas of pixels are those of the parts of the ground in which the centres of cells lie.
    """
    heights, widths = (_sides(length) for length in cells.shape)
    row, col = (_parts(*pair) for pair in zip(cells.shape, ground.pixel_m2.shape, strict=True))
    areas = np.zeros(NO_CODE + 1)
    for n, (codes, counts) in enumerate(zip(cells.codes, cells.counts, strict=True)):
        weights = heights[n] * widths * ground.pixel_m2[row[n], col]
        valid = counts > 0
        areas += np.bincount(codes[valid], weights[valid], len(areas))
    return areas[: 2 * STEPS + 1]


def _sides(length: int) -> NDArray[np.int64]:
    """Return the rows of pixels of each row of cells; the same for columns."""
    return np.minimum(CELL, length - CELL * np.arange(-(-length // CELL)))


def _parts(length: int, parts: int) -> NDArray[np.int64]:
    """Return the part of the ground in which the middle of each row of cells lies; the same for columns."""
    middles = CELL * np.arange(-(-length // CELL)) + CELL // 2
    return np.minimum(middles * parts // length, parts - 1)
