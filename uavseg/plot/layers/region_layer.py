"""Layers of polygons, read and projected: regions in colour by class or neighbours, levels in grey."""

import json
import os
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.collections import PathCollection
from matplotlib.path import Path as DrawnPath
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from uavseg.arrays import Bools, Floats, Integers, Objects
from uavseg.dataclass import dataclass
from uavseg.errors import RegionError
from uavseg.output.staging import default_signals
from uavseg.plain_text import shown
from uavseg.plot.page.page import Frame, area_text
from uavseg.raster.access.opening import file_exists
from uavseg.raster.geodesy.globe import transform_between
from uavseg.regions.formats import vector_files
from uavseg.regions.formats.read import read_regions, vector_errors
from uavseg.regions.table import Regions

Columns = dict[str, NDArray[Any]]

PALETTE = ("#ff8c1a", "#19c3f0", "#f032e6", "#b5e61d", "#ffe119", "#5b7cff", "#2fd05f", "#ff9ec4")
MAX_CLASSES = 24  # in a legend
_MAX_LABELS = 40
_MIN_LABEL_RADIUS = 6.0  # radius in points of the largest circle inside a region
_MIN_SIDE = 0.3  # points: smaller regions are not drawn
_TOLERANCE = 0.2  # points: by which outlines are simplified
_LARGEST_LEVEL = 2.0**53
_HEX = re.compile(r"#[0-9a-fA-F]{6}\Z")

_AREAS = (shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON)
_LARGEST = 1e100  # the square of it is a number too
_DRAWN_COLUMNS = ("id", "confidence", "area_m2", "level", "range_low", "range_high", "class", "color")


@dataclass(frozen=True)
class PolygonTable:
    """Polygons (n,) with their CRS and columns (n,), without missing and empty ones."""

    polygons: Objects
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

    def in_plot(self, frame: Frame) -> Objects:
        """Return the polygons in plot coordinates; not reprojected if they or the raster have no CRS."""
        polygons, wkt = self.polygons, frame.geobox.wkt
        if self.crs is not None and wkt is not None:
            project = transform_between(self.crs, wkt)
            polygons = shapely.transform(polygons, lambda x, y: project(x, y), interleaved=False)
        drawn = np.asarray(shapely.transform(polygons, frame.plot_from_xy), dtype=object)
        if not (np.abs(shapely.get_coordinates(drawn)) < _LARGEST).all():
            raise RegionError("a polygon has no place in the picture: its coordinates are not finite")
        return drawn


def simplified(shapes: Objects, tolerance: float) -> Objects:
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


def polygon_paths(shapes: Objects) -> list[Any]:
    """Make a matplotlib path of each polygon or multipolygon, with its holes."""
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
    vector_files.check_vector(name, name)
    if suffix in {".kml", ".kmz"}:
        return _table_of_memory(read_regions(name))
    if suffix in {".parquet", ".geoparquet"}:
        return _table_of_parquet(name)
    with vector_errors(name), vector_files.reading_vectors():
        features = vector_files.check_feature_count(name, name)
        with default_signals():
            metadata, _, geometry, columns = read(name)
        vector_files.check_attributes(name, name, len(columns))
        polygons = None if geometry is None else shapely.from_wkb(geometry)
        if polygons is not None:
            vector_files.check_count(len(polygons), features, name)
    if polygons is None:
        raise RegionError(f"{name} is a table without geometry; give a file of polygons")
    named = dict(zip(metadata["fields"], columns, strict=True))
    return PolygonTable(_complete(polygons, name), metadata["crs"], named)


def _table_of_parquet(name: str) -> PolygonTable:
    parquet = vector_files.import_pyarrow().parquet
    with vector_errors(name):
        table = parquet.read_table(name)
        if b"geo" not in (table.schema.metadata or {}):
            raise RegionError(f"{name} is not GeoParquet; give a file that uavseg extract wrote")
        metadata = json.loads(table.schema.metadata[b"geo"])
        column = metadata["primary_column"]
        crs = metadata["columns"][column].get("crs", "OGC:CRS84")
        polygons = _complete(shapely.from_wkb(table[column].to_numpy()), name)
        drawn = {key: table[key].to_numpy() for key in _DRAWN_COLUMNS if key in table.column_names}
        return PolygonTable(polygons, crs if isinstance(crs, str | None) else json.dumps(crs), drawn)


def _complete(polygons: Objects, name: str) -> Objects:
    """Refuse polygons of which some could not be read; a file without regions is drawn."""
    if len(polygons):
        vector_files.check_geometries(polygons, name)
    return polygons


