"""Tiles of web maps (XYZ, Web Mercator) from raster files, read by rio-tiler from their overviews."""

import importlib.util
import threading
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterReadError
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import GDAL_ERRORS, gdal_env, quiet_open
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.part_reader import with_formula
from uavseg.raster.read.raster_file import RasterFile
from uavseg.raster.read.tile_pixels import SIDE, tile_pixels
from uavseg.raster.spectral.bands import BandChoice
from uavseg.warning_filters import changing_filters

_importing = threading.Lock()  # two threads that import rio-tiler at once fail

Tile = tuple[NDArray[Any], NDArray[np.bool_]]
"""Values (1 or 3, 256, 256) and where they are valid (256, 256)."""


def has_map_tiles(dataset: Dataset) -> bool:
    """Whether tiles can be read: rio-tiler is installed, and the raster consists of files."""
    files = dataset.mosaic.files
    return importlib.util.find_spec("rio_tiler") is not None and all(
        isinstance(file, RasterFile) for file in files
    )


def read_map_tile(dataset: Dataset, place: tuple[int, int, int]) -> Tile | None:
    """Values of a tile and where they are valid, as of `Dataset.read`: of files the first valid pixel wins.

    Parameters
    ----------
    dataset : Dataset
        One of `has_map_tiles`. Its collar is not valid.
    place : (zoom, x, y)

    Returns
    -------
    values, valid : (1 or 3, 256, 256) array, (256, 256) bool array
        Or None where no pixel is valid.

    Raises
    ------
    RasterReadError
        If a file cannot be read.
    """
    found: Tile | None = None
    for file in dataset.mosaic.files:
        assert isinstance(file, RasterFile)
        below = tile_pixels(GeoBox(file.shape, file.transform, dataset.geobox.crs), place)
        part = None if below is None else _file_tile(file, dataset.choice, place, below.inside)
        if part is None:
            continue
        if found is None:
            found = part
        else:
            values, valid = found
            found = np.where(valid, values, part[0]), valid | part[1]
        if found[1].all():
            break
    return None if found is None else _without_collar(dataset, place, *found)


def _without_collar(
    dataset: Dataset, place: tuple[int, int, int], values: NDArray[Any], valid: NDArray[np.bool_]
) -> Tile | None:
    if dataset.collar is not None:
        below = tile_pixels(dataset.geobox, place)
        if below is None:
            return None
        valid = valid & below.inside & ~dataset.collar.at(below.rows, below.cols)
    return (values, valid) if valid.any() else None


def _file_tile(
    file: RasterFile, choice: BandChoice, place: tuple[int, int, int], inside: NDArray[np.bool_]
) -> Tile | None:
    """The tile of a file, which has the pixels that are `inside`."""
    with _importing:
        from rio_tiler.errors import NoOverviewWarning, RioTilerError, TileOutsideBounds
        from rio_tiler.io import Reader

    zoom, x, y = place
    nodata, alpha = file.nodatas[choice.bands[0] - 1], file.layout.alpha
    how = {
        "indexes": choice.bands if alpha is None else (*choice.bands, alpha),
        "nodata": nodata,
        "vrt_options": {"dtype": file.layout.dtypes[choice.bands[0] - 1]},
    }
    try:
        with (
            gdal_env(file.online),
            changing_filters(),
            quiet_open(file.path, driver=file.driver) as source,
        ):
            warnings.simplefilter("ignore", NoOverviewWarning)
            with Reader(file.path, dataset=source) as reader:
                tile = reader.tile(x, y, zoom, tilesize=SIDE, **how)
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
