"""Vector files that may be hostile: what they are, what they name, and the options of GDAL.

GDAL recognises formats by content, and some formats (OGR VRT, descriptions of web services, pipelines of
GDAL) name other files or addresses. So only the formats below are opened, a file with one of their extensions
only as that format, and GDAL makes no request meanwhile.
"""

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uavseg.access import current_policy
from uavseg.errors import AccessError, RegionError
from uavseg.inputs import MAX_TEXT, parse_json, read_bytes, read_start, regular_file
from uavseg.output.interrupts import deaf_call
from uavseg.plain_text import cause_of
from uavseg.raster.access.databases import check_database
from uavseg.regions.formats.gdal_state import gdal_options

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
    "GDAL_HTTP_PROXY": "none://offline",  # no such kind of proxy: every request fails before it is sent
    "CPL_VSIL_CURL_ALLOWED_FILENAME": "\n",  # no file of a network file system has this name
    "OGR_SQLITE_ALLOW_EXTERNAL_ACCESS": "NO",
    "LIBKML_RESOLVE_STYLE": "NO",
}

# A linked CRS: JSON as GDAL reads it has quotes of both kinds, and letters may be escaped.
_MAY_LINK = re.compile(rb"[\"']\s*(?:href|url)\s*[\"']|\\u00[4-7]", re.IGNORECASE)
_PIPELINE = b"gdal_streamed_alg"
_DESCRIPTION = re.compile(rb"<\s*(?:OGR\w*DataSource|GDAL_\w+|VRTDataset)|<!ENTITY", re.IGNORECASE)
_KML = re.compile(rb"<\s*(?:\w+:)?kml[\s>]", re.IGNORECASE)


def check_vector(source: str | os.PathLike[str] | bytes, name: str) -> None:
    """Check that a file of regions is of a known format, that of its extension, and complete by itself.

    Parameters
    ----------
    source : path or bytes
        A local file, or the content of one.
    name : str
        For messages.

    Raises
    ------
    RegionError
        If it is not a regular file, or of another format.
    AccessError
        If its content names other files or addresses.
    """
    if not isinstance(source, bytes):
        regular_file(source, RegionError)
    start = source[: 1 << 16] if isinstance(source, bytes) else read_start(source, 1 << 16, RegionError)
    kind = _kind(start)
    suffix = "" if isinstance(source, bytes) else Path(source).suffix.lower()
    expected = next((known for known, ends in _EXTENSIONS.items() if suffix in ends), kind)
    if _DESCRIPTION.search(start) or _PIPELINE in start:
        raise AccessError(
            f"{name} is a description that names other files or addresses, not a file of polygons"
        )
    if kind is None or kind != expected:
        raise RegionError(
            f"{name} cannot be read as regions: it is not {expected or 'one of ' + ', '.join(_EXTENSIONS)}"
        )
    if kind == "GeoJSON":
        _check_json(source, name)
    elif kind == "GeoPackage":
        check_database(source, name, RegionError)
    elif isinstance(source, bytes):
        return
    elif kind == "Shapefile":
        for beside in (Path(source).with_suffix(end) for end in _BESIDE):
            if os.path.lexists(beside):
                read_start(current_policy().check_file(source, beside), error=RegionError)


def vector_format(path: str | os.PathLike[str]) -> str | None:
    """The format of a file of vectors by its first bytes; None if it is none of those that are read."""
    return _kind(read_start(path, 1 << 16, RegionError))


@contextmanager
def reading_vectors() -> Iterator[None]:
    """GDAL without requests, and without code from databases, while vectors are read."""
    with gdal_options({} if current_policy().allow_network else _OPTIONS):
        yield


def _kind(start: bytes) -> str | None:
    """The format of a file by its first bytes."""
    for magic, kind in _MAGIC.items():
        if start.startswith(magic):
            return kind
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n\x1e")
    if text[:1] in (b"{", b"["):
        return "GeoJSON"
    return "KML" if text[:1] == b"<" and _KML.search(text) else None


def _check_json(source: str | os.PathLike[str] | bytes, name: str) -> None:
    """Refuse a linked coordinate reference system; most files are known not to have one without parsing."""
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
        with deaf_call():
            found = parse_json(content.decode())
    except ValueError as error:
        raise RegionError(f"{name} cannot be read as regions: {cause_of(error)}") from error
    link = _linked_crs(found)
    if link is not None:
        current_policy().check_address(name, f"{link[:100]!r} as its coordinate reference system")


def _may_link(path: Path) -> bool:
    """Whether a file may contain a link, read in pieces that overlap."""
    with path.open("rb") as file:
        before = b""
        while piece := file.read(1 << 24):
            if _MAY_LINK.search(before + piece):
                return True
            before = piece[-64:]
    return False


def _linked_crs(found: Any) -> str | None:
    """The address of a `crs` of the type link or url, anywhere in parsed JSON."""
    pending = [found]
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
