"""Directories and blocks of a TIFF: GDAL reads as many as it can, and leaves out a mask that it cannot reach.

A first image whose blocks have no places is refused too: of the first block that it is asked for, GDAL reads
the start of the file in its stead, and the others fail. So is one in strips whose index has more entries than
it has strips: libtiff ends the process where it looks for one of the others. So is one whose index has fewer
entries than it has blocks, because its size was damaged: GDAL takes the others for empty ones, or fails at
each. And so is a file in which an image is compressed as a fax is: libtiff reads damage there with a warning,
and leaves in the pixels what the memory held before.

Format: https://www.awaresystems.be/imaging/tiff/faq.html, and BigTIFF. Each directory names the place of the
next one, the last one 0.
"""

import os
import re
import struct
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.dataclass import dataclass
from uavseg.errors import RasterReadError
from uavseg.inputs import regular_file
from uavseg.plain_text import cause_of
from uavseg.raster.grid.tiling import Window

_PAGE = re.compile(r"GTIFF_DIR:(?:off:)?\d+:(.+)", re.IGNORECASE | re.DOTALL)


def file_of(name: str) -> Path | None:
    """Return the local file of a TIFF, or one of its images; None if it is in an archive or remote.

    Examples
    --------
    >>> file_of("GTIFF_DIR:2:pyproject.toml")
    PosixPath('pyproject.toml')
    """
    page = _PAGE.fullmatch(name)
    path = Path(page[1] if page else name)
    return path if path.is_file() else None


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


