"""Index of a TIFF: which of its blocks are stored, and which lie beyond its end.

GDAL tells that one block at a time, which takes too long for all of them.

Format: https://www.awaresystems.be/imaging/tiff/tifftags.html, and BigTIFF. The index is two arrays, offsets
and lengths of blocks; sparse files leave entries, or both arrays, empty.
"""

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from rasterio.io import DatasetReader

_OFFSETS, _LENGTHS = (273, 324), (279, 325)  # of strips, of tiles
_TYPES = {3: "u2", 4: "u4", 16: "u8"}

Stored = NDArray[np.bool_]

_known: "WeakKeyDictionary[DatasetReader, Stored | None]" = WeakKeyDictionary()  # by open file


def stored_blocks(path: str, source: DatasetReader) -> Stored | None:
    """Return which blocks of an open local TIFF are stored.

    They are (planes, rows, cols) of blocks: one plane for all bands, or one for each if bands are stored one
    after the other. None if the index is incomplete or cannot be read.
    """
    if source not in _known:
        _known[source] = _find_stored(path, source)
    return _known[source]


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


def _find_stored(path: str, source: DatasetReader) -> Stored | None:
    place = source.get_tag_item("IFD_OFFSET", "TIFF", bidx=1)
    try:
        size = Path(path).stat().st_size
    except (OSError, ValueError):
        return None
    if place is None:
        return None
    rows, cols = source.block_shapes[0]
    shape = -(-source.shape[0] // rows), -(-source.shape[1] // cols)
    planes = 1 if source.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE") == "PIXEL" else source.count
    return _stored(path, int(place), (planes, *shape), size)


def _stored(path: str, place: int, shape: tuple[int, int, int], size: int) -> Stored | None:
    try:
        with Path(path).open("rb") as file:
            arrays = _read_index(file, place, size, math.prod(shape))
    except (OSError, struct.error):
        return None
    if arrays is None:
        return None
    stored = np.zeros(shape, bool)
    for values in arrays:
        if len(values):
            stored |= values.reshape(shape) != 0
    return stored


def _read_index(
    file: BinaryIO, place: int, size: int, count: int
) -> list[NDArray[np.unsignedinteger]] | None:
    """Read offsets and lengths of `count` blocks, each empty if the file has none; None if damaged."""
    start = file.read(4)
    order, big = {b"II": "<", b"MM": ">"}.get(start[:2], "<"), start[2:4].strip(b"\0") == b"+"
    head, entry = ("Q", "HHQ8s") if big else ("H", "HHI4s")
    file.seek(place)
    (length,) = struct.unpack(order + head, file.read(struct.calcsize(head)))
    step = struct.calcsize("<" + entry)
    content = file.read(step * min(length, 4096))
    result = []
    for tag, kind, items, value in struct.iter_unpack(order + entry, content[: len(content) // step * step]):
        if tag in _OFFSETS + _LENGTHS and items > 0:
            array = _read_array(file, order, kind, items, value, size)
            if array is None or len(array) != count:
                return None
            result.append(array)
    return result


def _read_array(
    file: BinaryIO, order: str, kind: int, items: int, value: bytes, size: int
) -> NDArray[np.unsignedinteger] | None:
    """Return an array of a directory: in its entry if it fits there, elsewhere in the file if not."""
    if kind not in _TYPES:
        return None
    dtype = np.dtype(order + _TYPES[kind])
    total = items * dtype.itemsize
    if total <= len(value):
        return np.frombuffer(value, dtype, items)
    (offset,) = struct.unpack(order + ("Q" if len(value) == 8 else "I"), value)
    if offset + total > size:
        return None
    file.seek(offset)
    content = file.read(total)
    return np.frombuffer(content, dtype) if len(content) == total else None
