"""Content that libraries trust and should not: headers of JPEG 2000 and classic netCDF, views of SQLite."""

import re
import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import BinaryIO

from uavseg.arrays import Path_
from uavseg.errors import AccessError, RasterReadError, UavsegError, caused_errors
from uavseg.output.staging import interrupts_held
from uavseg.plain_text import cause_of, shown

JPEG2000 = b"\0\0\0\x0cjP  \r\n\x87\n"
_UUID = bytes.fromhex("b14bf8bd083d4b43a5ae8cd7d5a6ce03")
_MAX_BOXES = 10_000
_MAX_BYTES = 1 << 20  # of the box
_KEYS, _DOUBLES, _TEXTS = 34735, 34736, 34737  # tags
_SIZES = {_KEYS: 2, _DOUBLES: 8, _TEXTS: 1}  # of one value in bytes
NETCDF = (b"CDF\x01", b"CDF\x02", b"CDF\x05")
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}  # of a value, by its type
_MAX_DIMENSIONS = 1024  # of a variable, as in the library
MAX_STEPS = 30_000_000  # of SQLite's virtual machine for the rows of one view: a second or less
_STEPS = 100_000  # between two looks at their number
_SELECTS = 2  # ours and that of the view, which has no queries in it and reads no other view
_VIRTUAL_TABLE = re.compile(r"\s*create\s+virtual\s+table.*?\susing\s+(\w+)", re.IGNORECASE | re.DOTALL)
_FUNCTIONS = frozenset(  # whose time is that of their arguments
    {"abs", "avg", "coalesce", "count", "ifnull", "length", "lower", "max", "min", "nullif", "round", "sum"}
    | {"total", "upper"}
)


def check_geojp2(path: Path) -> None:
    """Refuse a JPEG 2000 file with a key of its CRS outside of its box (RasterReadError).

    GDAL leaves such keys out, and libgeotiff writes of them to stderr. They are in a small TIFF in a box of
    the file (GeoJP2). Formats: ISO/IEC 15444-1, annex I; OGC 19-008r4, annex B (GeoTIFF).
    """
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
    if len(keys) < 4 or len(keys) < 4 * (keys[3] + 1):
        return not keys
    return all(
        count == 1 if location == 0 else location in counts and offset + count <= counts[location]
        for _, location, count, offset in (keys[4 * n : 4 * n + 4] for n in range(1, keys[3] + 1))
    )


def check_netcdf_header(path: Path) -> None:
    """Refuse a netCDF file whose header counts more than lies within it (RasterReadError).

    The netCDF library allocates what the header asks for: 2 GB for a damaged file of 20 kB. Format:
    https://docs.unidata.ucar.edu/netcdf-c/current/file_format_specifications.html.
    """
    form = "{} (its netCDF header is damaged: {}); repair it, or get it again"
    failing = caused_errors(f"{path} cannot be opened as a raster", RasterReadError, ValueError, form=form)
    with path.open("rb") as file, failing:
        _Header(file, path.stat().st_size).check()


