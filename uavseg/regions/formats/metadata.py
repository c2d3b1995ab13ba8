"""Metadata of regions in files, one JSON object under the key "uavseg", and what else such a file holds.

A GeoPackage and a FlatGeobuf have it as an item of the metadata of their layer, GeoParquet in that of its
schema, GeoJSON as a foreign member (RFC 7946, 6.1) and KML as extended data of its document. A Shapefile and
a sequence of GeoJSON features have none.
"""

import html
import json
import math
import os
import re
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uavseg.dataclass import dataclass
from uavseg.errors import RegionError
from uavseg.inputs import parse_json, read_start
from uavseg.raster.access.opening import file_exists
from uavseg.raster.access.untrusted import check_database, open_database
from uavseg.regions.formats import vector_files
from uavseg.regions.formats.read import KML_FIELDS, vector_errors

METADATA_KEY = "uavseg"
_HEAD = 4 << 20  # bytes at the beginning of a text file, where its metadata is
_KML_DATA = re.compile(rf'<Data name="{METADATA_KEY}">\s*<value>([^<]*)</value>')
KML_NAMES = KML_FIELDS | {"id2"}  # that GDAL gives each KML file


def metadata_text(metadata: Mapping[str, Any]) -> str:
    """Format metadata as JSON in ASCII; empty where there is none."""
    return json.dumps(dict(metadata), separators=(",", ":"), allow_nan=False) if metadata else ""


def metadata_items(metadata: Mapping[str, Any]) -> dict[str, str]:
    """Return metadata as text items, for formats with key-value metadata."""
    return {METADATA_KEY: metadata_text(metadata)} if metadata else {}


def parse_metadata(text: str | None) -> dict[str, Any]:
    """Parse metadata; empty where the text is not a JSON object of finite numbers."""
    try:
        parsed = parse_json(text or "{}")
        json.dumps(parsed, allow_nan=False)  # NaN and infinity are not JSON
    except (ValueError, RecursionError):
        return {}
    return parsed if isinstance(parsed, dict) else {}


def read_json_metadata(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the metadata of a GeoJSON file that begins with it."""
    text = read_start(path, _HEAD, RegionError).decode("utf-8", "replace")
    member = re.search(rf'"{METADATA_KEY}"\s*:\s*(?={{)', text.partition('"features"')[0])
    if member is None:
        return {}
    try:
        _, end = json.JSONDecoder().raw_decode(text, member.end())
    except (ValueError, RecursionError):
        return {}
    return parse_metadata(text[member.end() : end])


def read_kml_metadata(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the metadata of a KML file."""
    head = read_start(path, _HEAD, RegionError).decode("utf-8", "replace").partition("<Placemark")[0]
    data = _KML_DATA.search(head)
    return parse_metadata(html.unescape(data[1])) if data else {}


@dataclass(frozen=True, slots=True)
class RegionFile:
    """Metadata of a file of regions."""

    path: str
    format: str  # such as "GeoPackage"
    layer: str | None  # the first
    others: int  # number of other layers
    geometry: str  # type
    regions: int
    crs: str | None  # name
    bounds: tuple[float, float, float, float] | None  # left, bottom, right, top; None if not finite
    columns: tuple[str, ...]
    metadata: dict[str, Any]  # source and parameters of the regions; may be empty

    def as_dict(self) -> dict[str, Any]:
        """Return all fields as plain values for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}


def is_region_file(path: str | os.PathLike[str]) -> bool:
    """Check whether a local file is of a format of regions; a GeoPackage of images is not."""
    if not file_exists(path) or not Path(path).is_file():
        return False
    file_format = vector_files.vector_format(path)
    return file_format is not None and not (file_format == "GeoPackage" and _holds_tiles(path))


def about_file(path: str | os.PathLike[str]) -> RegionFile:
    """Read the metadata of a file of regions, without the regions.

    A RegionError says that it cannot be read as regions, an AccessError that its content names other files or
    addresses.
    """
    name = os.fspath(path)
    vector_files.check_vector(path, name)
    file_format = vector_files.vector_format(path) or "unknown"
    with vector_errors(name):
        if file_format == "GeoParquet":
            return _about_parquet(path)
        with vector_files.reading_vectors():
            return _about_layer(path, name, file_format)


def _about_layer(path: str | os.PathLike[str], name: str, file_format: str) -> RegionFile:
    import pyogrio

    layers = vector_files.region_layers(path, name)
    vector_files.check_feature_count(path, name, layers[0])
    info = pyogrio.read_info(path, layer=layers[0], force_feature_count=True, force_total_bounds=True)
    reader = {"GeoJSON": read_json_metadata, "KML": read_kml_metadata}.get(file_format)
    item = (info.get("layer_metadata") or {}).get(METADATA_KEY)
    return RegionFile(
        path=name,
        format=file_format,
        layer=layers[0],
        others=len(layers) - 1,
        geometry=str(info["geometry_type"]),
        regions=int(info["features"]),
        crs=_crs_name(info["crs"]),
        bounds=_bounds(info["total_bounds"]),
        columns=tuple(f for f in map(str, info["fields"]) if file_format != "KML" or f not in KML_NAMES),
        metadata=parse_metadata(item) if reader is None else reader(path),
    )


def _about_parquet(path: str | os.PathLike[str]) -> RegionFile:
    with vector_files.import_pyarrow().parquet.ParquetFile(Path(path)) as file:
        schema, rows = file.schema_arrow, file.metadata.num_rows
    items = {key.decode(): value.decode("utf-8", "replace") for key, value in (schema.metadata or {}).items()}
    geo = parse_metadata(items.get("geo"))
    primary = str(geo.get("primary_column", "geometry"))
    column = geo.get("columns", {}).get(primary, {})
    return RegionFile(
        path=os.fspath(path),
        format="GeoParquet",
        layer=None,
        others=0,
        geometry=" or ".join(column.get("geometry_types", [])) or "unknown",
        regions=int(rows),
        crs=_crs_name(column.get("crs", "OGC:CRS84")),  # the default of GeoParquet
        bounds=_bounds(column.get("bbox")),
        columns=tuple(field for field in schema.names if field != primary),
        metadata=parse_metadata(items.get(METADATA_KEY)),
    )


def _crs_name(crs: Any) -> str | None:
    """Return the name of a CRS from a code, WKT or PROJJSON."""
    import pyproj

    return None if not crs else str(pyproj.CRS.from_user_input(crs).name)


def _bounds(extent: Any) -> tuple[float, float, float, float] | None:
    if extent is None or len(extent) != 4:
        return None
    left, bottom, right, top = map(float, extent)
    is_extent = left <= right and all(map(math.isfinite, (left, bottom, right, top)))
    return (left, bottom, right, top) if is_extent else None


def _holds_tiles(path: str | os.PathLike[str]) -> bool:
    """Check whether a GeoPackage holds images and no features."""
    try:
        check_database(path, os.fspath(path), RegionError)
        with open_database(path) as base:
            base.text_factory = bytes  # text of a damaged file may not be UTF-8
            types = {name for (name,) in base.execute("SELECT data_type FROM gpkg_contents")}
    except (RegionError, sqlite3.Error, UnicodeError):  # the message of an error may quote bytes
        return True  # MBTiles and others
    return b"features" not in types
