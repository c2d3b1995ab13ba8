"""Deflate blocks of a TIFF whose stream goes on beyond the block.

libtiff decodes whole blocks with libdeflate, which stops where the next piece does not fit; libtiff takes
that for success, and the rest of the block is what the memory held before. So the pixels are compared with
the checksum at the end of the stream (Adler-32, RFC 1950), which takes 2 % of the time of `extract`.
GDAL can decode with zlib in place of libdeflate; that takes 10 %, and the option changes the bytes of files
that are written. It does where a raster of more than 2000 rows is one strip, of which it reads line by line.
"""

import zlib
from collections.abc import Sequence
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
from rasterio.enums import Compression
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.raster.grid.tiling import Window
from uavseg.raster.spectral.bands import Values
from uavseg.raster.tiff.directories import BlockStream, CheckedBlocks, file_of, strip_rows

_known: "WeakKeyDictionary[DatasetReader, DeflateBlocks | None]" = WeakKeyDictionary()  # by open file


def check_deflate_blocks(
    path: str, source: DatasetReader, bands: Sequence[int], window: Window, values: Values | None = None
) -> None:
    """Check the blocks of an open TIFF that intersect a window which was just read; each only once.

    `path` is that by which it was opened: of the file, or of one of its images (`GTIFF_DIR:2:a.tif`). Nothing
    is checked of a source that is compressed in another manner, lies in an archive or is remote. `values`
    (bands, rows, cols) are what was read; without them blocks are read again. A RasterBlockError says that
    the stream of one of them does not end where the block ends.
    """
    if source not in _known:
        _known[source] = _deflate_blocks(path, source)
    blocks = _known[source]
    if blocks is not None:
        blocks.check(source, tuple(bands), window, values)


def _deflate_blocks(name: str, source: DatasetReader) -> "DeflateBlocks | None":
    path = file_of(name) if source.compression == Compression.deflate else None
    if path is None:
        return None
    rows = strip_rows(path, source)
    if rows not in (None, source.block_shapes[0][0]):
        return None  # read line by line
    return DeflateBlocks(name, path, source, is_tiled=rows is None)


class DeflateBlocks(CheckedBlocks):
    """The blocks of an open TIFF that is compressed by deflate."""

    def __init__(self, name: str, path: Path, source: DatasetReader, is_tiled: bool) -> None:
        super().__init__(name, path, source)
        self._predictor = source.tags(ns="IMAGE_STRUCTURE").get("PREDICTOR", "1")
        self._bits = source.tags(1, ns="IMAGE_STRUCTURE").get("NBITS")
        self._is_tiled = is_tiled

    def check(
        self, source: DatasetReader, bands: tuple[int, ...], window: Window, values: Values | None
    ) -> None:
        """Check as `check_deflate_blocks`."""
        rows, cols = self._shape
        for k, row, col in self._left(bands, window):
            block = Window(row * rows, col * cols, rows, cols).clipped(source.shape)
            every = tuple(source.indexes) if self._all_bands else (bands[k],)
            own = None if values is None else values[k : k + len(every)]
            if self._all_bands and bands != every:
                own = None  # without the other bands of the block
            if not self._is_right(source, every, (row, col), block, _part(own, window, block)):
                raise RasterBlockError(f"the stream of the block at {row}, {col} goes on beyond its end")

    def _is_right(
        self,
        source: DatasetReader,
        bands: tuple[int, ...],
        place: tuple[int, int],
        block: Window,
        own: Values | None,
    ) -> bool:
        stored = BlockStream.of(self._path, source, bands[0], place)
        if stored is None:
            return True  # a block that is not stored
        whole = not self._is_tiled or (block.rows, block.cols) == self._shape
        if whole and self._predictor in ("1", "2") and self._bits is None:
            if own is None:
                at = (block.row, block.row + block.rows), (block.col, block.col + block.cols)
                own = source.read(list(bands), window=at)
            if zlib.adler32(self._decoded(own)) == int.from_bytes(stored.read(-4), "big"):
                return True
        rows = self._shape[0] if self._is_tiled else block.rows
        bits = int(self._bits or 8 * np.dtype(source.dtypes[bands[0] - 1]).itemsize)
        return _ends_at(stored.read(), rows * -(-self._shape[1] * len(bands) * bits // 8))

    def _decoded(self, values: Values) -> bytes:
        """Return what was compressed: rows of pixels, by their differences if there is a predictor."""
        pixels = np.moveaxis(values, 0, -1)
        if self._predictor == "2":
            before, pixels = pixels, pixels.copy()
            pixels[:, 1:] -= before[:, :-1]
        return np.ascontiguousarray(pixels).tobytes()


def _part(values: Values | None, window: Window, block: Window) -> Values | None:
    """Return the pixels of a block, if the window holds it whole."""
    row, col = block.row - window.row, block.col - window.col
    inside = row >= 0 and col >= 0 and row + block.rows <= window.rows and col + block.cols <= window.cols
    if values is None or not inside:
        return None
    return values[:, row : row + block.rows, col : col + block.cols]


def _ends_at(stream: bytes, size: int) -> bool:
    """Return whether a stream gives exactly so many bytes."""
    decoder = zlib.decompressobj()
    try:
        found = len(decoder.decompress(stream, size + 1))
    except zlib.error:
        return False
    return found == size and decoder.eof
