"""Polygons for pictures: read from a file or from memory, projected, converted to matplotlib paths."""

import json
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import RegionError
from uavseg.output.staging import default_signals
from uavseg.plain_text import shown
from uavseg.plot.page.frame import Frame
from uavseg.raster.access.opening import file_exists
from uavseg.raster.geodesy.globe import transform_between
from uavseg.regions.formats.check_read import (
    check_attributes,
    check_count,
    check_feature_count,
    check_geometries,
)
from uavseg.regions.formats.parquet import import_pyarrow
from uavseg.regions.formats.read import read_regions, vector_errors
from uavseg.regions.formats.vector_files import check_vector, reading_vectors
from uavseg.regions.table import Regions

PolygonArray = NDArray[np.object_]

_AREAS = (shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON)
_LARGEST = 1e100  # the square of it is a number too
_DRAWN_COLUMNS = ("id", "confidence", "area_m2", "level", "range_low", "range_high", "class", "color")


@dataclass(frozen=True)
class PolygonTable:
    """Polygons (n,) with their CRS and columns (n,), without missing and empty ones."""

    polygons: PolygonArray
    crs: Any
    columns: dict[str, NDArray[Any]]

    @classmethod
    def of(cls, source: Any) -> "PolygonTable":
        """Read the polygons of a file, of `Regions` or of a GeoDataFrame; RegionError if unreadable."""
        is_file = isinstance(source, str | os.PathLike)
        table = _table_of_file(os.fspath(source)) if is_file else _table_of_memory(source)
        present = ~(shapely.is_missing(table.polygons) | shapely.is_empty(table.polygons))
        columns = {name: values[present] for name, values in table.columns.items()}
        return cls(table.polygons[present], table.crs, columns)

    def in_plot(self, frame: Frame) -> PolygonArray:
        """Return the polygons in plot coordinates; not reprojected if they or the raster have no CRS."""
        polygons, wkt = self.polygons, frame.geobox.wkt
        if self.crs is not None and wkt is not None:
            project = transform_between(self.crs, wkt)
            polygons = shapely.transform(polygons, lambda x, y: project(x, y), interleaved=False)
        drawn = np.asarray(shapely.transform(polygons, frame.plot_from_xy), dtype=object)
        if not (np.abs(shapely.get_coordinates(drawn)) < _LARGEST).all():
            raise RegionError("a polygon has no place in the picture: its coordinates are not finite")
        return drawn


def simplified(shapes: PolygonArray, tolerance: float) -> PolygonArray:
    """Simplify polygons; of collections, the polygons in them. The tolerance is in plot coordinates.

    What would not be a polygon afterwards stays as it is: an invalid polygon may become a ring.
    """
    flat = np.array([_polygonal(shape) for shape in shapes], dtype=object)
    simple = np.asarray(shapely.simplify(flat, tolerance), dtype=object)
    is_area = np.isin(shapely.get_type_id(simple), _AREAS) & ~shapely.is_empty(simple)
    return np.where(is_area, simple, flat)


def _polygonal(shape: Any) -> Any:
    if shapely.get_type_id(shape) in _AREAS:
        return shape
    parts = np.array([shape], dtype=object)
    while (shapely.get_type_id(parts) > shapely.GeometryType.POLYGON).any():
        parts = shapely.get_parts(parts)
    return shapely.multipolygons(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])


def polygon_paths(shapes: PolygonArray) -> list[Any]:
    """Make a matplotlib path of each polygon or multipolygon, with its holes."""
    from matplotlib.path import Path as DrawnPath

    parts, shape_of_part = shapely.get_parts(shapes, return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    codes = np.full(len(xy), DrawnPath.LINETO, np.uint8)
    first = np.flatnonzero(np.diff(ring, prepend=-1))
    codes[first] = DrawnPath.MOVETO
    codes[np.append(first[1:], len(xy)) - 1] = DrawnPath.CLOSEPOLY
    ends = np.searchsorted(shape_of_part[part_of_ring[ring]], np.arange(len(shapes) + 1))
    return [DrawnPath(xy[a:b], codes[a:b]) for a, b in pairwise(ends)]


def _table_of_memory(regions: Any) -> PolygonTable:
    if isinstance(regions, Regions):
        return PolygonTable(np.asarray(regions.polygons, dtype=object), regions.wkt, dict(regions.columns))
    if not (hasattr(regions, "columns") and hasattr(regions, "geometry")):
        raise RegionError(f"polygons to draw are a file, regions or a GeoDataFrame, not {shown(regions)}")
    names = [str(name) for name in regions.columns if name != regions.geometry.name]
    columns = {name: np.asarray(regions[name]) for name in names}
    return PolygonTable(np.asarray(regions.geometry.values, dtype=object), regions.crs, columns)


def _table_of_file(name: str) -> PolygonTable:
    """Read the polygons of a file in its CRS and without repair, which a picture does not need."""
    from pyogrio.raw import read

    suffix = Path(name).suffix.lower()
    if not file_exists(name):
        raise RegionError(f"there is no file {name} with regions; uavseg extract makes one")
    check_vector(name, name)
    if suffix in {".kml", ".kmz"}:
        return _table_of_memory(read_regions(name))
    if suffix in {".parquet", ".geoparquet"}:
        return _table_of_parquet(name)
    with vector_errors(name), reading_vectors():
        features = check_feature_count(name, name)
        with default_signals():
            metadata, _, geometry, columns = read(name)
        check_attributes(name, name, len(columns))
        polygons = None if geometry is None else shapely.from_wkb(geometry)
        if polygons is not None:
            check_count(len(polygons), features, name)
    if polygons is None:
        raise RegionError(f"{name} is a table without geometry; give a file of polygons")
    return PolygonTable(
        _complete(polygons, name), metadata["crs"], dict(zip(metadata["fields"], columns, strict=True))
    )


def _table_of_parquet(name: str) -> PolygonTable:
    parquet = import_pyarrow().parquet
    with vector_errors(name):
        table = parquet.read_table(name)
        if b"geo" not in (table.schema.metadata or {}):
            raise RegionError(f"{name} is not GeoParquet; give a file that uavseg extract wrote")
        metadata = json.loads(table.schema.metadata[b"geo"])
        column = metadata["primary_column"]
        crs = metadata["columns"][column].get("crs", "OGC:CRS84")
        return PolygonTable(
            _complete(shapely.from_wkb(table[column].to_numpy()), name),
            crs if isinstance(crs, str | None) else json.dumps(crs),
            {key: table[key].to_numpy() for key in _DRAWN_COLUMNS if key in table.column_names},
        )


def _complete(polygons: PolygonArray, name: str) -> PolygonArray:
    """Refuse polygons of which some could not be read; a file without regions is drawn."""
    if len(polygons):
        check_geometries(polygons, name)
    return polygons
