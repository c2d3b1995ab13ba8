"""Polygons for pictures: from a file or from memory to the sheet, and to what matplotlib draws."""

import os
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import RegionError
from uavseg.plot.frame import Frame
from uavseg.raster.geodesy.globe import transform_between
from uavseg.regions.formats.read import read_regions
from uavseg.regions.table import Regions

Polygons = NDArray[np.object_]

DRAWN = ("id", "area_m2", "level", "range_low", "range_high")  # the attributes that a picture shows


@dataclass(frozen=True)
class Shapes:
    """Polygons with their attributes; none of them is missing or empty.

    Parameters
    ----------
    polygons : (n,) object array of shapely geometries
    crs : str, CRS or None
    columns : dict of (n,) arrays
    """

    polygons: Polygons
    crs: Any
    columns: dict[str, NDArray[Any]]

    @classmethod
    def of(cls, source: Any) -> "Shapes":
        """Polygons of a file, of Regions or of a GeoDataFrame.

        Raises
        ------
        RegionError
            If the file cannot be read.
        """
        found = _of_file(os.fspath(source)) if isinstance(source, str | os.PathLike) else _of_memory(source)
        there = ~(shapely.is_missing(found.polygons) | shapely.is_empty(found.polygons))
        columns = {name: values[there] for name, values in found.columns.items()}
        return cls(found.polygons[there], found.crs, columns)

    def on_sheet(self, frame: Frame) -> Polygons:
        """The polygons on a sheet; as they are where they or the raster have no CRS."""
        polygons, wkt = self.polygons, frame.geobox.wkt
        if self.crs is not None and wkt is not None:
            project = transform_between(self.crs, wkt)
            polygons = shapely.transform(polygons, lambda x, y: project(x, y), interleaved=False)
        return np.asarray(shapely.transform(polygons, frame.sheet_from_xy), dtype=object)


def outlines(shapes: Polygons) -> list[Any]:
    """A matplotlib path of each polygon with its holes, or of each group of polygons."""
    from matplotlib.path import Path as Outline

    parts, shape_of_part = shapely.get_parts(shapes, return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    codes = np.full(len(xy), Outline.LINETO, np.uint8)
    first = np.flatnonzero(np.diff(ring, prepend=-1))
    codes[first] = Outline.MOVETO
    codes[np.append(first[1:], len(xy)) - 1] = Outline.CLOSEPOLY
    ends = np.searchsorted(shape_of_part[part_of_ring[ring]], np.arange(len(shapes) + 1))
    return [Outline(xy[a:b], codes[a:b]) for a, b in pairwise(ends)]


def _of_memory(regions: Any) -> Shapes:
    if isinstance(regions, Regions):
        return Shapes(np.asarray(regions.polygons, dtype=object), regions.wkt, dict(regions.columns))
    names = [str(name) for name in regions.columns if name != regions.geometry.name]
    columns = {name: np.asarray(regions[name]) for name in names}
    return Shapes(np.asarray(regions.geometry.values, dtype=object), regions.crs, columns)


def _of_file(name: str) -> Shapes:
    """Polygons as they lie in a file, in its own CRS: for a picture nothing needs mending."""
    from pyogrio.errors import DataSourceError
    from pyogrio.raw import read

    suffix = Path(name).suffix.lower()
    if not Path(name).exists():
        raise RegionError(f"there is no file {name} with regions; uavseg extract makes one")
    if suffix in {".kml", ".kmz"}:
        return _of_memory(read_regions(name))
    if suffix in {".parquet", ".geoparquet"}:
        return _of_parquet(name)
    try:
        about, _, geometry, columns = read(name)
    except (DataSourceError, ValueError) as error:
        raise RegionError(f"{name} has no regions that can be read ({error})") from error
    if geometry is None:
        raise RegionError(f"{name} is a table without geometry; give a file of polygons")
    return Shapes(shapely.from_wkb(geometry), about["crs"], dict(zip(about["fields"], columns, strict=True)))


def _of_parquet(name: str) -> Shapes:
    import json

    from pyarrow import ArrowInvalid
    from pyarrow.parquet import read_table

    try:
        table = read_table(name)
        about = json.loads(table.schema.metadata[b"geo"])
    except (ArrowInvalid, KeyError, TypeError) as error:
        raise RegionError(f"{name} is not GeoParquet; give a file that uavseg extract wrote") from error
    column = about["primary_column"]
    crs = about["columns"][column].get("crs", "OGC:CRS84")
    return Shapes(
        shapely.from_wkb(table[column].to_numpy()),
        crs if isinstance(crs, str | None) else json.dumps(crs),
        {key: table[key].to_numpy() for key in DRAWN if key in table.column_names},
    )
