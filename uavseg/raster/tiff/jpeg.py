"""JPEG blocks of a TIFF whose pixels would be those of the block before.

libtiff decodes blocks that are smaller than they should be with a warning, and the rest is what the memory
held before; and where tables of a block are missing it decodes with those of the block before. So the size in
the frame header of each block (SOF, ITU-T T.81, B.2.2) is compared with that of the block, and the tables
that its header names have to be in the block or in those of the file.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from weakref import WeakKeyDictionary

from rasterio.enums import Compression, PhotometricInterp
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import Window
from uavseg.raster.tiff.directories import BlockStream, CheckedBlocks, file_of

HEADER_BYTES = 4096  # in which the frame header usually lies
_START_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # these three are tables, or reserved
_SEQUENTIAL = {0xC0, 0xC1}
_HUFFMAN, _START_OF_SCAN, _QUANTISATION = 0xC4, 0xDA, 0xDB
_WITHOUT_LENGTH = {0x01, *range(0xD0, 0xD9)}

_known: "WeakKeyDictionary[DatasetReader, JpegBlocks | None]" = WeakKeyDictionary()  # by open file


def check_jpeg_blocks(path: str, source: DatasetReader, bands: Sequence[int], window: Window) -> None:
    """Check the blocks of an open TIFF that intersect a window; each only once.

    `path` is that by which it was opened: of the file, or of one of its images (`GTIFF_DIR:2:a.tif`). Nothing
    is checked of a source that is compressed in another manner, lies in an archive or is remote, or whose
    chrominance lies in planes of its own, which may be smaller. A RasterBlockError says that a block holds an
    image that is smaller than it, or lacks a table.
    """
    if source not in _known:
        _known[source] = _jpeg_blocks(path, source)
    blocks = _known[source]
    if blocks is not None:
        blocks.check(source, bands, window)


def _jpeg_blocks(name: str, source: DatasetReader) -> "JpegBlocks | None":
    if source.compression != Compression.jpeg or source.driver != "GTiff":
        return None
    planar = source.count > 1 and source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") != "PIXEL"
    path = None if planar and source.photometric == PhotometricInterp.ycbcr else file_of(name)
    return None if path is None else JpegBlocks(name, path, source)


class JpegBlocks(CheckedBlocks):
    """The blocks of an open TIFF that is compressed by JPEG."""

    def __init__(self, name: str, path: Path, source: DatasetReader) -> None:
        super().__init__(name, path, source)
        tables = source.get_tag_item("JPEGTABLES", "TIFF", bidx=1) or ""
        self._tables = _parse(bytes.fromhex(tables)).defined

    def check(self, source: DatasetReader, bands: Sequence[int], window: Window) -> None:
        """Check as `check_jpeg_blocks`."""
        rows, cols = self._shape
        for k, row, col in self._left(bands, window):
            stored = BlockStream.of(self._path, source, 1 if self._all_bands else bands[k], (row, col))
            expected = min(rows, source.height - row * rows) if cols == source.width else rows, cols
            if stored is not None:
                self._check_header(stored, expected, (row, col))

    def _check_header(self, stored: BlockStream, expected: tuple[int, int], place: tuple[int, int]) -> None:
        header = _parse(stored.read(0, HEADER_BYTES))
        if not header.ends and not header.damaged:
            header = _parse(stored.read())
        row, col = place
        if header.size is not None and (header.size[0] < expected[0] or header.size[1] < expected[1]):
            raise RasterBlockError(
                f"the image in the block at {row}, {col} has {header.size[1]} x {header.size[0]} pixels, and "
                f"the block {expected[1]} x {expected[0]}"
            )
        if header.damaged or (header.ends and not header.named <= header.defined | self._tables):
            raise RasterBlockError(f"the JPEG header of the block at {row}, {col} is damaged")


@dataclass(frozen=True, slots=True)
class _Header:
    """What the segments before the pixels of a JPEG say.

    A table is "Q" and the number of one of quantisation, or "H" and class and number of one of Huffman codes.
    """

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
        elif marker == _QUANTISATION:
            defined |= {("Q", number) for number in _numbers(segment, _quantisation_bytes)}
        elif marker == _HUFFMAN:
            defined |= {("H", number) for number in _numbers(segment, _huffman_bytes)}
        elif marker == _START_OF_SCAN:
            codes = segment[2 : 1 + 2 * segment[0] : 2] if segment else b""
            if sequential:  # the scans of other kinds need one of the two each
                named |= {("H", code >> 4) for code in codes} | {("H", 0x10 | code & 15) for code in codes}
            ends = True
        at += 2 + length
    return _Header(size, frozenset(defined), frozenset(named), ends, damaged)


def _numbers(segment: bytes, length: Callable[[bytes], int]) -> Iterator[int]:
    """Yield numbers of the tables in a segment, each with what follows it."""
    at = 0
    while at < len(segment):
        number = segment[at]
        yield number & 15 if length is _quantisation_bytes else number
        at += length(segment[at:])


def _quantisation_bytes(table: bytes) -> int:
    return 1 + 64 * (2 if table[0] >> 4 else 1)


def _huffman_bytes(table: bytes) -> int:
    return 17 + sum(table[1:17])
