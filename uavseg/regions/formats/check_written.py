"""Whether a file of regions is all there: GDAL tells nobody when the disk is full as it closes a file."""

import mmap
import sqlite3
import struct
from contextlib import closing
from pathlib import Path

_NODE = 40  # bytes of one node of FlatGeobuf's index, and its branches
_BRANCHES = 16


def is_whole(path: Path, count: int) -> bool:
    """Whether a .gpkg, .fgb or .shp that GDAL wrote with `count` regions is complete.

    Sources: SQLite's integrity check; the layout of FlatGeobuf 3 (magic, header, packed Hilbert R-tree,
    features, each with its size in front); ESRI Shapefile Technical Description (1998) and the dBASE III
    header, which name the length of their files.
    """
    check = {".gpkg": _geopackage, ".fgb": _flatgeobuf, ".shp": _shapefile}[path.suffix.lower()]
    try:
        return check(path, count)
    except (OSError, sqlite3.Error, struct.error, ValueError):
        return False


def _geopackage(path: Path, count: int) -> bool:
    if len(list(path.parent.iterdir())) > 1:  # a journal that was not played to its end
        return False
    with closing(sqlite3.connect(f"file:{path.as_posix()}?mode=ro&immutable=1", uri=True)) as base:
        [(table, left)] = base.execute("SELECT table_name, min_x FROM gpkg_contents").fetchall()
        [(told,)] = base.execute("SELECT feature_count FROM gpkg_ogr_contents").fetchall()
        [(rows,)] = base.execute(f'SELECT count(*) FROM "{table}"').fetchall()
        [(indexed,)] = base.execute(f'SELECT count(*) FROM "rtree_{table}_geom_rowid"').fetchall()
        [(verdict,), *_] = base.execute("PRAGMA quick_check(1)").fetchall()
    placed = count == 0 or left is not None  # the extent is told last
    return bool(told == rows == indexed == count and placed and verdict == "ok")


def _flatgeobuf(path: Path, count: int) -> bool:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        place = 12 + struct.unpack_from("<I", data, 8)[0] + _index_bytes(count)
        for _ in range(count):
            place += 4 + struct.unpack_from("<I", data, place)[0]
        return bool(place == len(data))


def _index_bytes(count: int) -> int:
    nodes, level = count, count
    while level > 1:
        level = -(-level // _BRANCHES)
        nodes += level
    return (nodes + (count == 1)) * _NODE  # a single feature has a root above it


def _shapefile(path: Path, count: int) -> bool:
    for part in (path, path.with_suffix(".shx")):
        if 2 * struct.unpack_from(">i", _first(part, 28), 24)[0] != part.stat().st_size:
            return False
    records, header, width = struct.unpack_from("<IHH", _first(path.with_suffix(".dbf"), 12), 4)
    told = header + records * width + 1  # an end mark follows the records
    told_all = path.with_suffix(".dbf").stat().st_size == told and records == count
    indexed = path.with_suffix(".shx").stat().st_size == 100 + 8 * count
    return told_all and indexed and _closed(path.with_suffix(".prj"))


def _closed(path: Path) -> bool:
    """Whether the text of a CRS, where there is one, ends with its last bracket."""
    text = path.read_text() if path.exists() else "[]"
    return text.count("[") == text.count("]") > 0


def _first(path: Path, size: int) -> bytes:
    with path.open("rb") as file:
        return file.read(size)
