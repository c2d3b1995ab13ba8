"""Verify written files: GDAL does not report a full disk when it closes a file."""

import mmap
import sqlite3
import struct
from contextlib import closing
from pathlib import Path

_NODE_BYTES = 40  # of one node of FlatGeobuf's index
_BRANCHES = 16  # of one node
_GEOPACKAGE, _OLDEST = 0x47504B47, 10200  # "GPKG" and version 1.2
_TRIGGERS = (
    "trigger_insert_feature_count_{}",
    "trigger_delete_feature_count_{}",
    "rtree_{}_geom_insert",
    "rtree_{}_geom_delete",
)


def is_complete(path: Path, count: int) -> bool:
    """Whether a .gpkg, .fgb or .shp that GDAL wrote with `count` regions is complete.

    By SQLite's integrity check, and what else a GeoPackage of GDAL has; the layout of FlatGeobuf 3 (magic,
    header, packed Hilbert R-tree, features, each preceded by its size); and the file lengths stated in the
    headers of shapefiles (ESRI Shapefile Technical Description, 1998) and dBASE III tables.
    """
    check = {".gpkg": _geopackage, ".fgb": _flatgeobuf, ".shp": _shapefile}[path.suffix.lower()]
    try:
        return check(path, count)
    except (OSError, sqlite3.Error, struct.error, ValueError):
        return False


def _geopackage(path: Path, count: int) -> bool:
    if len(list(path.parent.iterdir())) > 1:  # a journal of an unfinished transaction
        return False
    with closing(sqlite3.connect(f"file:{path.as_posix()}?mode=ro&immutable=1", uri=True)) as base:
        [(table, min_x)] = base.execute(
            "SELECT table_name, min_x FROM gpkg_contents WHERE data_type = 'features'"
        ).fetchall()
        [(stated,)] = base.execute(
            "SELECT feature_count FROM gpkg_ogr_contents WHERE table_name = ?", [table]
        ).fetchall()
        [(rows,)] = base.execute(f'SELECT count(*) FROM "{table}"').fetchall()
        [(indexed,)] = base.execute(f'SELECT count(*) FROM "rtree_{table}_geom_rowid"').fetchall()
        [(integrity,), *_] = base.execute("PRAGMA quick_check(1)").fetchall()
        [(kind,), (version,)] = (
            base.execute(f"PRAGMA {name}").fetchone() for name in ("application_id", "user_version")
        )
        [(crs,)] = base.execute(
            "SELECT count(*) FROM gpkg_geometry_columns JOIN gpkg_spatial_ref_sys USING (srs_id)"
        ).fetchall()
        pages, page_bytes = (base.execute(f"PRAGMA page_{it}").fetchone()[0] for it in ("count", "size"))
        triggers = {name for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'")}
    has_extent = count == 0 or min_x is not None  # the extent is written last
    has_header = kind == _GEOPACKAGE and version >= _OLDEST and crs == 1
    has_triggers = triggers >= {name.format(table) for name in _TRIGGERS}
    is_whole = stated == rows == indexed == count and has_extent and integrity == "ok"
    has_all_bytes = pages * page_bytes == path.stat().st_size
    return bool(is_whole and has_header and has_triggers and has_all_bytes)


def _flatgeobuf(path: Path, count: int) -> bool:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        position = 12 + struct.unpack_from("<I", data, 8)[0] + _index_bytes(count)
        for _ in range(count):
            position += 4 + struct.unpack_from("<I", data, position)[0]
        return bool(position == len(data))


def _index_bytes(count: int) -> int:
    nodes, level = count, count
    while level > 1:
        level = -(-level // _BRANCHES)
        nodes += level
    return (nodes + (count == 1)) * _NODE_BYTES  # a single feature has a root above it


def _shapefile(path: Path, count: int) -> bool:
    for part in (path, path.with_suffix(".shx")):
        if 2 * struct.unpack_from(">i", _read_start(part, 28), 24)[0] != part.stat().st_size:
            return False
    records, header, width = struct.unpack_from("<IHH", _read_start(path.with_suffix(".dbf"), 12), 4)
    table_bytes = header + records * width + 1  # an end mark follows the records
    table_complete = path.with_suffix(".dbf").stat().st_size == table_bytes and records == count
    index_complete = path.with_suffix(".shx").stat().st_size == 100 + 8 * count
    return table_complete and index_complete and _brackets_balance(path.with_suffix(".prj"))


def _brackets_balance(path: Path) -> bool:
    """Whether the WKT of a CRS, if there is one, has all its closing brackets."""
    text = path.read_text() if path.exists() else "[]"
    return text.count("[") == text.count("]") > 0


def _read_start(path: Path, size: int) -> bytes:
    with path.open("rb") as file:
        return file.read(size)
