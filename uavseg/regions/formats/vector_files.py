"""Safe opening of vector files of unknown origin: format checks, refusal of links, options of GDAL.

GDAL recognises formats by content, and some formats (OGR VRT, descriptions of web services, pipelines of
GDAL) name other files or addresses. So only the formats below are opened, a file with one of their extensions
only as that format, and GDAL makes no request meanwhile.
"""

import json
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uavseg.access import current_policy
from uavseg.errors import AccessError, RegionError
from uavseg.inputs import MAX_TEXT, parse_json, read_bytes, read_start, regular_file
from uavseg.output.staging import default_signals
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import OFFLINE_OPTIONS
from uavseg.raster.access.untrusted import check_database

_EXTENSIONS = {
    "GeoJSON": (".geojson", ".json", ".geojsonl", ".geojsons", ".ndjson", ".topojson"),
    "GeoPackage": (".gpkg",),
    "FlatGeobuf": (".fgb",),
    "GeoParquet": (".parquet", ".geoparquet"),
    "Shapefile": (".shp",),
    "KML": (".kml",),
    "KMZ": (".kmz",),
}
_MAGIC = {
    b"SQLite format 3\0": "GeoPackage",
    b"fgb": "FlatGeobuf",
    b"PAR1": "GeoParquet",
    b"\0\0\x27\x0a": "Shapefile",
    b"PK\x03\x04": "KMZ",
}
_BESIDE = (".shx", ".dbf", ".prj", ".cpg", ".cst", ".qix", ".sbn", ".qpj")  # of a Shapefile
_OPTIONS = {
    **OFFLINE_OPTIONS,
    "OGR_SQLITE_ALLOW_EXTERNAL_ACCESS": "NO",
    "LIBKML_RESOLVE_STYLE": "NO",
}

# A linked CRS: JSON as GDAL reads it has single or double quotes, and letters may be escaped.
_MAY_LINK = re.compile(rb"[\"']\s*(?:href|url)\s*[\"']|\\u00[4-7]", re.IGNORECASE)
_PIPELINE = b"gdal_streamed_alg"
_DESCRIPTION = re.compile(rb"<\s*(?:OGR\w*DataSource|GDAL_\w+|VRTDataset)|<!ENTITY", re.IGNORECASE)
_KML = re.compile(rb"<\s*(?:\w+:)?kml[\s>]", re.IGNORECASE)


def check_vector(source: str | os.PathLike[str] | bytes, name: str) -> None:
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


def vector_format(path: str | os.PathLike[str]) -> str | None:
    """Return the format of a vector file by its first bytes; None for an unsupported one."""
    return _format_of(read_start(path, 1 << 16, RegionError))


@contextmanager
def reading_vectors() -> Iterator[None]:
    """Enter a context in which GDAL reads vectors without requests or code from databases."""
    with gdal_options({} if current_policy().allow_network else _OPTIONS):
        yield


def _format_of(start: bytes) -> str | None:
    for magic, file_format in _MAGIC.items():
        if start.startswith(magic):
            return file_format
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n\x1e")
    if text[:1] in (b"{", b"["):
        return "GeoJSON"
    return "KML" if text[:1] == b"<" and _KML.search(text) else None


def _check_json(source: str | os.PathLike[str] | bytes, name: str) -> None:
    """Refuse a linked coordinate reference system; most files need no parsing to rule one out."""
    if current_policy().allow_network:
        return
    if isinstance(source, bytes):
        content = source
    elif not _may_link(Path(source)):
        return
    else:
        content = read_bytes(source, RegionError, MAX_TEXT)
    if not _MAY_LINK.search(content):
        return
    try:
        with default_signals():
            parsed = parse_json(content.decode())
    except ValueError as error:
        raise RegionError(f"{name} cannot be read as regions: {cause_of(error)}") from error
    link = _linked_crs(parsed)
    if link is not None:
        current_policy().check_address(name, f"{link[:100]!r} as its coordinate reference system")


def _may_link(path: Path) -> bool:
    """Check whether a file may contain a link; it is read in pieces that overlap."""
    with path.open("rb") as file:
        before = b""
        while piece := file.read(1 << 24):
            if _MAY_LINK.search(before + piece):
                return True
            before = piece[-64:]
    return False


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


_thread = threading.local()


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