class _Header:
    """The header, read from its start; ValueError where it leaves the file."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        version = file.read(4)[3]
        self._count_bytes = 8 if version == 5 else 4
        self._place_bytes = 4 if version == 1 else 8

    def check(self) -> None:
        self._read_integer(self._count_bytes)  # of records
        for _ in range(self._list(_DIMENSIONS, 2)):
            self._text()
            self._read_integer(self._count_bytes)
        self._attributes()
        for _ in range(self._list(_VARIABLES, 6)):
            self._text()
            dimensions = self._read_integer(self._count_bytes)
            if dimensions > _MAX_DIMENSIONS:
                raise ValueError(f"a variable with {dimensions:,} dimensions")
            self._skip(dimensions * self._count_bytes)
            self._attributes()
            self._skip(4 + self._count_bytes + self._place_bytes)  # type, size, place

    def _attributes(self) -> None:
        for _ in range(self._list(_ATTRIBUTES, 3)):
            self._text()
            kind, count = self._read_integer(4), self._read_integer(self._count_bytes)
            if kind not in _BYTES:
                raise ValueError(f"an attribute of type {kind}")
            self._skip(count * _BYTES[kind])

    def _list(self, tag: int, numbers: int) -> int:
        """Return how many elements a list has, each of which holds at least so many numbers."""
        found, count = self._read_integer(4), self._read_integer(self._count_bytes)
        if found != tag and (found or count):
            raise ValueError(f"a list of kind {found} in place of {tag}")
        if count * numbers * 4 > self._size:
            raise ValueError(f"{count:,} entries in a file of {self._size:,} bytes")
        return count

    def _text(self) -> None:
        self._skip(self._read_integer(self._count_bytes))

    def _read_integer(self, length: int) -> int:
        content = self._file.read(length)
        if len(content) < length:
            raise ValueError("it ends before")
        return int.from_bytes(content, "big")

    def _skip(self, length: int) -> None:
        """Pass over bytes, which are padded to a multiple of four."""
        end = self._file.tell() + -(-length // 4) * 4
        if end > self._size:
            raise ValueError("it ends before")
        self._file.seek(end)


@contextmanager
def open_database(source: Path_ | bytes) -> Iterator[sqlite3.Connection]:
    """Open a database to be read; of bytes, a copy in memory."""
    if isinstance(source, bytes):
        database = sqlite3.connect(":memory:")
    else:
        address = f"{Path(source).resolve().as_uri()}?mode=ro&immutable=1"
        database = sqlite3.connect(address, uri=True)
    with closing(database):
        if isinstance(source, bytes):
            database.deserialize(source)
        yield database


def check_database(source: Path_ | bytes, name: str, error: Callable[[str], UavsegError]) -> None:
    """Refuse virtual tables other than indexes, and views that call functions or may not end.

    A view is a query that runs when its rows are read, inside of GDAL, which no signal stops: it may never
    end (`WITH RECURSIVE`), or multiply tables. So each view is tried first, under an authorizer and a bound.

    `name` is for messages; `error` makes of a message the exception of a database that cannot be read. An
    AccessError says that it has such a table or view.
    """
    failing = caused_errors(f"{name} cannot be read", error, sqlite3.Error, UnicodeError, form="{}: {}")
    with failing, open_database(source) as database:
        database.text_factory = lambda text: text.decode("utf-8", "surrogateescape")
        query = "SELECT type, name, sql FROM sqlite_master WHERE sql NOT NULL"
        for kind, named, definition in database.execute(query).fetchall():
            virtual = _VIRTUAL_TABLE.match(str(definition))
            if kind == "view":
                _check_view(database, str(named), name)
            elif virtual and not virtual[1].lower().startswith(("rtree", "fts")):
                raise AccessError(f"{name} has a virtual table of {virtual[1]}, which may read other files")


def _check_view(database: sqlite3.Connection, view: str, name: str) -> None:
    """Compile the query of a view, in which little is authorized, and count its rows within the bound."""
    quoted = '"' + view.replace('"', '""') + '"'
    selects = steps = 0

    def authorize(action: int, _: str | None, function: str | None, *others: str | None) -> int:
        nonlocal selects
        selects += action == sqlite3.SQLITE_SELECT
        is_denied = action == sqlite3.SQLITE_RECURSIVE or selects > _SELECTS
        is_denied |= action == sqlite3.SQLITE_FUNCTION and str(function).lower() not in _FUNCTIONS
        return sqlite3.SQLITE_DENY if is_denied else sqlite3.SQLITE_OK

    def is_beyond() -> bool:
        nonlocal steps
        steps += _STEPS
        return steps > MAX_STEPS

    try:
        database.set_authorizer(authorize)
        database.execute(f"EXPLAIN SELECT * FROM {quoted}").fetchall()
        database.set_authorizer(None)
        database.set_progress_handler(is_beyond, _STEPS)
        with interrupts_held():  # in the handler, they would look like its answer
            database.execute(f"SELECT count(*) FROM {quoted}").fetchall()
    except sqlite3.Error as error:
        raise AccessError(
            f"{name} has the view {shown(view)}, which may call functions or never end ({cause_of(error)}); "
            "save its rows as a layer of their own (in QGIS: Export, Save Features As)"
        ) from error
    finally:
        database.set_authorizer(None)
        database.set_progress_handler(None, 0)
