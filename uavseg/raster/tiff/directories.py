"""Directories and blocks of a TIFF: GDAL reads as many as it can, and leaves out a mask that it cannot reach.

A first image whose blocks have no places is refused too: of the first block that it is asked for, GDAL reads
the start of the file in its stead, and the others fail. So is one in strips whose index has more entries than
it has strips: libtiff ends the process where it looks for one of the others. So is one whose index has fewer
entries than it has blocks, because its size was damaged: GDAL takes the others for empty ones, or fails at
each. And so is a file in which an image is compressed as a fax is: libtiff reads damage there with a warning,
and leaves in the pixels what the memory held before.

The index of an image says which of its blocks are stored (the others have one value), and which lie beyond
the end of the file. GDAL tells that one block at a time, which takes too long for all of them.

Format: https://www.awaresystems.be/imaging/tiff/faq.html, tifftags.html, and BigTIFF. Each directory names
the place of the next one, the last one 0. The index is two arrays, offsets and lengths of blocks; sparse
files leave entries, or both arrays, empty.
"""

import math
import os
import re
import struct
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, BinaryIO, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from rasterio.errors import RasterBlockError
from rasterio.io import DatasetReader

from uavseg.arrays import Bools
from uavseg.dataclass import dataclass
from uavseg.errors import RasterReadError, caused_errors
from uavseg.inputs import regular_file
from uavseg.plain_text import cause_of
from uavseg.raster.grid.tiling import Window, indices_within, sample_positions
from uavseg.raster.spectral.bands import Values

Found = TypeVar("Found")

_PAGE = re.compile(r"GTIFF_DIR:(?:off:)?\d+:(.+)", re.IGNORECASE | re.DOTALL)
MAX_DIRECTORIES = 65536  # as in libtiff
_KIND, _COLS, _ROWS, _COMPRESSION = 254, 256, 257, 259  # tags
_SAMPLES, _STRIP_ROWS, _PLANAR, _TILE_COLS, _TILE_ROWS = 277, 278, 284, 322, 323
_NUMBERS = (_KIND, _COLS, _ROWS, _COMPRESSION, _SAMPLES, _STRIP_ROWS, _PLANAR, _TILE_COLS, _TILE_ROWS)
_SEPARATE = 2  # bands one after the other
_PLACES, _LENGTHS = (273, 324), (279, 325)  # tags of the places and lengths of blocks: strips, tiles
_TYPES = {3: "u2", 4: "u4", 16: "u8"}
_REDUCED, _MASK = 1, 4  # bits of the tag of the kind
_FAX = {2, 3, 4, 32771}  # compressions: CCITT, ITU-T T.4 and T.6


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


def once_for_each_file(find: Callable[[str, DatasetReader], Found]) -> Callable[[str, DatasetReader], Found]:
    """Decorate a function of the name and an open file, which is called once for each of these."""
    known: WeakKeyDictionary[DatasetReader, Found] = WeakKeyDictionary()

    @wraps(find)
    def kept(name: str, source: DatasetReader) -> Found:
        if source not in known:
            known[source] = find(name, source)
        return known[source]

    return kept


