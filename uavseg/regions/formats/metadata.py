"""Metadata of regions in files: one JSON object under the key "uavseg".

A GeoPackage and a FlatGeobuf have it as an item of the metadata of their layer, GeoParquet in that of its
schema, GeoJSON as a foreign member (RFC 7946, 6.1) and KML as extended data of its document. A Shapefile and
a sequence of GeoJSON features have none.
"""

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uavseg.errors import RegionError
from uavseg.inputs import parse_json, read_start
from uavseg.regions.formats.parquet import import_pyarrow

METADATA_KEY = "uavseg"
_HEAD = 4 << 20  # bytes at the beginning of a text file, where its metadata is
_KML_DATA = re.compile(rf'<Data name="{METADATA_KEY}">\s*<value>([^<]*)</value>')


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
    import html

    head = read_start(path, _HEAD, RegionError).decode("utf-8", "replace").partition("<Placemark")[0]
    data = _KML_DATA.search(head)
    return parse_metadata(html.unescape(data[1])) if data else {}


def read_parquet_schema(path: str | os.PathLike[str]) -> Any:
    """Read the schema of a Parquet file with its metadata, and the number of its rows."""
    pyarrow = import_pyarrow()
    with pyarrow.parquet.ParquetFile(Path(path)) as file:
        return file.schema_arrow, file.metadata.num_rows
