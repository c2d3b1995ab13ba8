"""Damaged blocks of a TIFF that libtiff decodes without an error: deflate and JPEG.

libtiff decodes whole blocks with libdeflate, which stops where the next piece does not fit; libtiff takes
that for success, and the rest of the block is what the memory held before. So the pixels are compared with
the checksum at the end of the stream (Adler-32, RFC 1950), which takes 2 % of the time of `extract`.
GDAL can decode with zlib in place of libdeflate; that takes 10 %, and the option changes the bytes of files
that are written. It does where a raster of more than 2000 rows is one strip, of which it reads line by line.

JPEG blocks that are smaller than they should be are decoded with a warning, and the rest is what the memory
held before; and where tables of a block are missing it is decoded with those of the block before. So the size
in the frame header of each block (SOF, ITU-T T.81, B.2.2) is compared with that of the block, and the tables
that its header names have to be in the block or in those of the file.
"""

import zlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from rasterio.enums import Compression, PhotometricInterp
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.arrays import Bools
from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import Window
from uavseg.raster.spectral.bands import Values
from uavseg.raster.tiff.directories import file_of, is_by_pixel, once_for_each_file, strip_rows

Bands = tuple[int, ...]
HEADER_BYTES = 4096  # in which the frame header usually lies
_START_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # these three are tables, or reserved
_SEQUENTIAL = {0xC0, 0xC1}
_HUFFMAN, _START_OF_SCAN, _QUANTISATION = 0xC4, 0xDA, 0xDB
_WITHOUT_LENGTH = {0x01, *range(0xD0, 0xD9)}


def check_blocks(
    path: str, source: DatasetReader, bands: Sequence[int], window: Window, values: Values | None = None
) -> None:
    """Check the blocks of an open TIFF that intersect a window; each only once.

    `path` is that by which it was opened: of the file, or of one of its images (`GTIFF_DIR:2:a.tif`). Nothing
    is checked of a source that is compressed in another manner, lies in an archive or is remote, or whose
    chrominance lies in planes of its own, which may be smaller. `values` (bands, rows, cols) are what was
    just read; without them blocks are read again. A RasterBlockError says that the stream of one of them does
    not end where the block ends, or that the image in it is smaller than it, or lacks a table.
    """
    blocks = _blocks_of(path, source)
    if blocks is not None:
        blocks.check(source, tuple(bands), window, values)


@once_for_each_file
def _blocks_of(name: str, source: DatasetReader) -> "_DeflateBlocks | _JpegBlocks | None":
    path = file_of(name) if source.driver == "GTiff" else None
    if path is not None and source.compression == Compression.deflate:
        rows = strip_rows(path, source)
        if rows in (None, source.block_shapes[0][0]):  # else it is read line by line
            return _DeflateBlocks(name, path, source, is_tiled=rows is None)
    if path is not None and source.compression == Compression.jpeg:
        planar = source.count > 1 and not is_by_pixel(source)
        if not (planar and source.photometric == PhotometricInterp.ycbcr):
            return _JpegBlocks(name, path, source)
    return None


@dataclass(frozen=True, slots=True)
class BlockStream:
    """Where the stream of a block lies."""

    path: Path
    offset: int  # in bytes
    size: int

    @classmethod
    def of(cls, path: Path, source: DatasetReader, band: int, place: tuple[int, int]) -> "BlockStream | None":
        """Return that of the block in a row and a column of blocks; None if it is not stored."""
        offset = source.get_tag_item(f"BLOCK_OFFSET_{place[1]}_{place[0]}", "TIFF", bidx=band)
        return None if offset is None else cls(path, int(offset), source.block_size(band, *place))

    def read(self, start: int = 0, most: int | None = None) -> bytes:
        """Read its bytes from `start` on, which counts from the end if it is below 0; `most` of them."""
        start = start if start >= 0 else max(self.size + start, 0)
        left = self.size - start
        with self.path.open("rb") as file:
            file.seek(self.offset + start)
            return file.read(left if most is None else min(left, most))


