"""Safe reading of vector files of unknown origin: formats, links, options of GDAL; what GDAL left out.

GDAL recognises formats by content, and some formats (OGR VRT, descriptions of web services, pipelines of
GDAL) name other files or addresses. So only the formats below are opened, a file with one of their extensions
only as that format, and GDAL makes no request meanwhile. It skips what it cannot read, mostly without an
error, and a lost region may be the one that a drone has to keep away from: so what is read is counted.
"""

import json
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from uavseg.access import current_policy
from uavseg.arrays import Objects, Path_
from uavseg.errors import AccessError, MissingLibraryError, RegionError, caused_errors
from uavseg.inputs import MAX_TEXT, parse_json, read_bytes, read_start, regular_file
from uavseg.output.staging import default_signals
from uavseg.raster.access.opening import OFFLINE_OPTIONS
from uavseg.raster.access.untrusted import check_database

_EXTENSIONS: dict[str, tuple[str, ...]] = (
    {"GeoJSON": (".geojson", ".json", ".geojsonl", ".geojsons", ".ndjson", ".topojson")}
    | {"GeoPackage": (".gpkg",), "FlatGeobuf": (".fgb",), "GeoParquet": (".parquet", ".geoparquet")}
    | {"Shapefile": (".shp",), "KML": (".kml",), "KMZ": (".kmz",)}
)
_MAGIC = {b"SQLite format 3\0": "GeoPackage", b"fgb": "FlatGeobuf", b"PAR1": "GeoParquet"}
_MAGIC |= {b"\0\0\x27\x0a": "Shapefile", b"PK\x03\x04": "KMZ"}
_BESIDE = (".shx", ".dbf", ".prj", ".cpg", ".cst", ".qix", ".sbn", ".qpj")  # of a Shapefile
_OPTIONS = {**OFFLINE_OPTIONS, "OGR_SQLITE_ALLOW_EXTERNAL_ACCESS": "NO", "LIBKML_RESOLVE_STYLE": "NO"}

# A linked CRS: JSON as GDAL reads it has single or double quotes, and letters may be escaped.
_MAY_LINK = re.compile(rb"[\"']\s*(?:href|url)\s*[\"']|\\u00[4-7]", re.IGNORECASE)
_PIPELINE = b"gdal_streamed_alg"
_DESCRIPTION = re.compile(rb"<\s*(?:OGR\w*DataSource|GDAL_\w+|VRTDataset)|<!ENTITY", re.IGNORECASE)
_KML = re.compile(rb"<\s*(?:\w+:)?kml[\s>]", re.IGNORECASE)
_thread = threading.local()
_PIECE = 1 << 24  # bytes of a text that are read at once
_GEOMETRY = b'"geometry"'


def check_vector(source: Path_ | bytes, name: str) -> None:
    """Refuse a file that is not of a known format and that of its extension, or that links to others.

    The source is a local file, or the content of one; `name` is for messages. A RegionError says that it is
    not a regular file, or of another format, an AccessError that its content names other files or addresses.
    """
    if not isinstance(source, bytes):
        regular_file(source, RegionError)
    start = source[: 1 << 16] if isinstance(source, bytes) else read_start(source, 1 << 16, RegionError)
    file_format = _format_of(start)
    suffix = "" if isinstance(source, bytes) else Path(source).suffix.lower()
    expected = next((known for known, ends in _EXTENSIONS.items() if suffix in ends), file_format)
    if _DESCRIPTION.search(start) or _PIPELINE in start:
        raise AccessError(
            f"{name} is a description that names other files or addresses, not a file of polygons"
        )
    if file_format is None or file_format != expected:
        raise RegionError(
            f"{name} cannot be read as regions: it is not {expected or 'one of ' + ', '.join(_EXTENSIONS)}"
        )
    if file_format == "GeoJSON":
        _check_json(source, name)
    elif file_format == "GeoPackage":
        check_database(source, name, RegionError)
    elif isinstance(source, bytes):
        return
    elif file_format == "Shapefile":
        for beside in (Path(source).with_suffix(end) for end in _BESIDE):
            if os.path.lexists(beside):
                read_start(current_policy().check_file(source, beside), error=RegionError)