def is_by_pixel(source: DatasetReader) -> bool:
    """Return whether the bands of a pixel are stored beside each other."""
    return bool(source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") == "PIXEL")


class _IndexError(ValueError):
    """The index of the blocks of an image is incomplete."""


@dataclass(frozen=True, slots=True)
class _Array:
    """Where an array of a directory is: its type, its length, and its content, or the place of that."""

    kind: int
    items: int
    value: bytes


@dataclass(frozen=True, slots=True)
class Directory:
    """What a directory says of its image."""

    numbers: dict[int, int]  # by tag
    arrays: dict[int, _Array]  # places and lengths of its blocks, by tag; none that are empty
    following: int  # place of the next directory


class TiffReader:
    """Numbers and directories of an open TIFF: its byte order, and the formats of its entries."""

    def __init__(self, file: BinaryIO) -> None:
        start = file.read(4)
        self._file, self._size = file, os.fstat(file.fileno()).st_size
        self._order, self._is_big = "<" if start[:2] == b"II" else ">", b"+" in start[2:4]
        self._place = "Q" if self._is_big else "I"
        self._entry = f"{self._order}HH{self._place}{8 if self._is_big else 4}s"

    def first(self) -> int:
        """Return the place of the first directory."""
        self._seek(8 if self._is_big else 4)
        return self._read(self._place)

    def directory(self, place: int) -> Directory:
        """Read a directory; struct.error if the file ends before."""
        self._seek(place)
        size = self._read("Q" if self._is_big else "H") * struct.calcsize(self._entry)
        if size > self._size:
            raise struct.error
        content, following = self._file.read(size), self._read(self._place)
        numbers, arrays = {}, {}
        for tag, kind, items, value in struct.iter_unpack(self._entry, content):
            if tag in _NUMBERS and items == 1 and kind in _TYPES:
                if np.dtype(_TYPES[kind]).itemsize <= len(value):
                    numbers[tag] = int(self.array(_Array(kind, items, value))[0])
            elif tag in (*_PLACES, *_LENGTHS) and items > 0:
                arrays[tag] = _Array(kind, items, value)
        return Directory(numbers, arrays, following)

    def array(self, array: _Array) -> NDArray[np.unsignedinteger[Any]]:
        """Read an array of a directory; struct.error if its type is another, or the file ends before."""
        if array.kind not in _TYPES:
            raise struct.error
        dtype = np.dtype(self._order + _TYPES[array.kind])
        content, size = array.value, array.items * dtype.itemsize
        if size > len(content):
            (place,) = struct.unpack(self._order + self._place, content)
            self._seek(place + size)
            self._file.seek(place)
            content = self._file.read(size)
        return np.frombuffer(content, dtype, array.items)

    def _read(self, number: str) -> int:
        """Return the number at the present place; struct.error if the file ends before."""
        number = self._order + number
        return int(struct.unpack(number, self._file.read(struct.calcsize(number)))[0])

    def _seek(self, place: int) -> None:
        """Go to a place; struct.error if it lies beyond the end of the file, and may be too large to seek."""
        if place > self._size:
            raise struct.error
        self._file.seek(place)


def mask_page(path: str) -> int | None:
    """Return the number of the image that is the mask of the first, counted from 1; None without.

    A RasterReadError says that one of its directories cannot be read, or that an image is compressed as a fax
    is.
    """
    try:
        with regular_file(path).open("rb") as file:
            directories = _directories(TiffReader(file))
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
    caught = OSError, struct.error, _IndexError
    unread = caused_errors("its directory cannot be read", RasterBlockError, *caught, form="{}: {}")
    with unread, path.open("rb") as file:
        numbers = _checked_directory(TiffReader(file), place, is_first=False).numbers
    return None if _TILE_COLS in numbers else min(numbers.get(_STRIP_ROWS, source.height), source.height)


def _directories(reader: TiffReader) -> list[dict[int, int]]:
    """Return kind and size of each image, as numbers by tag."""
    place, found = reader.first(), dict[int, dict[int, int]]()
    while place and place not in found and len(found) < MAX_DIRECTORIES:
        one = _checked_directory(reader, place, is_first=not found)
        found[place], place = one.numbers, one.following
    if not found:
        raise struct.error
    return list(found.values())


def _checked_directory(reader: TiffReader, place: int, is_first: bool) -> Directory:
    """Read a directory, and compare the index of its blocks with their number."""
    one = reader.directory(place)
    counts = {tag: array.items for tag, array in one.arrays.items()}
    places, lengths = (max(counts.get(tag, 0) for tag in tags) for tags in (_PLACES, _LENGTHS))
    if is_first and lengths and not places:  # a sparse file may have neither
        raise _IndexError("it has lengths of blocks, but not where they are")
    blocks = _count_blocks(one.numbers)
    if is_first and _TILE_COLS not in one.numbers and max(places, lengths) > blocks:
        raise _IndexError("its index has more strips than its size makes")
    for known in (places, lengths):
        if 0 < known < blocks:
            raise _IndexError(f"its index has {known:,} of the {blocks:,} blocks that its size makes")
    if one.numbers.get(_KIND, 0) & _MASK:
        for array in one.arrays.values():  # GDAL takes blocks of a mask that it does not find for empty ones
            if array.kind in _TYPES:
                reader.array(array)
    return one


def _count_blocks(numbers: dict[int, int]) -> int:
    """Return how many tiles or strips an image has."""
    rows, cols = numbers.get(_ROWS, 0), numbers.get(_COLS, 0)
    planes = numbers.get(_SAMPLES, 1) if numbers.get(_PLANAR) == _SEPARATE else 1
    if _TILE_COLS in numbers:
        across = -(-cols // max(numbers[_TILE_COLS], 1))
        return -(-rows // max(numbers.get(_TILE_ROWS, rows), 1)) * across * planes
    return -(-rows // max(min(numbers.get(_STRIP_ROWS, rows), rows), 1)) * planes


@once_for_each_file
def stored_blocks(path: str, source: DatasetReader) -> Bools | None:
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


def is_cut_off(source: DatasetReader, bands: Sequence[int], size: int, row: int, col: int) -> bool:
    """Return whether a block of an open TIFF begins beyond its end, at a size in bytes, in one of some bands.

    An interrupted download leaves such a file.
    """
    name = f"BLOCK_OFFSET_{col}_{row}"
    return any(int(source.get_tag_item(name, "TIFF", bidx=band) or 0) >= size for band in bands)


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

    def _sample(self, stored: Bools, window: Window, values: Values) -> None:
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

    def _stored(self, window: Window) -> Bools | None:
        """Return which blocks that intersect a window are stored, of any of the bands, (rows, cols)."""
        known = stored_blocks(self.path, self.source)
        if known is None:
            return None
        part = known[:, *window.blocks(*self.source.block_shapes[0])]
        planes = [0] if len(part) == 1 else [band - 1 for band in self.bands]
        return np.asarray(part[planes].any(axis=0))
