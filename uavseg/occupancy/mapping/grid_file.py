"""Files of occupancy grids: the log-odds of all cells as a GeoTIFF, so that merging can go on."""

import os

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MapError
from uavseg.occupancy.mapping.pending import MAX_LOG_ODDS
from uavseg.raster.formats.geotiff import check_geotiff_name, read_geotiff, write_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset

Float32s = NDArray[np.float32]

MAX_CELLS = 100_000_000  # of a grid in a file: 5 km x 5 km of cells of half a metre, about 1 GB in memory

LOG_ODDS = "log-odds of occupancy"  # description of the band

_TAG, _CONTENT = "UAVSEG_OCCUPANCY_GRID", "log-odds"


def check_cells(shape: tuple[int, int], what: str) -> None:
    """Raise MapError if a grid has more cells than are kept in a file or made from one."""
    rows, cols = shape
    if rows * cols > MAX_CELLS:
        raise MapError(f"{what} has {cols:,} x {rows:,} cells; at most {MAX_CELLS:,} are possible")


def write_grid_file(
    path: str | os.PathLike[str], log_odds: Float32s, geobox: GeoBox, overwrite: bool = False
) -> None:
    """Write the log-odds of a grid.

    Parameters
    ----------
    path : path
        Ends in .tif or .tiff.
    log_odds : (rows, cols) float32 array
    geobox : GeoBox
    overwrite : bool

    Raises
    ------
    MapError
        If there are too many cells to be read again.
    OutputExistsError, OutputError
        If the file exists, has another extension, or cannot be written.
    """
    check_geotiff_name(path, "a grid")
    check_cells(log_odds.shape, "this grid")
    write_geotiff(path, [log_odds], geobox, [LOG_ODDS], {_TAG: _CONTENT}, overwrite)


def read_grid_file(path: str | os.PathLike[str]) -> tuple[Float32s, GeoBox]:
    """Read the log-odds of a grid, and the position of its cells.

    Raises
    ------
    MapError
        If the file is of another kind, holds too many cells, or log-odds beyond -6..6.
    RasterReadError
        If it cannot be read.
    """
    name = os.fspath(path)
    found = Dataset.open(name)
    other = f"{name} is not a grid that OccupancyGrid.save saved, but another raster"
    if found.dtype != np.float32:
        raise MapError(other)
    check_cells(found.geobox.shape, name)
    values, geobox, _, tags = read_geotiff(name, shape=found.geobox.shape)
    if tags.get(_TAG) != _CONTENT or len(values) != 1:
        raise MapError(other)
    log_odds: Float32s = values[0]
    if not (np.abs(log_odds) <= MAX_LOG_ODDS).all():
        raise MapError(f"{name} is damaged: log-odds of a grid lie in -{MAX_LOG_ODDS:g}..{MAX_LOG_ODDS:g}")
    return log_odds, geobox
