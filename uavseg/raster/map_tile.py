"""Tiles of web maps (XYZ, Web Mercator) from raster files, read by rio-tiler from their overviews."""

import importlib.util
import threading
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterReadError
from uavseg.plain_text import cause_of
from uavseg.raster.dataset import Dataset
from uavseg.raster.opening import GDAL_ERRORS, gdal_env, quiet_open
from uavseg.raster.raster_file import RasterFile
from uavseg.warning_filters import changing_filters

SIDE = 256
_importing = threading.Lock()  # two threads that import rio-tiler at once fail


def has_map_tiles(dataset: Dataset) -> bool:
    """Whether tiles can be read: rio-tiler is installed, and the bands are shown as they are stored."""
    if importlib.util.find_spec("rio_tiler") is None:
        return False
    choice, files = dataset.choice, dataset.mosaic.files
    stored = choice.formula is None and not choice.expanded
    return stored and all(isinstance(file, RasterFile) and not file.white_is_zero for file in files)


def read_map_tile(
    dataset: Dataset, place: tuple[int, int, int]
) -> tuple[NDArray[Any], NDArray[np.bool_]] | None:
    """Values of a tile and where they are valid; of overlapping files the first valid pixel.

    Parameters
    ----------
    dataset : Dataset
        One of `has_map_tiles`.
    place : (zoom, x, y)

    Returns
    -------
    values, valid : (bands, 256, 256) array, (256, 256) bool array
        Or None where no file has a pixel.

    Raises
    ------
    RasterReadError
        If a file cannot be read.
    """
    found: tuple[NDArray[Any], NDArray[np.bool_]] | None = None
    for file in dataset.mosaic.files:
        assert isinstance(file, RasterFile)
        part = _file_tile(file, dataset.choice.bands, place)
        if part is None:
            continue
        if found is None:
            found = part
        else:
            values, valid = found
            found = np.where(valid, values, part[0]), valid | part[1]
        if found[1].all():
            break
    return found


def _file_tile(
    file: RasterFile, bands: tuple[int, ...], place: tuple[int, int, int]
) -> tuple[NDArray[Any], NDArray[np.bool_]] | None:
    with _importing:
        from rio_tiler.errors import NoOverviewWarning, RioTilerError, TileOutsideBounds
        from rio_tiler.io import Reader

    zoom, x, y = place
    nodata = file.nodatas[bands[0] - 1]
    try:
        with (
            gdal_env(file.online),
            changing_filters(),
            quiet_open(file.path, driver=file.driver) as source,
        ):
            warnings.simplefilter("ignore", NoOverviewWarning)
            with Reader(file.path, dataset=source) as reader:
                tile = reader.tile(x, y, zoom, tilesize=SIDE, indexes=bands, nodata=nodata)
            values = np.asarray(tile.array.data)
            valid = np.asarray(~np.ma.getmaskarray(tile.array).any(axis=0), np.bool_)
    except TileOutsideBounds:
        return None
    except (*GDAL_ERRORS, RioTilerError) as error:
        raise RasterReadError(f"{file.path} cannot be read ({cause_of(error)})") from error
    return (values, valid) if valid.any() else None
