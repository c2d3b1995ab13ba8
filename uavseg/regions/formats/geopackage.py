"""Write regions to a GeoPackage (OGC 12-128r14, version 1.2, which older readers know too) with SQLite alone.

Not with GDAL, whose Python binding takes longer to load than a small raster takes to segment. Tables,
triggers and the count of features are those that GDAL writes, so that it, QGIS and others edit the file.
"""

import math
import sqlite3
from collections.abc import Sequence
from contextlib import closing
from html import escape
from importlib import resources
from pathlib import Path

import numpy as np

from uavseg.arrays import Float32s, Floats
from uavseg.errors import OutputError
from uavseg.raster.geodesy.globe import WGS84, define_crs
from uavseg.regions.formats.metadata import METADATA_KEY, metadata_text
from uavseg.regions.shapes import PolygonArray, batch_slices, flat_part, has_multipolygons
from uavseg.regions.table import Regions

GEOMETRY = "geom"
_SQL_TYPES = {"i": "INTEGER", "f": "REAL", "O": "TEXT"}  # by `dtype.kind` of numpy
_NO_SRS = (
    *("Undefined SRS", 99_999, "GDAL", 99_999),
    'LOCAL_CS["Undefined SRS",LOCAL_DATUM["unknown",32767],UNIT["unknown",0],AXIS["Easting",EAST],'
    'AXIS["Northing",NORTH]]',
    "Custom undefined coordinate reference system",
)
_CUSTOM_SRS = 100_000  # the first number of those that no authority has numbered, as of GDAL
_NEW_BOUNDS = ", ".join(f'ST_{side}(NEW."{GEOMETRY}")' for side in ("MinX", "MaxX", "MinY", "MaxY"))
# Of a geometry as section 2.1.3 has it: without an extent, and little-endian with the extent in x and y.
_HEADER = np.dtype(
    [("magic", "S2"), ("version", "u1"), ("flags", "u1"), ("srs", "<i4"), ("bounds", "<f8", 4)]
)
_HAS_EXTENT = 0b011
_CELL = np.dtype([("id", ">i8"), ("bounds", ">f4", 4)])  # of a node of the spatial index


def write_geopackage(regions: Regions, path: Path, layer: str, date: str) -> None:
    """Write regions as one layer of a new GeoPackage, with a spatial index and their metadata.

    The file is not there yet; after an error, a part of it is. `date` is that of the last change, such as
    "2000-01-01T00:00:00Z". An OutputError says that SQLite cannot write it, such as to a full disk, or that
    two columns differ in their case alone.
    """
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as base:
            base.execute("PRAGMA journal_mode = OFF")  # a file that is not finished is thrown away
            base.execute("PRAGMA synchronous = OFF")  # who moves it to its place syncs it first
            base.executescript(f"BEGIN; {_sql('tables')}")
            srs = _add_srs(base, regions.wkt)
            extent = _add_layer(base, regions, layer, srs)
            contents = (layer, "features", layer, "", date, *extent, srs)
            base.execute(f"INSERT INTO gpkg_contents VALUES ({_marks(contents)})", contents)
            base.execute("INSERT INTO gpkg_ogr_contents VALUES (?, ?)", (layer, len(regions)))
            if regions.metadata:
                _add_metadata(base, layer, metadata_text(regions.metadata), date)
            triggers = _sql("triggers").format(t=layer, g=GEOMETRY, bounds=_NEW_BOUNDS)
            base.executescript(f"BEGIN; {triggers}COMMIT;")
    except sqlite3.Error as error:
        raise OutputError(f"{path.name} cannot be written ({error}); is the disk full?") from error


def _sql(part: str) -> str:
    """Return the statements of a part: "tables", "metadata" or "triggers"."""
    file = resources.files("uavseg.regions.formats").joinpath(f"geopackage_{part}.sql")
    return file.read_text(encoding="utf-8")


def _marks(values: Sequence[object]) -> str:
    return ", ".join("?" * len(values))


