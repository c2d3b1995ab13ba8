"""Limits of what the header of a raster may claim, before anything is allocated for it.

A block is decoded whole, so a header with a damaged block size asks for gigabytes. What a block can hold is
bounded by the size of the file: no compression in use makes more than about 1000 bytes of one.
"""

from pathlib import Path

import numpy as np
from rasterio.io import DatasetReader

from uavseg.errors import RasterError
from uavseg.raster.tiff.index import stored_blocks

MAX_BANDS = 4096  # satellite images with most bands have a few hundred
MAX_RATIO = 2000  # bytes of pixels for each byte of a compressed file
FREE_BYTES = 64 << 20  # blocks up to this size are decoded whatever the size of the file
MAX_WHOLE_PIXELS = 1 << 28  # of an image that is read whole


def check_limits(path: str, source: DatasetReader) -> None:
    """Check the number of bands, and that blocks are not larger than the file can hold.

    Raises
    ------
    RasterError
        If the header is beyond the limits.
    """
    if source.count > MAX_BANDS:
        raise RasterError(
            f"{path} has {source.count:,} bands, and at most {MAX_BANDS:,} are read; is its header damaged?"
        )
    if source.count == 0 or source.driver == "VRT":  # the blocks of a VRT are those of its sources
        return
    rows, cols = source.block_shapes[0]
    size = rows * cols * np.dtype(source.dtypes[0]).itemsize
    if size * source.count <= FREE_BYTES:
        return
    if source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") == "PIXEL":
        size *= source.count
    if size > max(FREE_BYTES, _capacity(path, source)) and _stores_a_block(path, source):
        raise RasterError(
            f"{path} has blocks of {cols:,} x {rows:,} pixels in {source.count:,} bands, {size / 1e9:.1f} GB "
            "each, which the file is too small to hold; its header is damaged"
        )


def check_readable_whole(path: str, source: DatasetReader) -> None:
    """Check that an image may be read whole.

    Raises
    ------
    RasterError
        If it is too large for that, or larger than its file can hold.
    """
    rows, cols = source.shape
    if rows * cols > MAX_WHOLE_PIXELS:
        raise RasterError(
            f"{path} has {cols:,} x {rows:,} pixels, and at most {MAX_WHOLE_PIXELS:,} are read at once"
        )
    if rows * cols * source.count > max(FREE_BYTES, _capacity(path, source)):
        raise RasterError(f"{path} claims {cols:,} x {rows:,} pixels, which the file is too small to hold")


def _stores_a_block(path: str, source: DatasetReader) -> bool:
    """Whether a sparse file stores a block at all; true where that is not known."""
    if source.driver != "GTiff":
        return True
    stored = stored_blocks(path, source)
    return stored is None or bool(stored.any())


def _capacity(path: str, source: DatasetReader) -> int:
    """How many bytes of pixels a file can hold; without bound where its size is not known."""
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        return 1 << 62
    plain = source.driver == "GTiff" and source.compression is None
    return size if plain else size * MAX_RATIO
