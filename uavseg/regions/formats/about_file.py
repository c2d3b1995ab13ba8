"""What a file of regions holds: its format, CRS, extent and columns, and how the regions were made."""

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavseg.errors import RegionError
from uavseg.raster.access.opening import file_exists
from uavseg.regions.formats import metadata
from uavseg.regions.formats.check_read import check_feature_count
from uavseg.regions.formats.read import KML_FIELDS, vector_errors
from uavseg.regions.formats.style_files import STYLE_TABLE
from uavseg.regions.formats.vector_files import (
    check_vector,
    reading_vectors,
    vector_format,
)

KML_NAMES = KML_FIELDS | {"id2"}  # that GDAL gives each KML file


@dataclass(frozen=True, slots=True)
class RegionFile:
    """What a file of regions holds.

    Parameters
    ----------
    path : str
    format : str
        Such as "GeoPackage".
    layer : str or None
        The first layer.
    others : int
        Number of other layers.
    geometry : str
        Type of its geometries.
    regions : int
    crs : str or None
        Name of the CRS.
    bounds : (float, float, float, float) or None
        left, bottom, right, top in coordinates of the CRS; None if the file is empty or they are not finite.
    columns : tuple of str
    metadata : dict
        What the regions were made from and how; empty where the file does not say.
    """

    path: str
    format: str
    layer: str | None
    others: int
    geometry: str
    regions: int
    crs: str | None
    bounds: tuple[float, float, float, float] | None
    columns: tuple[str, ...]
    metadata: dict[str, Any]

    def as_dict(self) -> dict[str, Any]:
        """All fields as plain values for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}


def is_region_file(path: str | os.PathLike[str]) -> bool:
    """Whether a local file is of a format of regions, by its first bytes; a GeoPackage of images is not."""
    if not file_exists(path) or not Path(path).is_file():
        return False
    found = vector_format(path)
    return found is not None and not (found == "GeoPackage" and _holds_tiles(path))


def about_file(path: str | os.PathLike[str]) -> RegionFile:
    """What a file of regions holds; its regions themselves are not read.

    Raises
    ------
    RegionError
        If it cannot be read as regions.
    AccessError
        If its content names other files or addresses.
    """
    name = os.fspath(path)
    check_vector(path, name)
    kind = vector_format(path) or "unknown"
    with vector_errors(name):
        if kind == "GeoParquet":
            return _about_parquet(path)
        with reading_vectors():
            return _about_layer(path, name, kind)


def _about_layer(path: str | os.PathLike[str], name: str, kind: str) -> RegionFile:
    import pyogrio

    layers = [layer for layer in map(str, pyogrio.list_layers(path)[:, 0]) if layer != STYLE_TABLE]
    if not layers:
        raise RegionError(f"{name} holds no layer of regions")
    check_feature_count(path, name, layers[0])
    found = pyogrio.read_info(path, layer=layers[0], force_feature_count=True, force_total_bounds=True)
    about = {
        "GeoJSON": metadata.read_json_metadata,
        "KML": metadata.read_kml_metadata,
    }.get(kind)
    items = found.get("layer_metadata") or {}
    return RegionFile(
        name,
        kind,
        layers[0],
        len(layers) - 1,
        str(found["geometry_type"]),
        int(found["features"]),
        _crs_name(found["crs"]),
        _bounds(found["total_bounds"]),
        tuple(name for name in map(str, found["fields"]) if kind != "KML" or name not in KML_NAMES),
        metadata.parse_metadata(items.get(metadata.METADATA_KEY)) if about is None else about(path),
    )


def _about_parquet(path: str | os.PathLike[str]) -> RegionFile:
    schema, rows = metadata.read_parquet_schema(path)
    items = {key.decode(): value.decode("utf-8", "replace") for key, value in (schema.metadata or {}).items()}
    geo = metadata.parse_metadata(items.get("geo"))
    primary = str(geo.get("primary_column", "geometry"))
    column = geo.get("columns", {}).get(primary, {})
    crs = column.get("crs", "OGC:CRS84")  # the default of GeoParquet
    return RegionFile(
        os.fspath(path),
        "GeoParquet",
        None,
        0,
        " or ".join(column.get("geometry_types", [])) or "unknown",
        int(rows),
        _crs_name(crs),
        _bounds(column.get("bbox")),
        tuple(field for field in schema.names if field != primary),
        metadata.parse_metadata(items.get(metadata.METADATA_KEY)),
    )


def _crs_name(crs: Any) -> str | None:
    """The name of a CRS from a code, WKT or PROJJSON."""
    import pyproj

    return None if not crs else str(pyproj.CRS.from_user_input(crs).name)


def _bounds(found: Any) -> tuple[float, float, float, float] | None:
    if found is None or len(found) != 4:
        return None
    left, bottom, right, top = map(float, found)
    is_extent = left <= right and all(map(math.isfinite, (left, bottom, right, top)))
    return (left, bottom, right, top) if is_extent else None


def _holds_tiles(path: str | os.PathLike[str]) -> bool:
    """Whether a GeoPackage holds images and no features."""
    import sqlite3

    from uavseg.raster.access.databases import check_database, open_database

    try:
        check_database(path, os.fspath(path), RegionError)
        with open_database(path) as base:
            base.text_factory = bytes  # text of a damaged file may not be UTF-8
            kinds = {kind for (kind,) in base.execute("SELECT data_type FROM gpkg_contents")}
    except (RegionError, sqlite3.Error, UnicodeError):  # the message of an error may quote what is no text
        return True  # MBTiles and others
    return b"features" not in kinds