def import_pyarrow() -> Any:
    """Return pyarrow with its Parquet module; raise a MissingLibraryError where it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pyarrow":
            raise
        raise MissingLibraryError(
            "GeoParquet needs pyarrow, which is not installed; install it with: "
            'pip install "uavseg[parquet]", or choose another format, such as .gpkg'
        ) from error
    return pyarrow


def vector_format(path: Path_) -> str | None:
    """Return the format of a vector file by its first bytes; None for an unsupported one."""
    return _format_of(read_start(path, 1 << 16, RegionError))


def reading_vectors() -> AbstractContextManager[None]:
    """Return a context in which GDAL reads vectors without requests or code from databases."""
    return gdal_options({} if current_policy().allow_network else _OPTIONS)


def _format_of(start: bytes) -> str | None:
    for magic, file_format in _MAGIC.items():
        if start.startswith(magic):
            return file_format
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n\x1e")
    if text[:1] in (b"{", b"["):
        return "GeoJSON"
    return "KML" if text[:1] == b"<" and _KML.search(text) else None


def _check_json(source: Path_ | bytes, name: str) -> None:
    """Refuse a linked coordinate reference system; most files need no parsing to rule one out."""
    if current_policy().allow_network or not any(map(_MAY_LINK.search, _overlapping(source, 64))):
        return
    content = source if isinstance(source, bytes) else read_bytes(source, RegionError, MAX_TEXT)
    unread = caused_errors(f"{name} cannot be read as regions", RegionError, ValueError, form="{}: {}")
    with unread, default_signals():
        parsed = parse_json(content.decode())
    link = _linked_crs(parsed)
    if link is not None:
        current_policy().check_address(name, f"{link[:100]!r} as its coordinate reference system")


def _linked_crs(parsed: Any) -> str | None:
    """Return the address of a `crs` of the type link or url, anywhere in parsed JSON."""
    pending = [parsed]
    while pending:
        value = pending.pop()
        if isinstance(value, list):
            pending += value
        elif isinstance(value, dict):
            for key, inner in value.items():
                if key.lower() == "crs" and isinstance(inner, dict):
                    named = json.dumps(inner)
                    if re.search(r'"(?:link|url|href)"', named, re.IGNORECASE):
                        return named
            pending += value.values()
    return None


@contextmanager
def gdal_options(options: Mapping[str, str]) -> Iterator[None]:
    """Enter a context with options of GDAL, in which its messages are warnings, whatever the thread.

    The options belong to the process: only one thread at a time may be in such a context. pyogrio handles
    messages of the thread in which it was first imported. In all others GDAL prints them on stderr, and a
    geometry that it could not read is lost without a warning.
    """
    import pyogrio

    if not hasattr(_thread, "handles_messages"):
        from pyogrio._err import _register_error_handler  # as pyogrio does when it is imported

        _register_error_handler()
        _thread.handles_messages = True
    before = {option: pyogrio.get_gdal_config_option(option) for option in options}
    pyogrio.set_gdal_config_options(dict(options))
    try:
        yield
    finally:
        pyogrio.set_gdal_config_options(before)


def region_layers(source: Path_, name: str) -> list[str]:
    """Return the names of the layers of a file, without the table in which QGIS saves styles of others.

    A file without such a layer is refused with a RegionError; `name` is for messages.
    """
    import pyogrio

    layers = [layer for layer in map(str, pyogrio.list_layers(source)[:, 0]) if layer != "layer_styles"]
    if not layers:
        raise RegionError(f"{name} holds no layer of regions")
    return layers


def check_feature_count(source: Path_ | bytes, name: str, layer: str | None = None) -> int:
    """Return how many features a layer claims, -1 if that is not known before they are read.

    Refuse a layer, by default the first one, that claims more than its file has bytes, and JSON with features
    that GDAL does not count, with a RegionError. `name` is for messages.
    """
    import pyogrio

    size = len(source) if isinstance(source, bytes) else Path(source).stat().st_size
    info = pyogrio.read_info(source, layer=layer)
    features = int(info["features"])
    if features > size:
        raise RegionError(f"{name} claims {features:,} features in {size:,} bytes; its header is damaged")
    if "JSON" in info["driver"]:
        _check_json_count(source, name, features, info["driver"] == "GeoJSONSeq")
    return features


def check_count(count: int, features: int, name: str) -> None:
    """Refuse a layer of which fewer or more features were read than it claims, with a RegionError.

    It claims `features`, -1 if unknown, and `count` were read; `name` is for messages.
    """
    if features not in (-1, count):
        raise RegionError(f"{name} claims {features:,} features, and {count:,} can be read; it is damaged")


def check_geometries(geometries: Objects, name: str) -> None:
    """Refuse features without a geometry (None), or with an empty one, with a RegionError about `name`."""
    missing = np.flatnonzero(shapely.is_missing(geometries) | shapely.is_empty(geometries))
    if len(missing) == len(geometries):
        raise RegionError(f"{name} holds no regions")
    if len(missing):
        raise RegionError(
            f"{name} has {len(missing):,} of {len(geometries):,} features without a geometry, or with one "
            f"that cannot be read (the first is feature {missing[0] + 1}); delete or repair them"
        )


def check_attributes(source: Path_ | bytes, name: str, count: int) -> None:
    """Refuse a Shapefile whose table of attributes was not read, with a RegionError.

    `name` is for messages, `count` is how many attributes were read.
    """
    if count == 0 and not isinstance(source, bytes):
        table = Path(source).with_suffix(".dbf")
        if Path(source).suffix.lower() == ".shp" and os.path.lexists(table):
            raise RegionError(
                f"{name} cannot be read as regions: {table.name}, the table of its attributes, is damaged"
            )


def _check_json_count(source: Path_ | bytes, name: str, features: int, is_sequence: bool) -> None:
    """Refuse JSON with features that GDAL does not count; it is parsed only if members geometry differ."""
    import pyogrio

    if any(b"\0" in piece for piece in _pieces(source)):  # GDAL goes on after it somewhere
        raise RegionError(f"{name} cannot be read as regions: it has null bytes, which JSON has not")
    present = _count_records(source) if is_sequence else features
    members = sum(piece.count(_GEOMETRY) for piece in _overlapping(source, len(_GEOMETRY) - 1))
    if present == features == members:
        return
    layers = range(len(pyogrio.list_layers(source)))  # those of bytes have another name each time
    counted = sum(int(pyogrio.read_info(source, layer=layer)["features"]) for layer in layers)
    if present <= counted:
        content = source if isinstance(source, bytes) else read_bytes(source, RegionError, MAX_TEXT)
        texts = content.split(_separator(content)) if is_sequence else [content]
        unread = caused_errors(f"{name} cannot be read as regions", RegionError, ValueError, form="{}: {}")
        with unread, default_signals():
            present = sum(
                _features_of(parse_json(text.decode("utf-8-sig"))) for text in texts if text.strip()
            )
    if counted < present:
        raise RegionError(f"{name} has {present:,} features, of which {counted:,} can be read; repair it")


def _count_records(source: Path_ | bytes) -> int:
    """Count the records of a sequence of JSON texts."""
    count = 0
    separator = b""
    is_blank = True
    for piece in _pieces(source):
        separator = separator or _separator(piece)
        for n, part in enumerate(piece.split(separator)):
            is_blank |= n > 0
            if is_blank and part.strip():
                count += 1
                is_blank = False
    return count


def _separator(start: bytes) -> bytes:
    """Return the separator of records: newline, or record separator (RFC 8142)."""
    return b"\x1e" if start.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"\x1e") else b"\n"


def _features_of(parsed: Any) -> int:
    """Count the features of GeoJSON, ESRI JSON or TopoJSON; a geometry alone is one."""
    if not isinstance(parsed, dict):
        return 0
    objects = parsed.get("objects")
    if parsed.get("type") == "Topology" and isinstance(objects, dict):
        parts = [one.get("geometries") for one in objects.values() if isinstance(one, dict)]
        return sum(len(part) if isinstance(part, list) else 1 for part in parts)
    features = parsed.get("features")
    return sum(isinstance(one, dict) for one in features) if isinstance(features, list) else 1


def _overlapping(source: Path_ | bytes, size: int) -> Iterator[bytes]:
    """Read a file in pieces, each with so many bytes of what comes before it."""
    before = b""
    for piece in _pieces(source):
        yield before + piece
        before = (before + piece)[-size:]


def _pieces(source: Path_ | bytes) -> Iterator[bytes]:
    """Read a file in pieces; bytes are one."""
    if isinstance(source, bytes):
        yield source
        return
    with Path(source).open("rb") as file:
        while piece := file.read(_PIECE):
            yield piece
