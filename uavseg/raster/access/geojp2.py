"""Keys of the coordinate reference system in a JPEG 2000 file: those that cannot be read are an error.

GDAL leaves such keys out, and libgeotiff writes of them to stderr. They are in a small TIFF in a box of the
file (GeoJP2). Formats: ISO/IEC 15444-1, annex I; OGC 19-008r4, annex B (GeoTIFF).
"""

import struct
from collections.abc import Iterator
from pathlib import Path

from uavseg.errors import RasterReadError

SIGNATURE = b"\0\0\0\x0cjP  \r\n\x87\n"
_UUID = bytes.fromhex("b14bf8bd083d4b43a5ae8cd7d5a6ce03")
_MAX_BOXES = 10_000
_MAX_BYTES = 1 << 20  # of the box
_KEYS, _DOUBLES, _TEXTS = 34735, 34736, 34737  # tags
_SIZES = {_KEYS: 2, _DOUBLES: 8, _TEXTS: 1}  # of one value in bytes


def check_geojp2(path: Path) -> None:
    """Refuse a file with a key of its coordinate reference system outside of its box (RasterReadError)."""
    for box in _geojp2_boxes(path):
        try:
            sound = _are_sound(*_arrays(box))
        except struct.error:
            sound = False
        if not sound:
            raise RasterReadError(
                f"{path} cannot be opened as a raster (the keys of its coordinate reference system cannot be "
                "read); the file is damaged: repair it, or write it anew with gdal_translate -a_srs"
            )


def _geojp2_boxes(path: Path) -> Iterator[bytes]:
    """Return contents of the boxes of GeoJP2."""
    size, place = path.stat().st_size, 0
    with path.open("rb") as file:
        for _ in range(_MAX_BOXES):
            file.seek(place)
            header = file.read(32)
            if len(header) < 8:
                return
            length, kind = struct.unpack(">I4s", header[:8])
            start = 8
            if length == 1 and len(header) >= 16:
                (length,), start = struct.unpack(">Q", header[8:16]), 16
            end = place + length if length else size
            if kind == b"uuid" and header[start : start + 16] == _UUID:
                file.seek(place + start + 16)
                yield file.read(min(max(end - file.tell(), 0), _MAX_BYTES))
            if end <= place or end >= size:
                return
            place = end


def _arrays(box: bytes) -> tuple[tuple[int, ...], dict[int, int]]:
    """Return the keys as numbers, and how many numbers and letters they may refer to, by tag."""
    order = "<" if box[:2] == b"II" else ">"
    (place,) = struct.unpack_from(order + "I", box, 4)
    (count,) = struct.unpack_from(order + "H", box, place)
    keys: tuple[int, ...] = ()
    counts = dict.fromkeys(_SIZES, 0)
    for n in range(count):
        at = place + 2 + 12 * n
        tag, _, items, offset = struct.unpack_from(order + "HHII", box, at)
        if tag not in _SIZES:
            continue
        begin = offset if items * _SIZES[tag] > 4 else at + 8
        if begin + items * _SIZES[tag] > len(box):
            raise struct.error
        counts[tag] = items
        if tag == _KEYS:
            keys = struct.unpack_from(f"{order}{items}H", box, begin)
        if tag == _TEXTS:
            counts[tag] = (box[begin : begin + items] + b"\0").index(b"\0") + 1  # what follows is not read
    return keys, counts


def _are_sound(keys: tuple[int, ...], counts: dict[int, int]) -> bool:
    """Return whether each entry (key, location, count, offset) after the header lies within its array."""
    if not keys:
        return True
    if len(keys) < 4 or len(keys) < 4 * (keys[3] + 1):
        return False
    for n in range(1, keys[3] + 1):
        _, location, count, offset = keys[4 * n : 4 * n + 4]
        if location == 0:
            if count != 1:
                return False
        elif location not in counts or offset + count > counts[location]:
            return False
    return True
