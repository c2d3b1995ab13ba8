"""Index of a TIFF: which of its blocks are stored (the others have one value), and which lie beyond its end.

GDAL tells that one block at a time, which takes too long for all of them.

Format: https://www.awaresystems.be/imaging/tiff/tifftags.html, and BigTIFF. The index is two arrays, offsets
and lengths of blocks; sparse files leave entries, or both arrays, empty.
"""

import math
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import Window, indices_within, sample_positions
from uavseg.raster.spectral.bands import Values
from uavseg.raster.tiff.directories import TiffReader, is_by_pixel, once_for_each_file

Stored = NDArray[np.bool_]


@once_for_each_file
def stored_blocks(path: str, source: DatasetReader) -> Stored | None:
    """Return which blocks of an open local TIFF are stored.

    They are (planes, rows, cols) of blocks: one plane for all bands, or one for each if bands are stored one
    after the other. None if the index is incomplete or cannot be read.
    """
    place = source.get_tag_item("IFD_OFFSET", "TIFF", bidx=1)
    if place is None:
        return None
    (height, width), (rows, cols) = source.shape, source.block_shapes[0]
    shape = 1 if is_by_pixel(source) else source.count, -(-height // rows), -(-width // cols)
    try:
        with Path(path).open("rb") as file:
            reader = TiffReader(file)
            arrays = [reader.array(one) for one in reader.directory(int(place)).arrays.values()]
    except (OSError, ValueError, struct.error):
        return None
    if any(len(values) != math.prod(shape) for values in arrays):
        return None
    stored = np.zeros(shape, bool)
    for values in arrays:
        stored |= values.reshape(shape) != 0
    return stored


def are_cut_off(
    path: str, source: DatasetReader, bands: Sequence[int], blocks: Sequence[tuple[int, int]]
) -> list[bool]:
    """Return whether blocks (row, column) of an open TIFF begin beyond its end, in one of some bands.

    An interrupted download leaves such a file. All are false for a file in an archive or of a server.
    """
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        return [False] * len(blocks)
    names = (f"BLOCK_OFFSET_{col}_{row}" for row, col in blocks)
    return [
        any(int(source.get_tag_item(name, "TIFF", bidx=band) or 0) >= size for band in bands)
        for name in names
    ]


@dataclass(frozen=True, slots=True)
class SparseBlocks:
    """The blocks of some bands, of one type, of an open TIFF."""

    source: DatasetReader
    path: str
    bands: Sequence[int]

    def is_empty(self, window: Window) -> bool:
        """Return whether no block that intersects a window is stored; false where that is not known."""
        if self._stores_first(window):
            return False
        stored = self._stored(window)
        return stored is not None and not stored.any()

    def read(self, window: Window, shape: tuple[int, int]) -> Values | None:
        """Read a window, downsampled to `shape` by nearest neighbour; None if GDAL reads it as fast.

        That is where all blocks are stored, or some of them are and every pixel is asked for. The result is
        (bands, *shape).
        """
        whole = shape == (window.rows, window.cols)
        if whole and self._stores_first(window):
            return None
        stored = self._stored(window)
        fill = self._fill_values()
        if stored is None or fill is None or stored.all():
            return None
        values = np.empty((len(fill), *shape), fill.dtype)
        values[:] = fill[:, None, None]
        if not stored.any():
            return values
        if whole or self.source.overviews(self.bands[0]):
            return None
        self._sample(stored, window, values)
        return values

    def _stores_first(self, window: Window) -> bool:
        """Return whether the first block of a window is stored; the index need not be read then."""
        rows, cols = self.source.block_shapes[0]
        try:
            return bool(self.source.block_size(self.bands[0], window.row // rows, window.col // cols))
        except RasterBlockError:
            return False

    def _sample(self, stored: Stored, window: Window, values: Values) -> None:
        """Put the nearest pixels of stored blocks in their places."""
        rows = sample_positions(window.row, window.rows, values.shape[1])
        cols = sample_positions(window.col, window.cols, values.shape[2])
        height, width = self.source.block_shapes[0]
        first = np.array([window.row // height, window.col // width])
        for i, j in (first + np.argwhere(stored)).tolist():
            block = Window(i * height, j * width, height, width).clipped(self.source.shape)
            here = indices_within(rows, block.row, block.rows), indices_within(cols, block.col, block.cols)
            if here[0].start == here[0].stop or here[1].start == here[1].stop:
                continue
            place = (block.row, block.row + block.rows), (block.col, block.col + block.cols)
            pixels = self.source.read(list(self.bands), window=place)
            sampled = np.ix_(rows[here[0]] - block.row, cols[here[1]] - block.col)
            values[:, here[0], here[1]] = pixels[:, sampled[0], sampled[1]]

    def _fill_values(self) -> Values | None:
        """Return the value of missing blocks by band, nodata or 0; None if the type cannot hold it."""
        dtype = np.dtype(self.source.dtypes[self.bands[0] - 1])
        fill = [self.source.nodatavals[band - 1] or 0.0 for band in self.bands]
        if dtype.kind in "iu":
            limits = np.iinfo(dtype)
            if not all(limits.min <= value <= limits.max and value == int(value) for value in fill):
                return None
        return np.array(fill).astype(dtype) if dtype.kind in "iuf" else None

    def _stored(self, window: Window) -> Stored | None:
        """Return which blocks that intersect a window are stored, of any of the bands, (rows, cols)."""
        known = stored_blocks(self.path, self.source)
        if known is None:
            return None
        part = known[:, *window.blocks(*self.source.block_shapes[0])]
        planes = [0] if len(part) == 1 else [band - 1 for band in self.bands]
        return np.asarray(part[planes].any(axis=0))
