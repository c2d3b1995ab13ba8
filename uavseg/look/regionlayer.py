"""Regions in a picture: translucent, coloured unlike their neighbours, the largest with their ids."""

import os
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import RegionError
from uavseg.look.frame import Frame
from uavseg.regions.load import load
from uavseg.regions.table import Regions

COLORS = ("#ff8c1a", "#19c3f0", "#f032e6", "#b5e61d", "#ffe119", "#5b7cff", "#2fd05f", "#ff9ec4")
MOST_LABELS = 40
SMALLEST_LABELLED = 6.0  # radius in points of the widest place inside a region

Polygons = NDArray[np.object_]
_Found = tuple[Polygons, Any, NDArray[Any] | None, NDArray[Any] | None]


@dataclass(frozen=True)
class RegionLayer:
    """Polygons on the sheet, with their ids.

    Parameters
    ----------
    ids : (n,) array
    polygons : (n,) object array of shapely geometries
    area_m2 : float or None
        Of all of them on the ground, if they say so.
    """

    ids: NDArray[Any]
    polygons: Polygons
    area_m2: float | None

    @classmethod
    def of(cls, regions: Any, frame: Frame) -> "RegionLayer":
        """Regions, or those of a GeoDataFrame or a file, brought to the sheet.

        Raises
        ------
        RegionError
            If the file cannot be read.
        """
        polygons, crs, ids, areas = _found(regions)
        there = ~(shapely.is_missing(polygons) | shapely.is_empty(polygons))
        if ids is None or any(own is None or own != own for own in ids):
            ids = np.arange(1, len(polygons) + 1)
        sheet = shapely.transform(_to_raster(polygons[there], crs, frame), frame.sheet_from_xy)
        return cls(ids[there], sheet, None if areas is None else float(np.nansum(areas)))

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        from matplotlib.collections import PathCollection

        seen = np.sqrt(shapely.area(self.polygons)) > 0.3 * unit
        if not seen.any():
            return
        shapes = shapely.orient_polygons(shapely.simplify(self.polygons[seen], 0.2 * unit))
        colors = np.array(COLORS)[distinct(shapes, 9 * unit, len(COLORS))]
        paths = _paths(shapes)
        for color in COLORS:
            group = [path for path, own in zip(paths, colors, strict=True) if own == color]
            ax.add_collection(PathCollection(group, facecolor=color, alpha=0.3, lw=0, zorder=3))
            ax.add_collection(PathCollection(group, facecolor="none", edgecolor=color, lw=1.1, zorder=4))
        _label(ax, self.ids[seen], shapes, unit)


def distinct(shapes: Polygons, reach: float, count: int) -> NDArray[np.intp]:
    """A number below `count` for each shape, other than its neighbours' where that can be had.

    Parameters
    ----------
    shapes : (n,) object array of shapely geometries
    reach : float
        How near the rectangle around a neighbour is.
    """
    left, bottom, right, top = shapely.bounds(shapes).T
    around = shapely.box(left - reach, bottom - reach, right + reach, top + reach)
    first, second = shapely.STRtree(shapes).query(around)
    earlier = second < first
    starts = np.searchsorted(first[earlier], np.arange(len(shapes) + 1))
    others = second[earlier]
    chosen = np.zeros(len(shapes), np.intp)
    for n in range(len(shapes)):
        taken = np.bincount(chosen[others[starts[n] : starts[n + 1]]], minlength=count)
        taken[: n % count] += 1 if not taken.any() else 0  # shapes without neighbours take turns
        chosen[n] = int(taken.argmin())
    return chosen


def _paths(shapes: Polygons) -> list[Any]:
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


def _label(ax: Any, ids: NDArray[Any], shapes: Polygons, unit: float) -> None:
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.2, foreground="#111111")]
    for n in np.argsort(-shapely.area(shapes), kind="stable")[:MOST_LABELS]:
        x, y, radius = _widest(shapes[n], unit)
        if radius < SMALLEST_LABELLED * unit and len(shapes) > 12:
            continue
        size = 7.0 if radius < 14 * unit else 9.0
        text = ax.text(x, y, str(ids[n]), ha="center", va="center", size=size, color="white", weight="bold")
        text.set(path_effects=halo, zorder=7, clip_on=True)


def _widest(shape: Any, unit: float) -> tuple[float, float, float]:
    """The point inside a region that is farthest from its edge, and how far that is."""
    part = max(shapely.get_parts(shape), key=shapely.area)
    circle = shapely.maximum_inscribed_circle(part, tolerance=unit)
    x, y = shapely.get_coordinates(circle)[0]
    return float(x), float(y), float(shapely.length(circle))


def _to_raster(polygons: Polygons, crs: Any, frame: Frame) -> Polygons:
    """Polygons in the raster's CRS; as they are where either has none."""
    import pyproj

    wkt = frame.geobox.wkt
    if crs is None or wkt is None:
        return polygons
    transformer = pyproj.Transformer.from_crs(crs, wkt, always_xy=True)
    moved = shapely.transform(polygons, lambda x, y: transformer.transform(x, y), interleaved=False)
    return np.asarray(moved, dtype=object)


def _found(regions: Any) -> _Found:
    """Polygons, CRS, ids and areas of a file, of Regions or of a GeoDataFrame."""
    if isinstance(regions, str | os.PathLike):
        return _of_file(os.fspath(regions))
    if isinstance(regions, Regions):
        columns = regions.columns
        return np.asarray(regions.polygons), regions.wkt, columns.get("id"), columns.get("area_m2")
    ids, areas = (np.asarray(regions[name]) if name in regions else None for name in ("id", "area_m2"))
    return np.asarray(regions.geometry.values, dtype=object), regions.crs, ids, areas


def _of_file(name: str) -> _Found:
    """Polygons as they lie in a file, in its own CRS: for a picture nothing needs mending."""
    from pyogrio.errors import DataSourceError
    from pyogrio.raw import read

    suffix = Path(name).suffix.lower()
    if not Path(name).exists():
        raise RegionError(f"there is no file {name} with regions; uavseg extract makes one")
    if suffix in {".kml", ".kmz"}:
        return _found(load(name))
    if suffix in {".parquet", ".geoparquet"}:
        return _of_parquet(name)
    try:
        about, _, geometry, columns = read(name)
    except (DataSourceError, ValueError) as error:
        raise RegionError(f"{name} has no regions that can be read ({error})") from error
    if geometry is None:
        raise RegionError(f"{name} is a table without geometry; give a file of polygons")
    found = dict(zip(about["fields"], columns, strict=True))
    return shapely.from_wkb(geometry), about["crs"], found.get("id"), found.get("area_m2")


def _of_parquet(name: str) -> _Found:
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
    ids, areas = (table[key].to_numpy() if key in table.column_names else None for key in ("id", "area_m2"))
    return (
        shapely.from_wkb(table[column].to_numpy()),
        crs if isinstance(crs, str | None) else json.dumps(crs),
        ids,
        areas,
    )