def _add_srs(base: sqlite3.Connection, wkt: str | None) -> int:
    """Add the CRS of the regions to those that are required; return its number in this file."""
    if wkt is None:
        base.execute(f"INSERT INTO gpkg_spatial_ref_sys VALUES ({_marks(_NO_SRS)})", _NO_SRS)
        return _NO_SRS[1]
    crs = define_crs(wkt)
    number = crs.number or _CUSTOM_SRS
    row = (crs.name, number, crs.authority or "NONE", number, crs.wkt1 or "undefined", None)
    base.execute(f"INSERT OR IGNORE INTO gpkg_spatial_ref_sys VALUES ({_marks(row)})", row)
    if crs.wkt1 is None:  # the extension of section F.10
        column = "definition_12_063"
        base.execute(
            f"ALTER TABLE gpkg_spatial_ref_sys ADD COLUMN {column} TEXT NOT NULL DEFAULT 'undefined'"
        )
        update = f"UPDATE gpkg_spatial_ref_sys SET {column} = ? WHERE srs_id = ?"
        base.execute(update, (define_crs(WGS84).wkt2, 4326))
        base.execute(update, (crs.wkt2, number))
        _add_extension(base, "gpkg_spatial_ref_sys", column, "gpkg_crs_wkt", "crs_wkt", "read-write")
    return number


def _add_extension(
    base: sqlite3.Connection, table: str, column: str | None, name: str, page: str, scope: str
) -> None:
    row = (table, column, name, f"http://www.geopackage.org/spec120/#extension_{page}", scope)
    base.execute(f"INSERT INTO gpkg_extensions VALUES ({_marks(row)})", row)


def _add_layer(base: sqlite3.Connection, regions: Regions, layer: str, srs: int) -> list[float | None]:
    """Add the table of the regions with its spatial index; return its extent."""
    promote = has_multipolygons(regions.polygons)
    geometry_type = "MULTIPOLYGON" if promote else "POLYGON"
    types = {name.replace('"', '""'): _SQL_TYPES[one.dtype.kind] for name, one in regions.columns.items()}
    columns = [f'"{name}" {kind}' for name, kind in types.items()]
    fields = ['"fid" INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL', f'"{GEOMETRY}" {geometry_type}', *columns]
    base.execute(f'CREATE TABLE "{layer}" ({", ".join(fields)})')
    row = (layer, GEOMETRY, geometry_type, srs, 0, 0)
    base.execute(f"INSERT INTO gpkg_geometry_columns VALUES ({_marks(row)})", row)
    index = f'"rtree_{layer}_{GEOMETRY}"'
    base.execute(f"CREATE VIRTUAL TABLE {index} USING rtree(id, minx, maxx, miny, maxy)")
    _add_extension(base, layer, GEOMETRY, "gpkg_rtree_index", "rtree", "write-only")
    bounds = np.full((len(regions), 4), np.nan)
    insert = f'INSERT INTO "{layer}" VALUES ({_marks(fields)})'
    for part in batch_slices(regions.polygons):
        geometries, bounds[part] = _geometries(regions.polygons, part, promote, srs)
        values = [column[part].tolist() for column in regions.columns.values()]  # NaN becomes NULL
        numbers = range(part.start + 1, part.stop + 1)
        base.executemany(insert, zip(numbers, geometries, *values, strict=True))
    try:
        _pack_index(base, f"rtree_{layer}_{GEOMETRY}", bounds)
    except sqlite3.OperationalError:  # of an SQLite that protects the tables of an index, as macOS has it
        rows = zip(range(1, len(regions) + 1), *bounds.T.tolist(), strict=True)
        base.executemany(f"INSERT INTO {index} VALUES (?, ?, ?, ?, ?)", rows)
    return [*bounds[:, ::2].min(0).tolist(), *bounds[:, 1::2].max(0).tolist()] if len(regions) else [None] * 4


