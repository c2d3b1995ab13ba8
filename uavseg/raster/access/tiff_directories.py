"""Directories of a TIFF: GDAL reads as many as it can, and leaves out a mask that it cannot reach.

Format: https://www.awaresystems.be/imaging/tiff/faq.html, and BigTIFF. Each directory names the place of the
next one, the last one 0.
"""

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

from uavseg.errors import RasterReadError
from uavseg.inputs import regular_file
from uavseg.plain_text import cause_of

MAX_DIRECTORIES = 65536  # as in libtiff
_KIND, _COLS, _ROWS = 254, 256, 257  # tags
_INDEX = (273, 279, 324, 325)  # tags of the places and lengths of blocks
_SIZES = {3: 2, 4: 4, 16: 8}  # of a number in bytes, by its type
_REDUCED, _MASK = 1, 4  # bits of the tag of the kind
_FORMATS = {3: "H", 4: "I", 16: "Q"}  # of a number, by its type


@dataclass(frozen=True, slots=True)
class _Layout:
    """How numbers lie in a TIFF: byte order, and the formats of a count, an entry and a place."""

    order: str
    count: str
    entry: str
    place: str

    def read(self, file: BinaryIO, numbers: str) -> tuple[int, ...]:
        """Numbers at the present place.

        Raises
        ------
        struct.error
            If the file ends before.
        """
        return struct.unpack(self.order + numbers, file.read(struct.calcsize(self.order + numbers)))


def stores_mask(path: str) -> bool:
    """Whether a TIFF has a mask for its first image.

    Raises
    ------
    RasterReadError
        If one of its directories cannot be read.
    """
    try:
        with regular_file(path).open("rb") as file:
            directories = _directories(file)
    except (OSError, struct.error, OverflowError) as error:
        if isinstance(error, RasterReadError):
            raise
        reason = cause_of(error) if isinstance(error, OSError) else "it ends before"
        raise RasterReadError(
            f"{path} cannot be opened as a raster (one of its directories cannot be read: {reason}); the "
            "file is damaged or incomplete: repair it, or copy its first image with gdal_translate"
        ) from error
    size = [directories[0].get(tag) for tag in (_ROWS, _COLS)]
    return any(
        one.get(_KIND, 0) & (_MASK | _REDUCED) == _MASK and [one.get(_ROWS), one.get(_COLS)] == size
        for one in directories[1:]
    )


def _directories(file: BinaryIO) -> list[dict[int, int]]:
    """Kind and size of each image, as numbers by tag."""
    start = file.read(4)
    order, is_big = "<" if start[:2] == b"II" else ">", b"+" in start[2:4]
    layout = _Layout(order, "Q", "HHQ8s", "Q") if is_big else _Layout(order, "H", "HHI4s", "I")
    if is_big:
        file.seek(8)
    (place,) = layout.read(file, layout.place)
    found: dict[int, dict[int, int]] = {}
    while place and place not in found and len(found) < MAX_DIRECTORIES:
        file.seek(place)
        found[place], place = _directory(file, layout)
    if not found:
        raise struct.error
    return list(found.values())


def _directory(file: BinaryIO, layout: _Layout) -> tuple[dict[int, int], int]:
    """Numbers by tag, and the place of the next directory."""
    (count,) = layout.read(file, layout.count)
    step = struct.calcsize(layout.order + layout.entry)
    if count * step > os.fstat(file.fileno()).st_size:
        raise struct.error
    content, numbers = file.read(count * step), {}
    (following,) = layout.read(file, layout.place)
    index = []
    for tag, kind, items, value in struct.iter_unpack(layout.order + layout.entry, content):
        if tag in (_KIND, _COLS, _ROWS) and items == 1 and kind in _FORMATS:
            number = layout.order + _FORMATS[kind]
            if struct.calcsize(number) <= len(value):
                (numbers[tag],) = struct.unpack_from(number, value)
        elif tag in _INDEX and items * _SIZES.get(kind, 0) > len(value):
            index.append((*struct.unpack(layout.order + layout.place, value), items * _SIZES[kind]))
    if numbers.get(_KIND, 0) & _MASK:
        _check_index(file, index)
    return numbers, following


def _check_index(file: BinaryIO, index: list[tuple[int, int]]) -> None:
    """Check that the index of a mask can be read: GDAL takes blocks that it does not find for empty ones."""
    for place, size in index:
        file.seek(place)
        while size > 0:
            piece = file.read(min(size, 1 << 20))
            if not piece:
                raise struct.error
            size -= len(piece)
