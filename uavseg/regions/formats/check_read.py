"""Verify that all regions of a file were read: GDAL skips what it cannot read, mostly without an error.

A lost region may be the one that a drone has to keep away from.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import RegionError
from uavseg.inputs import MAX_TEXT, parse_json, read_bytes
from uavseg.output.staging import default_signals
from uavseg.plain_text import cause_of

_PIECE = 1 << 24  # bytes of a text that are read at once
_GEOMETRY = b'"geometry"'


def check_feature_count(source: str | os.PathLike[str] | bytes, name: str, layer: str | None = None) -> int:
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


def check_geometries(geometries: NDArray[np.object_], name: str) -> None:
    """Refuse features without a geometry (None), or with an empty one, with a RegionError about `name`."""
    missing = np.flatnonzero(shapely.is_missing(geometries) | shapely.is_empty(geometries))
    if len(missing) == len(geometries):
        raise RegionError(f"{name} holds no regions")
    if len(missing):
        raise RegionError(
            f"{name} has {len(missing):,} of {len(geometries):,} features without a geometry, or with one "
            f"that cannot be read (the first is feature {missing[0] + 1}); delete or repair them"
        )


def check_attributes(source: str | os.PathLike[str] | bytes, name: str, count: int) -> None:
    """Refuse a Shapefile whose table of attributes was not read, with a RegionError.

    `name` is for messages, `count` is how many attributes were read.
    """
    if count == 0 and not isinstance(source, bytes):
        table = Path(source).with_suffix(".dbf")
        if Path(source).suffix.lower() == ".shp" and os.path.lexists(table):
            raise RegionError(
                f"{name} cannot be read as regions: {table.name}, the table of its attributes, is damaged"
            )


def _check_json_count(
    source: str | os.PathLike[str] | bytes, name: str, features: int, is_sequence: bool
) -> None:
    """Refuse JSON with features that GDAL does not count; `features` are those of one layer.

    The text is parsed only if the number of members called geometry differs.
    """
    import pyogrio

    if any(b"\0" in piece for piece in _pieces(source)):  # GDAL goes on after it somewhere
        raise RegionError(f"{name} cannot be read as regions: it has null bytes, which JSON has not")
    present = _count_records(source) if is_sequence else features
    if present == features == _count_geometry_members(source):
        return
    layers = range(len(pyogrio.list_layers(source)))  # those of bytes have another name each time
    counted = sum(int(pyogrio.read_info(source, layer=layer)["features"]) for layer in layers)
    if present <= counted:
        content = source if isinstance(source, bytes) else read_bytes(source, RegionError, MAX_TEXT)
        texts = content.split(_separator(content)) if is_sequence else [content]
        try:
            with default_signals():
                present = sum(
                    _features_of(parse_json(text.decode("utf-8-sig"))) for text in texts if text.strip()
                )
        except ValueError as error:
            raise RegionError(f"{name} cannot be read as regions: {cause_of(error)}") from error
    if counted < present:
        raise RegionError(f"{name} has {present:,} features, of which {counted:,} can be read; repair it")


def _count_records(source: str | os.PathLike[str] | bytes) -> int:
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


def _count_geometry_members(source: str | os.PathLike[str] | bytes) -> int:
    count, before = 0, b""
    for piece in _pieces(source):
        count += (before + piece).count(_GEOMETRY)
        before = (before + piece)[1 - len(_GEOMETRY) :]
    return count


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


def _pieces(source: str | os.PathLike[str] | bytes) -> Iterator[bytes]:
    """Read a file in pieces; bytes are one."""
    if isinstance(source, bytes):
        yield source
        return
    with Path(source).open("rb") as file:
        while piece := file.read(_PIECE):
            yield piece