class Style(NamedTuple):
    """Opacity of the fill, line style, and text in the legend, where empty for none."""

    alpha: float
    line: str
    legend: str = ""


PLAIN = Style(0.3, "solid")
_MIN_CONFIDENCES = (0.8, 0.5)
_STYLES = (  # the higher the confidence, the stronger the fill and the more solid the line
    Style(0.4, "solid", "confidence of 0.8 and more"),
    Style(0.22, "dashed", "confidence of 0.5 to 0.8"),
    Style(0.08, "dotted", "confidence below 0.5"),
)


@dataclass(frozen=True)
class RegionLayer:
    """Translucent regions in plot coordinates, ids on the largest; styled by class, color and confidence."""

    ids: NDArray[Any]
    polygons: Objects
    area_m2: float | None  # sum of their column, if they have one
    columns: Columns

    @classmethod
    def of(cls, regions: Any, frame: Frame) -> "RegionLayer":
        """Read regions from a file, `Regions` or a GeoDataFrame; raises RegionError if it cannot be read."""
        table = PolygonTable.of(regions)
        ids, areas = table.columns.get("id"), table.columns.get("area_m2")
        if ids is None or not all(one is not None and np.ndim(one) == 0 and one == one for one in ids):
            ids = np.arange(1, len(table.polygons) + 1)
        has_areas = areas is not None and areas.dtype.kind in "iuf"
        total = float(np.nansum(areas)) if has_areas else None  # type: ignore[arg-type]
        return cls(ids, table.in_plot(frame), total, table.columns)

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the number of regions and their total area."""
        count = f"{len(self.ids)} region{'s' if len(self.ids) != 1 else ''}"
        return [count, area_text(self.area_m2)] if has_crs and self.area_m2 is not None else [count]

    def draw(self, ax: Any, point: float) -> None:
        visible = np.sqrt(shapely.area(self.polygons)) > _MIN_SIDE * point
        if not visible.any():
            return
        shapes = shapely.orient_polygons(simplified(self.polygons[visible], _TOLERANCE * point))
        classes = class_colors(self.columns)
        if classes is None:
            palette: tuple[str, ...] = PALETTE
            colors = np.array(PALETTE)[assign_colors(shapes, 9 * point, len(PALETTE))]
        else:
            colors, legend = classes[0][visible], classes[1]
            palette = tuple(dict.fromkeys(legend.values()))
            for name, color in legend.items():
                ax.scatter([], [], s=40, marker="s", color=color, label=name.replace("$", r"\$"))
        paths = polygon_paths(shapes)
        for style, has_style in styles_by_confidence(self.columns, len(visible)):
            if style.legend:
                ax.plot([], [], color="#555555", lw=1.4, ls=style.line, label=style.legend)
            for color in palette:
                group = [paths[k] for k in np.flatnonzero((colors == color) & has_style[visible])]
                ax.add_collection(PathCollection(group, facecolor=color, alpha=style.alpha, lw=0, zorder=3))
                outlines = PathCollection(group, facecolor="none", edgecolor=color, lw=1.1, zorder=4)
                outlines.set_linestyle(style.line)
                ax.add_collection(outlines)
        _draw_labels(ax, self.ids[visible], shapes, point)


def class_colors(columns: Columns, palette: Sequence[str] = PALETTE) -> tuple[Any, dict[str, str]] | None:
    """Return a colour for each region, and those of the legend by class; None with too many classes or none.

    The columns, (n,), have the names of classes in `class`, and colours such as "#ff8c1a" in `color` where
    they have some. The palette is for classes without a colour.
    """
    if "class" not in columns:
        return None
    names = [_text(value) for value in columns["class"]]
    distinct = list(dict.fromkeys(sorted(names)))
    if not 1 <= len(distinct) <= MAX_CLASSES:
        return None
    chosen: dict[str, str] = {}
    for name, value in zip(names, columns.get("color", ()), strict=False):
        if _HEX.match(_text(value)):
            chosen.setdefault(name, _text(value))
    free = [color for color in palette if color not in chosen.values()] or list(palette)
    legend = {name: chosen.get(name) or free[n % len(free)] for n, name in enumerate(distinct)}
    return np.array([legend[name] for name in names], object), legend


def _text(value: Any) -> str:
    return "" if value is None or value != value else str(value)


def styles_by_confidence(columns: Columns, count: int) -> list[tuple[Style, Bools]]:
    """Return styles, each with a mask of the `count` regions that have it; plain without a confidence."""
    values = columns.get("confidence", np.empty(0))
    if values.dtype.kind not in "iuf" or not np.isfinite(values).any():
        return [(PLAIN, np.ones(count, bool))]
    known = np.isfinite(values)
    rank = np.sum([values < minimum for minimum in _MIN_CONFIDENCES], axis=0)
    styles = [*((style, known & (rank == k)) for k, style in enumerate(_STYLES)), (PLAIN, ~known)]
    return [(style, mask) for style, mask in styles if mask.any()]


def assign_colors(shapes: Objects, reach: float, count: int) -> NDArray[np.intp]:
    """Colour greedily: indices below `count`, unlike those of boxes within `reach` if possible."""
    left, bottom, right, top = shapely.bounds(shapes).T
    around = shapely.box(left - reach, bottom - reach, right + reach, top + reach)
    first, second = shapely.STRtree(shapes).query(around)
    earlier = second < first
    starts = np.searchsorted(first[earlier], np.arange(len(shapes) + 1))
    neighbours = second[earlier]
    chosen = np.zeros(len(shapes), np.intp)
    for n in range(len(shapes)):
        taken = np.bincount(chosen[neighbours[starts[n] : starts[n + 1]]], minlength=count)
        taken[: n % count] += 1 if not taken.any() else 0  # shapes without neighbours take turns
        chosen[n] = int(taken.argmin())
    return chosen


def _draw_labels(ax: Any, ids: NDArray[Any], shapes: Objects, point: float) -> None:
    halo = [withStroke(linewidth=2.2, foreground="#111111")]
    for n in np.argsort(-shapely.area(shapes), kind="stable")[:_MAX_LABELS]:
        part = max(shapely.get_parts(shapes[n]), key=shapely.area)
        circle = shapely.maximum_inscribed_circle(part, tolerance=point)
        (x, y), radius = shapely.get_coordinates(circle)[0].tolist(), float(shapely.length(circle))
        if radius < _MIN_LABEL_RADIUS * point and len(shapes) > 12:
            continue
        size = 7.0 if radius < 14 * point else 9.0
        name = shown(ids[n], False)
        text = ax.text(x, y, name, ha="center", va="center", size=size, color="white", weight="bold")
        text.set(path_effects=halo, zorder=7, clip_on=True)


@dataclass(frozen=True)
class LevelsLayer:
    """Segments in plot coordinates, with the grey of their levels."""

    polygons: Objects
    levels: Integers  # the darkest has the smallest number
    greys: Floats  # 0 black to 1 white

    @classmethod
    def of(cls, source: Any, frame: Frame) -> "LevelsLayer":
        """Read the segments of a file or a GeoDataFrame with a column `level`, as `uavseg levels` writes."""
        table = PolygonTable.of(source)
        if "level" not in table.columns:
            raise RegionError("the segments to draw in grey have no column level; uavseg levels makes them")
        levels = _numbers("level", table.columns).astype(np.int64)
        return cls(table.in_plot(frame), levels, _greys(levels, table.columns))

    def title_parts(self, has_crs: bool) -> list[str]:
        """Return the number of segments and of levels."""
        count, levels = len(self.levels), len(np.unique(self.levels))
        return [f"{count:,} segment{'s' if count != 1 else ''} of {levels} level{'s' if levels != 1 else ''}"]

    def draw(self, ax: Any, point: float) -> None:
        visible = shapely.area(self.polygons) > (_MIN_SIDE * point) ** 2
        for level in np.unique(self.levels[visible]):
            chosen = visible & (self.levels == level)
            color = str(self.greys[chosen][0])
            paths = polygon_paths(simplified(self.polygons[chosen], _TOLERANCE * point))
            ax.add_collection(PathCollection(paths, facecolor=color, edgecolor=color, lw=0.3, zorder=2.2))


def _numbers(name: str, columns: Columns) -> Floats:
    """Return a column that holds finite numbers, as texts too."""
    try:
        numbers = np.array([float(value) for value in columns[name]])
        if (np.abs(numbers) < _LARGEST_LEVEL).all():
            return numbers
    except (TypeError, ValueError, OverflowError):
        pass
    raise RegionError(f"the column {name} of the segments holds something other than numbers")


def _greys(levels: Integers, columns: Columns) -> Floats:
    """Return the middle of each segment's interval; evenly spaced greys if the intervals are not given."""
    if "range_low" in columns and "range_high" in columns:
        low, high = (np.clip(_numbers(name, columns), 0, 1) for name in ("range_low", "range_high"))
        return (low + high) / 2
    distinct = np.unique(levels)
    return np.searchsorted(distinct, levels) / max(len(distinct) - 1, 1)
