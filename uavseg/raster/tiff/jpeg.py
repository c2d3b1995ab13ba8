"""JPEG blocks of a TIFF that are smaller than the block.

libtiff decodes them with a warning, and the rest of the block is what the memory held before. So the size in
the frame header of each block (SOF, ITU-T T.81, B.2.2) is compared with that of the block.
"""

from collections.abc import Sequence
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np
from rasterio.enums import Compression, PhotometricInterp
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.raster.tiff.block_stream import BlockStream, checked_blocks
from uavseg.raster.tiling import Window

HEADER_BYTES = 4096  # in which the frame header usually lies
_START_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # these three are tables, or reserved
_WITHOUT_LENGTH = {0x01, *range(0xD0, 0xD9)}

_known: "WeakKeyDictionary[DatasetReader, JpegBlocks | None]" = WeakKeyDictionary()  # by open file


def check_jpeg_blocks(path: str, source: DatasetReader, bands: Sequence[int], window: Window) -> None:
    """Check the blocks of an open TIFF that intersect a window; each only once.

    Parameters
    ----------
    path : str
    source : DatasetReader
        Nothing is checked if it is compressed in another manner, lies in an archive or is remote, or if its
        chrominance lies in planes of its own, which may be smaller.
    bands : sequence of int
    window : Window

    Raises
    ------
    RasterBlockError
        If one of them holds an image that is smaller than the block.
    """
    if source not in _known:
        _known[source] = JpegBlocks(path, source) if _is_checked(path, source) else None
    blocks = _known[source]
    if blocks is not None:
        blocks.check(source, bands, window)


def _is_checked(path: str, source: DatasetReader) -> bool:
    if source.compression != Compression.jpeg or source.driver != "GTiff" or not Path(path).is_file():
        return False
    planar = source.count > 1 and source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") != "PIXEL"
    return not (planar and source.photometric == PhotometricInterp.ycbcr)


class JpegBlocks:
    """The blocks of an open TIFF that is compressed by JPEG."""

    def __init__(self, path: str, source: DatasetReader) -> None:
        self._path = path
        self._all_bands = source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") == "PIXEL" and source.count > 1
        rows, cols = self._shape = source.block_shapes[0]
        planes = 1 if self._all_bands else source.count
        self._checked = checked_blocks(path, (planes, -(-source.height // rows), -(-source.width // cols)))

    def check(self, source: DatasetReader, bands: Sequence[int], window: Window) -> None:
        """As `check_jpeg_blocks`."""
        rows, cols = self._shape
        i, j = window.row // rows, window.col // cols
        last = -(-(window.row + window.rows) // rows), -(-(window.col + window.cols) // cols)
        planes = [0] if self._all_bands else [band - 1 for band in bands]
        left = np.argwhere(~self._checked[planes, i : last[0], j : last[1]])
        for plane, row, col in (left + np.array([0, i, j])).tolist():
            stored = BlockStream.of(self._path, source, planes[plane] + 1, (row, col))
            expected = min(rows, source.height - row * rows) if cols == source.width else rows, cols
            found = (
                expected if stored is None else _size(stored.read(0, HEADER_BYTES)) or _size(stored.read())
            )
            if found is not None and (found[0] < expected[0] or found[1] < expected[1]):
                raise RasterBlockError(
                    f"the image in the block at {row}, {col} has {found[1]} x {found[0]} pixels, and the "
                    f"block {expected[1]} x {expected[0]}"
                )
            self._checked[planes[plane], row, col] = True


def _size(stream: bytes) -> tuple[int, int] | None:
    """Rows and columns in the frame header of a JPEG; None where there is none, which no decoder accepts."""
    at = 2
    while at + 9 <= len(stream):
        if stream[at] != 0xFF:
            at += 1
            continue
        marker = stream[at + 1]
        if marker in _START_OF_FRAME:
            return int.from_bytes(stream[at + 5 : at + 7], "big"), int.from_bytes(
                stream[at + 7 : at + 9], "big"
            )
        has_length = marker not in _WITHOUT_LENGTH and marker != 0xFF
        at += 2 + int.from_bytes(stream[at + 2 : at + 4], "big") if has_length else 1 + (marker != 0xFF)
    return None