def _pack_index(base: sqlite3.Connection, index: str, bounds: Floats) -> None:
    """Fill an empty R*Tree of SQLite with full nodes, which takes a tenth of the time of inserts."""
    # Rows are in the order of S. T. Leutenegger, M. A. Lopez and J. Edgington, "STR: a simple and efficient
    # algorithm for R-tree packing" (ICDE 1997). Nodes: "Shadow tables" of https://www.sqlite.org/rtree.html.
    # `bounds`, (n, 4) float64, are of rows 1 to n: least and greatest x, least and greatest y.
    [(node_bytes,)] = base.execute(f'SELECT length(data) FROM "{index}_node"')
    capacity = (node_bytes - 4) // _CELL.itemsize
    slices = math.isqrt(len(bounds) // capacity) + 1
    x_rank = np.argsort(np.argsort(bounds[:, 0], kind="stable"))
    order = np.lexsort([bounds[:, 2], x_rank * slices // max(len(bounds), 1)])
    cells = np.empty(len(bounds), _CELL)
    cells["id"], cells["bounds"] = order + 1, _rounded_outward(bounds[order])
    base.execute(f'DELETE FROM "{index}_node"')
    first, depth, links = 2, 0, "rowid"
    while True:
        count = max(math.ceil(len(cells) / capacity), 1)
        numbers = np.arange(first, first + count) if count > 1 else np.array([1])  # 1 is the root
        full = np.zeros((count, capacity), _CELL)
        full.reshape(-1)[: len(cells)] = cells
        heads = np.full((count, 2), capacity, ">u2")
        heads[:, 0], heads[-1, 1] = depth if count == 1 else 0, len(cells) - (count - 1) * capacity
        padding = bytes(node_bytes - 4 - capacity * _CELL.itemsize)
        data = (head.tobytes() + row.tobytes() + padding for head, row in zip(heads, full, strict=True))
        base.executemany(
            f'INSERT INTO "{index}_node" VALUES (?, ?)', zip(numbers.tolist(), data, strict=True)
        )
        by_id = np.argsort(cells["id"])
        pairs = zip(cells["id"][by_id].tolist(), numbers[by_id // capacity].tolist(), strict=True)
        base.executemany(f'INSERT INTO "{index}_{links}" VALUES (?, ?)', pairs)
        if count == 1:
            return
        starts = np.arange(0, len(cells), capacity)
        above = np.empty(count, _CELL)
        above["id"] = numbers
        above["bounds"][:, ::2] = np.minimum.reduceat(cells["bounds"][:, ::2], starts)
        above["bounds"][:, 1::2] = np.maximum.reduceat(cells["bounds"][:, 1::2], starts)
        cells, first, depth, links = above, first + count, depth + 1, "parent"


def _rounded_outward(bounds: Floats) -> Float32s:
    """Round least and greatest values, in turn, to float32 that enclose them."""
    rounded = bounds.astype(np.float32)
    lower = np.where(rounded > bounds, np.nextafter(rounded, np.float32(-np.inf)), rounded)
    upper = np.where(rounded < bounds, np.nextafter(rounded, np.float32(np.inf)), rounded)
    return np.where([True, False, True, False], lower, upper)


def _geometries(
    polygons: PolygonArray, part: slice, promote: bool, srs: int
) -> tuple[list[memoryview], Floats]:
    """Return polygons as section 2.1.3 has them: header and WKB; and extents (n, 4), as of `_pack_index`."""
    headers = np.empty(part.stop - part.start, _HEADER)
    headers["magic"], headers["version"], headers["flags"], headers["srs"] = b"GP", 0, _HAS_EXTENT, srs
    flat = flat_part(polygons, part)
    headers["bounds"] = flat.bounds()[:, [0, 2, 1, 3]]
    return flat.to_wkb(headers.view(np.uint8).reshape(len(headers), -1), promote), headers["bounds"]


def _add_metadata(base: sqlite3.Connection, layer: str, text: str, date: str) -> None:
    """Add metadata of the layer, as GDAL has it: XML of its own, in the extension of section F.8."""
    base.executescript(f"BEGIN; {_sql('metadata')}")
    for table in ("gpkg_metadata", "gpkg_metadata_reference"):
        _add_extension(base, table, None, "gpkg_metadata", "metadata", "read-write")
    xml = (
        "<GDALMultiDomainMetadata>\n  <Metadata>\n"
        f'    <MDI key="{METADATA_KEY}">{escape(text, quote=False)}</MDI>\n'
        "  </Metadata>\n</GDALMultiDomainMetadata>\n"
    )
    base.execute("INSERT INTO gpkg_metadata VALUES (1, 'dataset', 'http://gdal.org', 'text/xml', ?)", [xml])
    reference = ("table", layer, None, None, date, 1, None)
    base.execute(f"INSERT INTO gpkg_metadata_reference VALUES ({_marks(reference)})", reference)