class _Blocks:
    """The blocks of an image, which all threads check once: `name` is that of the image, `path` its file."""

    def __init__(self, name: str, path: Path, source: DatasetReader) -> None:
        self._path = path
        rows, cols = self._shape = source.block_shapes[0]
        self._all_bands = is_by_pixel(source) and source.count > 1
        planes, about = 1 if self._all_bands else source.count, path.stat()
        size = planes, -(-source.height // rows), -(-source.width // cols)
        self._checked = _checked(name, about.st_size, about.st_mtime_ns, size)

    def _left(
        self, source: DatasetReader, bands: Bands, window: Window
    ) -> Iterator[tuple[BlockStream, Bands, int, Window]]:
        """Yield blocks to check: stream, bands, index of the first, window; one is right if this goes on."""
        (rows, cols), here = self._shape, window.blocks(*self._shape)
        planes = [0] if self._all_bands else [band - 1 for band in bands]
        left = np.argwhere(~self._checked[planes, *here])
        for k, row, col in (left + np.array([0, here[0].start, here[1].start])).tolist():
            every = tuple(source.indexes) if self._all_bands else (bands[k],)
            stored = BlockStream.of(self._path, source, every[0], (row, col))
            if stored is not None:
                yield stored, every, k, Window(row * rows, col * cols, rows, cols).clipped(source.shape)
            self._checked[planes[k], row, col] = True

    def _name(self, block: Window) -> str:
        return f"the block at {block.row // self._shape[0]}, {block.col // self._shape[1]}"


@lru_cache(maxsize=64)
def _checked(name: str, size: int, mtime_ns: int, shape: tuple[int, int, int]) -> Bools:
    return np.zeros(shape, bool)


class _DeflateBlocks(_Blocks):
    """The blocks of an open TIFF that is compressed by deflate."""

    def __init__(self, name: str, path: Path, source: DatasetReader, is_tiled: bool) -> None:
        super().__init__(name, path, source)
        self._predictor = source.tags(ns="IMAGE_STRUCTURE").get("PREDICTOR", "1")
        self._bits = source.tags(1, ns="IMAGE_STRUCTURE").get("NBITS")
        self._is_tiled = is_tiled

    def check(self, source: DatasetReader, bands: Bands, window: Window, values: Values | None) -> None:
        """Check the checksum of each block, or where its stream ends."""
        for stored, every, k, block in self._left(source, bands, window):
            own = values
            if own is not None:
                is_whole = block.common(window) == block and (bands == every or not self._all_bands)
                own = own[k : k + len(every), *block.relative_to(window).slices] if is_whole else None
            if not self._is_right(source, stored, every, block, own):
                raise RasterBlockError(f"the stream of {self._name(block)} goes on beyond its end")

    def _is_right(
        self, source: DatasetReader, stored: BlockStream, bands: Bands, block: Window, own: Values | None
    ) -> bool:
        whole = not self._is_tiled or (block.rows, block.cols) == self._shape
        if whole and self._predictor in ("1", "2") and self._bits is None:
            if own is None:
                at = (block.row, block.row + block.rows), (block.col, block.col + block.cols)
                own = source.read(list(bands), window=at)
            if zlib.adler32(self._decoded(own)) == int.from_bytes(stored.read(-4), "big"):
                return True
        rows = self._shape[0] if self._is_tiled else block.rows
        bits = int(self._bits or 8 * np.dtype(source.dtypes[bands[0] - 1]).itemsize)
        size, decoder = rows * -(-self._shape[1] * len(bands) * bits // 8), zlib.decompressobj()
        try:
            return len(decoder.decompress(stored.read(), size + 1)) == size and decoder.eof
        except zlib.error:
            return False

    def _decoded(self, values: Values) -> bytes:
        """Return what was compressed: rows of pixels, by their differences if there is a predictor."""
        pixels = np.moveaxis(values, 0, -1)
        if self._predictor == "2":
            before, pixels = pixels, pixels.copy()
            pixels[:, 1:] -= before[:, :-1]
        return np.ascontiguousarray(pixels).tobytes()


class _JpegBlocks(_Blocks):
    """The blocks of an open TIFF that is compressed by JPEG."""

    def __init__(self, name: str, path: Path, source: DatasetReader) -> None:
        super().__init__(name, path, source)
        tables = source.get_tag_item("JPEGTABLES", "TIFF", bidx=1) or ""
        self._tables = _parse(bytes.fromhex(tables)).defined

    def check(self, source: DatasetReader, bands: Bands, window: Window, values: Values | None) -> None:
        """Check the size in the header of each block, and its tables."""
        rows, cols = self._shape
        for stored, _, _, block in self._left(source, bands, window):
            header = _parse(stored.read(0, HEADER_BYTES))
            if not header.ends and not header.damaged:
                header = _parse(stored.read())
            least = (block.rows if cols == source.width else rows), cols
            if header.size is not None and (header.size[0] < least[0] or header.size[1] < least[1]):
                raise RasterBlockError(
                    f"the image in {self._name(block)} has {header.size[1]} x {header.size[0]} pixels, and "
                    f"the block {least[1]} x {least[0]}"
                )
            if header.damaged or (header.ends and not header.named <= header.defined | self._tables):
                raise RasterBlockError(f"the JPEG header of {self._name(block)} is damaged")


@dataclass(frozen=True, slots=True)
class _Header:
    """What a JPEG says before its pixels; tables are "Q" of quantisation or "H" of Huffman, and a number."""

    size: tuple[int, int] | None  # rows and columns; None without a frame header
    defined: frozenset[tuple[str, int]]  # tables that it holds
    named: frozenset[tuple[str, int]]  # tables that it needs
    ends: bool  # the pixels begin
    damaged: bool  # something else stands where a segment should begin


def _parse(stream: bytes) -> _Header:
    """Return the segments of a JPEG before its pixels, or tables alone."""
    size: tuple[int, int] | None = None
    defined: set[tuple[str, int]] = set()
    named: set[tuple[str, int]] = set()
    at, ends, damaged, sequential = 2, False, False, True
    while at + 4 <= len(stream) and not ends:
        marker = stream[at + 1]
        if stream[at] != 0xFF:
            damaged = True
            break
        if marker == 0xFF or marker in _WITHOUT_LENGTH:
            at += 1 if marker == 0xFF else 2
            continue
        length = int.from_bytes(stream[at + 2 : at + 4], "big")
        segment = stream[at + 4 : at + 2 + length]
        if marker in _START_OF_FRAME and len(segment) >= 6:
            size = int.from_bytes(segment[1:3], "big"), int.from_bytes(segment[3:5], "big")
            named |= {("Q", number) for number in segment[8::3]}
            sequential = marker in _SEQUENTIAL
        elif marker in (_QUANTISATION, _HUFFMAN):
            defined |= set(_tables_in(segment, marker == _HUFFMAN))
        elif marker == _START_OF_SCAN:
            codes = segment[2 : 1 + 2 * segment[0] : 2] if segment else b""
            if sequential:  # the scans of other kinds need one of the two each
                named |= {("H", code >> 4) for code in codes} | {("H", 0x10 | code & 15) for code in codes}
            ends = True
        at += 2 + length
    return _Header(size, frozenset(defined), frozenset(named), ends, damaged)


def _tables_in(segment: bytes, is_huffman: bool) -> Iterator[tuple[str, int]]:
    """Yield the tables in a segment, as of `_Header`: of Huffman codes, or of quantisation."""
    at = 0
    while at < len(segment):
        head = segment[at]
        yield ("H", head) if is_huffman else ("Q", head & 15)
        at += 17 + sum(segment[at + 1 : at + 17]) if is_huffman else 1 + 64 * (2 if head >> 4 else 1)