class CheckedBlocks:
    """The blocks of an image, which all threads check once: `name` is that of the image, `path` its file."""

    def __init__(self, name: str, path: Path, source: DatasetReader) -> None:
        self._path = path
        rows, cols = self._shape = source.block_shapes[0]
        self._all_bands = source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") == "PIXEL" and source.count > 1
        planes, about = 1 if self._all_bands else source.count, path.stat()
        size = planes, -(-source.height // rows), -(-source.width // cols)
        self._checked = _checked(name, about.st_size, about.st_mtime_ns, size)

    def _left(self, bands: Sequence[int], window: Window) -> Iterator[tuple[int, int, int]]:
        """Yield index of the band, row and column of blocks to check; each counts as right if it goes on."""
        rows, cols = self._shape
        i, j = window.row // rows, window.col // cols
        last = -(-(window.row + window.rows) // rows), -(-(window.col + window.cols) // cols)
        planes = [0] if self._all_bands else [band - 1 for band in bands]
        left = np.argwhere(~self._checked[planes, i : last[0], j : last[1]])
        for k, row, col in (left + np.array([0, i, j])).tolist():
            yield k, row, col
            self._checked[planes[k], row, col] = True


@lru_cache(maxsize=64)
def _checked(name: str, size: int, mtime_ns: int, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    return np.zeros(shape, bool)


MAX_DIRECTORIES = 65536  # as in libtiff
_KIND, _COLS, _ROWS, _COMPRESSION = 254, 256, 257, 259  # tags
_SAMPLES, _STRIP_ROWS, _PLANAR, _TILE_COLS, _TILE_ROWS = 277, 278, 284, 322, 323
_NUMBERS = (_KIND, _COLS, _ROWS, _COMPRESSION, _SAMPLES, _STRIP_ROWS, _PLANAR, _TILE_COLS, _TILE_ROWS)
_SEPARATE = 2  # bands one after the other
_PLACES, _LENGTHS = (273, 324), (279, 325)  # tags of the places and lengths of blocks: strips, tiles
_INDEX = (*_PLACES, *_LENGTHS)
_SIZES = {3: 2, 4: 4, 16: 8}  # of a number in bytes, by its type
_REDUCED, _MASK = 1, 4  # bits of the tag of the kind
_FAX = {2, 3, 4, 32771}  # compressions: CCITT, ITU-T T.4 and T.6
_FORMATS = {3: "H", 4: "I", 16: "Q"}  # of a number, by its type


class _IndexError(ValueError):
    """The index of the blocks of an image is incomplete."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """How numbers lie in a TIFF: byte order, and the formats of a count, an entry and a place."""

    order: str
    count: str
    entry: str
    place: str

    def read(self, file: BinaryIO, numbers: str) -> tuple[int, ...]:
        """Return numbers at the present place; struct.error if the file ends before."""
        return struct.unpack(self.order + numbers, file.read(struct.calcsize(self.order + numbers)))

    def seek(self, file: BinaryIO, place: int) -> None:
        """Go to a place; struct.error if it lies beyond the end of the file, and may be too large to seek."""
        if place > os.fstat(file.fileno()).st_size:
            raise struct.error
        file.seek(place)


def mask_page(path: str) -> int | None:
    """Return the number of the image that is the mask of the first, counted from 1; None without.

    A RasterReadError says that one of its directories cannot be read, or that an image is compressed as a fax
    is.
    """
    try:
        with regular_file(path).open("rb") as file:
            directories = _directories(file)
    except (OSError, struct.error, _IndexError) as error:
        if isinstance(error, RasterReadError):
            raise
        reason = "it ends before" if isinstance(error, struct.error) else cause_of(error)
        raise RasterReadError(
            f"{path} cannot be opened as a raster (one of its directories cannot be read: {reason}); the "
            "file is damaged or incomplete: repair it, or copy its first image with gdal_translate"
        ) from error
    if any(one.get(_COMPRESSION) in _FAX for one in directories):
        raise RasterReadError(
            f"{path} cannot be opened as a raster (an image or a mask in it is compressed as a fax, CCITT, "
            "where damage cannot be told from content); compress it otherwise: gdal_translate -co "
            "COMPRESS=DEFLATE"
        )
    size = [directories[0].get(tag) for tag in (_ROWS, _COLS)]
    for number, one in enumerate(directories[1:], 2):
        if one.get(_KIND, 0) & (_MASK | _REDUCED) == _MASK and [one.get(_ROWS), one.get(_COLS)] == size:
            return number
    return None


def strip_rows(path: Path, source: DatasetReader) -> int | None:
    """Return the rows of a strip of an image of a local TIFF; None if it is stored in tiles.

    `source` is the image, open. A RasterBlockError says that its directory cannot be read.
    """
    place = int(source.get_tag_item("IFD_OFFSET", "TIFF", bidx=1))
    try:
        with path.open("rb") as file:
            layout = _layout(file)
            layout.seek(file, place)
            numbers, _ = _directory(file, layout, is_first=False)
    except (OSError, struct.error, _IndexError) as error:
        raise RasterBlockError(f"its directory cannot be read: {cause_of(error)}") from error
    return None if _TILE_COLS in numbers else min(numbers.get(_STRIP_ROWS, source.height), source.height)


def _layout(file: BinaryIO) -> _Layout:
    """Return how numbers lie in an open TIFF; its next number is the place of the first directory."""
    start = file.read(4)
    order, is_big = "<" if start[:2] == b"II" else ">", b"+" in start[2:4]
    if is_big:
        file.seek(8)
    return _Layout(order, "Q", "HHQ8s", "Q") if is_big else _Layout(order, "H", "HHI4s", "I")


def _directories(file: BinaryIO) -> list[dict[int, int]]:
    """Return kind and size of each image, as numbers by tag."""
    layout = _layout(file)
    (place,) = layout.read(file, layout.place)
    found: dict[int, dict[int, int]] = {}
    while place and place not in found and len(found) < MAX_DIRECTORIES:
        layout.seek(file, place)
        found[place], place = _directory(file, layout, is_first=not found)
    if not found:
        raise struct.error
    return list(found.values())


def _directory(file: BinaryIO, layout: _Layout, is_first: bool) -> tuple[dict[int, int], int]:
    """Return numbers by tag, and the place of the next directory."""
    (count,) = layout.read(file, layout.count)
    step = struct.calcsize(layout.order + layout.entry)
    if count * step > os.fstat(file.fileno()).st_size:
        raise struct.error
    content, numbers = file.read(count * step), {}
    (following,) = layout.read(file, layout.place)
    index, counts = [], dict.fromkeys(_INDEX, 0)
    for tag, kind, items, value in struct.iter_unpack(layout.order + layout.entry, content):
        if tag in counts:
            counts[tag] = items
        if tag in _NUMBERS and items == 1 and kind in _FORMATS:
            number = layout.order + _FORMATS[kind]
            if struct.calcsize(number) <= len(value):
                (numbers[tag],) = struct.unpack_from(number, value)
        elif tag in _INDEX and items * _SIZES.get(kind, 0) > len(value):
            index.append((*struct.unpack(layout.order + layout.place, value), items * _SIZES[kind]))
    if is_first and any(counts[tag] for tag in _LENGTHS) and not any(counts[tag] for tag in _PLACES):
        # A sparse file may have neither.
        raise _IndexError("it has lengths of blocks, but not where they are")
    blocks = _count_blocks(numbers)
    if is_first and _TILE_COLS not in numbers and max(counts.values()) > blocks:
        raise _IndexError("its index has more strips than its size makes")
    for tags in (_PLACES, _LENGTHS):
        if 0 < (known := max(counts[tag] for tag in tags)) < blocks:
            raise _IndexError(f"its index has {known:,} of the {blocks:,} blocks that its size makes")
    if numbers.get(_KIND, 0) & _MASK:
        _check_index(file, layout, index)
    return numbers, following


def _count_blocks(numbers: dict[int, int]) -> int:
    """Return how many tiles or strips an image has."""
    rows, cols = numbers.get(_ROWS, 0), numbers.get(_COLS, 0)
    planes = numbers.get(_SAMPLES, 1) if numbers.get(_PLANAR) == _SEPARATE else 1
    if _TILE_COLS in numbers:
        across = -(-cols // max(numbers[_TILE_COLS], 1))
        return -(-rows // max(numbers.get(_TILE_ROWS, rows), 1)) * across * planes
    strip = min(numbers.get(_STRIP_ROWS, rows), rows)
    return -(-rows // max(strip, 1)) * planes


def _check_index(file: BinaryIO, layout: _Layout, index: list[tuple[int, int]]) -> None:
    """Check that the index of a mask can be read: GDAL takes blocks that it does not find for empty ones."""
    for place, size in index:
        layout.seek(file, place)
        while size > 0:
            piece = file.read(min(size, 1 << 20))
            if not piece:
                raise struct.error
            size -= len(piece)
