"""Text grids are read row by row from the first: GDAL looks for a later row by reading all before it.

Where one of those cannot be read, it tries them all again for each row after it, and again for those: 2^n
times for n rows. So rows are read in order here, and after the first that fails none is asked for.
"""

from weakref import WeakKeyDictionary

from rasterio.io import DatasetReader

from uavseg.raster.grid.tiling import Window

_DRIVERS = frozenset({"AAIGrid", "GRASSASCIIGrid"})
_read: "WeakKeyDictionary[DatasetReader, int]" = WeakKeyDictionary()  # rows so far, by open file


def is_sequential(driver: str) -> bool:
    """Whether a row can be read only if all rows before it can."""
    return driver in _DRIVERS


def read_rows_before(source: DatasetReader, window: Window) -> None:
    """Read the rows above the end of a window that were not read yet, one after the other.

    Raises
    ------
    rasterio.errors.RasterioError
        If one of them cannot be read.
    """
    for row in range(_read.get(source, 0), window.row + window.rows):
        source.read(1, window=((row, row + 1), (0, source.width)))
        _read[source] = row + 1
