"""Mask of a TIFF, in the file or beside it (`.msk`): its blocks are checked as those of the pixels are.

GDAL reads it as a part of the raster, and does not say where its blocks lie; so it is opened by itself too.
"""

from collections.abc import Sequence
from weakref import WeakKeyDictionary

from rasterio.io import DatasetReader

from uavseg.raster.access.opening import file_exists, quiet_open
from uavseg.raster.grid.tiling import Window
from uavseg.raster.tiff.block_stream import file_of
from uavseg.raster.tiff.deflate import check_deflate_blocks
from uavseg.raster.tiff.directories import mask_page
from uavseg.raster.tiff.jpeg import check_jpeg_blocks

_opened: "WeakKeyDictionary[DatasetReader, tuple[str, DatasetReader] | None]" = WeakKeyDictionary()


def check_mask_blocks(path: str, source: DatasetReader, bands: Sequence[int], window: Window) -> None:
    """Check the blocks of the mask of an open TIFF that intersect a window; each only once.

    Parameters
    ----------
    path : str
    source : DatasetReader
        Nothing is checked if it lies in an archive or is remote.
    bands : sequence of int
        Whose masks are checked, where each band has its own.
    window : Window

    Raises
    ------
    RasterBlockError
        As `check_deflate_blocks` and `check_jpeg_blocks`.
    """
    if source not in _opened:
        _opened[source] = _open_mask(path, source)
    found = _opened[source]
    if found is not None:
        name, mask = found
        bands = bands if mask.count >= max(bands) else (1,)
        check_deflate_blocks(name, mask, bands, window)
        check_jpeg_blocks(name, mask, bands, window)


def _open_mask(path: str, source: DatasetReader) -> tuple[str, DatasetReader] | None:
    """The mask as a raster, and its name; None if there is none that can be opened by itself."""
    if file_of(path) is None:
        return None
    page = None if path.upper().startswith("GTIFF_DIR:") else mask_page(path)
    name = f"{path}.msk" if page is None else f"GTIFF_DIR:{page}:{path}"
    if page is None and not file_exists(name):
        return None
    mask = quiet_open(name, driver="GTiff")
    return (name, mask) if mask.shape == source.shape else None
