"""Read regions from vector files of any origin, as longitudes and latitudes in WGS 84.

Points and lines become areas: discs and strips of a width on the ground (buffers).
"""

import io
import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import GeoDataFrame, Integers, Objects, Path_
from uavseg.dataclass import dataclass
from uavseg.errors import RegionError, UavsegError, caused_errors
from uavseg.execution.executors import steps_done
from uavseg.output.staging import default_signals
from uavseg.plain_text import cause_of
from uavseg.raster.access.opening import file_exists
from uavseg.raster.geodesy.globe import MAX_DECIMALS, WGS84, geod_wgs84, unwrap_lon, wrap_lon
from uavseg.regions.formats import vector_files
from uavseg.regions.shapes import batch_slices
from uavseg.regions.table import COLUMNS, VALUE_COLUMNS, Regions
from uavseg.regions.wgs84.to_wgs84 import cut_at_antimeridian
from uavseg.warning_filters import changing_filters

REPAIR_TOLERANCE = 0.01  # largest relative change of a polygon's area by its repair
KML_FIELDS = {
    *("Name", "description", "timestamp", "begin", "end", "altitudeMode", "tessellate", "extrude"),
    *("visibility", "drawOrder", "icon"),
}
FULL_NAMES = {"perim_m": "perimeter_m", "range_lo": "range_low", "range_hi": "range_high"}  # of Shapefiles
QUARTER = 8  # sides of a quarter of a circle
POINT, POLYGON, MULTIPOLYGON, OF_PARTS = 0, 3, 6, (4, 5, 7)  # shapely.GeometryType
_LOST_GEOMETRY = re.compile(r"\bring\b|WKT|NULL geometry|coord|JSON construct|vertex|point", re.IGNORECASE)
_HARMLESS = re.compile(r"winding|Measured", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Widths:
    """Width on the ground, in metres, of the areas that points and lines become; None: they are left out."""

    point_m: float | None
    line_m: float | None
    use: str  # of those that become areas, for notes
    left_out: str = ""  # what becomes of the others, likewise


def read_regions(
    source: Path_ | bytes, layer: str | None = None, local: bool = False, widths: Widths | None = None
) -> Regions:
    """Read regions from a file, in WGS 84.

    The source is GeoJSON, GeoPackage, FlatGeobuf, GeoParquet, Shapefile or KML, or the content of such a
    file. The result has polygons and multipolygons as (lon, lat), with all attributes. Files of other tools
    are completed: regions without an integer `id` are numbered from 1, the parts of a multipolygon
    separately; `area_m2` (geodesic) and `lon`, `lat` of a point inside are computed. `layer` is for a file
    that has several, other than KML, of which all are read. A RegionError says that the file cannot be read,
    has no polygons or other geometries too, no CRS, or local coordinates; with `local`, coordinates without a
    CRS are read as they are. With `widths`, points and lines become areas or are left out, and the metadata
    have "notes" on them.
    """
    name = "standard input" if isinstance(source, bytes) else str(source)
    return _complete_frame(_read_frame(source, name, layer), name, local, widths)


def read_local_regions(source: Path_, layer: str | None = None) -> Regions:
    """Read regions in the coordinates of a map without a CRS; errors are those of `read_regions`.

    GeoJSON cannot say that it has no CRS: its coordinates are taken for these, and "notes" in the metadata
    say so. The CRS of another file stays, and is for the caller to refuse.
    """
    name, is_geojson = str(source), Path(source).suffix.lower() in (".geojson", ".json")
    frame = _read_frame(source, name, layer)
    frame = frame.set_crs(None, allow_override=True) if is_geojson else frame
    note = f"{name}: coordinates of GeoJSON, which are degrees elsewhere, are taken for those of the map"
    found = _complete_frame(frame, name, True, None)
    return replace(found, metadata={"notes": [note]}) if is_geojson else found


def regions_of_frame(frame: "GeoDataFrame", local: bool = False, widths: Widths | None = None) -> Regions:
    """Return regions of a GeoDataFrame, in WGS 84, completed like those of a file (`local`, `widths` too).

    A RegionError says that it has no polygons or other geometries too, no CRS, or local coordinates.
    """
    return _complete_frame(frame, "the frame", local, widths)


@np.errstate(all="ignore")  # coordinates that are not finite, or far too large, are refused below
def _complete_frame(frame: "GeoDataFrame", name: str, local: bool, widths: Widths | None) -> Regions:
    vector_files.check_geometries(np.asarray(frame.geometry, dtype=object), name)
    local = local and frame.crs is None
    frame = frame if local else _to_wgs84(frame, name)
    geometries = np.asarray(frame.geometry, dtype=object)
    notes: list[str] = []
    if widths is not None:
        geometries, features, notes = as_areas(geometries, name, widths)
        frame = frame.iloc[features]
    if not local:
        geometries = _cut_at_antimeridian(geometries, name)
    fields = [field for field in frame.columns if field != frame.geometry.name]
    if len({str(field) for field in fields}) < len(fields):
        raise RegionError(f"{name} has two attributes of the same name; rename one of them")
    with vector_errors(name):  # texts of a damaged file may not be UTF-8
        columns = {str(field): np.asarray(frame[field]) for field in fields}
    # names and types that the file format has shortened or lost
    columns = {FULL_NAMES.get(field, field): values for field, values in columns.items()}
    if "tessellate" in columns:
        columns = {field: values for field, values in columns.items() if field not in KML_FIELDS}
    if "id2" in columns and _integers(columns.get("id")) is None:  # KML has an id of its own
        columns["id"] = columns.pop("id2")
    known = COLUMNS | VALUE_COLUMNS
    for field in columns.keys() & {name for name, kind in known.items() if kind is not object}:
        columns[field] = _numbers(columns[field])
    whole = _complete(columns, _polygons(geometries, name), None if local else WGS84)
    return replace(whole, metadata={"notes": notes}) if notes else whole


def _read_frame(source: Path_ | bytes, name: str, layer: str | None) -> "GeoDataFrame":
    import geopandas

    if not isinstance(source, bytes) and not file_exists(source):
        raise RegionError(f"{name} does not exist; name a file of regions")
    vector_files.check_vector(source, name)
    with vector_errors(name):
        if not isinstance(source, bytes) and Path(source).suffix.lower() in {".parquet", ".geoparquet"}:
            vector_files.import_pyarrow()
            frame = geopandas.read_parquet(source)
        else:
            with vector_files.reading_vectors():
                frame = _layers(source, name, layer)
    if not isinstance(frame, geopandas.GeoDataFrame):
        raise RegionError(f"{name} holds no geometries; regions are polygons")
    return frame


@contextmanager
def vector_errors(name: str) -> Iterator[None]:
    """Enter a context in which libraries read a vector file: their errors as RegionError.

    Of damaged content they raise anything, and drop or change geometries with a warning: that is an error
    too. Other warnings, about winding and measures, do not matter for regions.
    """
    try:
        with changing_filters(record=True) as caught:
            warnings.simplefilter("always")
            yield
    except (UavsegError, MemoryError):
        raise
    except Exception as error:
        cause = cause_of(error)
        if "not recognized as being in a supported file format" in cause:
            cause = "it is neither GeoJSON nor another format of polygons that GDAL knows"
        raise RegionError(f"{name} cannot be read as regions: {cause}") from error
    for warning in caught:
        text = str(warning.message)
        if _LOST_GEOMETRY.search(text) and not _HARMLESS.search(text):
            raise RegionError(f"{name} has a geometry that cannot be read: {cause_of(ValueError(text))}")


def _layers(source: Path_ | bytes, name: str, layer: str | None) -> Any:
    import pandas

    if isinstance(source, bytes):
        return _layer(source, name)
    layers = vector_files.region_layers(source, name)
    if layer is not None and layer not in layers:
        raise RegionError(f"{name} has no layer {layer!r}; it has {', '.join(layers)}")
    wanted = layers if layer is None else [layer]
    if len(wanted) > 1 and Path(source).suffix.lower() not in {".kml", ".kmz"}:
        raise RegionError(f"{name} has {len(layers)} layers; choose with --layer one of {', '.join(layers)}")
    frames = [_layer(source, name, one) for one in wanted]
    vector_files.check_attributes(source, name, max(len(frame.columns) for frame in frames) - 1)
    frames = [frame for frame in frames if len(frame)] or frames
    return frames[0] if len(frames) == 1 else pandas.concat(frames, ignore_index=True)


def _layer(source: Path_ | bytes, name: str, layer: str | None = None) -> Any:
    import geopandas

    features = vector_files.check_feature_count(source, name, layer)
    with default_signals():
        frame = geopandas.read_file(io.BytesIO(source) if isinstance(source, bytes) else source, layer=layer)
    vector_files.check_count(len(frame), features, name)
    return frame


def _to_wgs84(frame: "GeoDataFrame", name: str) -> "GeoDataFrame":
    from pyproj.exceptions import ProjError

    if frame.crs is None:
        raise RegionError(
            f"{name} has no coordinate system, so its position on Earth is unknown; give the file one "
            "(ogr2ogr -a_srs), or extract from a raster that has one"
        )
    nowhere = f"the coordinate system of {name} has no place on Earth"
    with caused_errors(nowhere, RegionError, ProjError, form="{}: {}"):
        frame = frame.to_crs(WGS84)
    west, south, east, north = frame.total_bounds
    turned = 180.001 < east <= 360.001 and east - west < 180  # longitudes may go on past the antimeridian
    if not (west >= -180.001 and south >= -90.001 and (east <= 180.001 or turned) and north <= 90.001):
        raise RegionError(
            f"{name} lies at {west:g} to {east:g} by {south:g} to {north:g}: not longitudes and latitudes, "
            "but probably local coordinates; give the file its coordinate system"
        )
    # As many decimals as GeoJSON has at most: the rounding of a format must not decide between plans.
    degrees = shapely.transform(np.asarray(frame.geometry, object), lambda xy: xy.round(MAX_DECIMALS))
    return frame.set_geometry(degrees, crs=frame.crs)


def _cut_at_antimeridian(geometries: Objects, name: str) -> Objects:
    """Split polygons at the antimeridian where longitudes go on past 180, or jump by over half a turn."""
    west, _, east, _ = shapely.bounds(geometries).T
    is_area = np.isin(shapely.get_type_id(geometries), (POLYGON, MULTIPOLYGON))
    crossing = np.flatnonzero(is_area & ((east > 180.001) | (east - west > 180)))
    if len(crossing):
        geometries = geometries.copy()
    for n in crossing.tolist():
        what = f"polygon {n + 1} of {name}"
        parts = [_cut_polygon(part, what) for part in shapely.get_parts(geometries[n])]
        geometries[n] = shapely.union_all(parts) if len(parts) > 1 else parts[0]
    return geometries


def _cut_polygon(polygon: Any, name: str) -> Any:
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(polygon)]
    for number, ring in enumerate(rings):
        ring[:, 0] = unwrap_lon(ring[:, 0])
        if abs(ring[-1, 0] - ring[0, 0]) > 180:
            raise RegionError(f"{name} surrounds a pole; write the regions as GeoJSON, which closes it there")
        rings[number] = ring if shapely.LinearRing(ring).is_ccw == (number == 0) else ring[::-1]
    return cut_at_antimeridian(rings, jumping=False)


def _polygons(geometries: Objects, name: str) -> Objects:
    others = sorted({g.geom_type for g in geometries} - {"Polygon", "MultiPolygon"})
    if others:
        raise RegionError(f"{name} holds {', '.join(others)}; regions are polygons")
    geometries = shapely.force_2d(geometries)
    if not np.isfinite(shapely.get_coordinates(geometries)).all():
        raise RegionError(
            f"{name} has a polygon with a coordinate that is not a finite number; repair it first"
        )
    for part in batch_slices(geometries):
        for n in (part.start + np.flatnonzero(~shapely.is_valid(geometries[part]))).tolist():
            geometries[n] = _repair(geometries[n], f"polygon {n + 1} of {name}")
        steps_done(part.stop, len(geometries))
    parts, of = shapely.get_parts(geometries, return_index=True)
    empty = shapely.is_empty(parts)
    for n in np.unique(of[empty]).tolist():  # on empty parts GEOS has crashed (`segmentize`)
        geometries[n] = shapely.multipolygons(parts[(of == n) & ~empty])
    return np.asarray(shapely.orient_polygons(geometries), dtype=object)  # a shapefile turns them round


def _repair(polygon: Any, what: str) -> Any:
    """Repair a polygon that touches itself; refuse one that crosses itself."""
    valid = shapely.make_valid(polygon, method="structure", keep_collapsed=False)
    change = abs(shapely.area(shapely.get_parts(polygon)).sum() - valid.area)
    is_area = valid.geom_type in {"Polygon", "MultiPolygon"} and not valid.is_empty
    if not is_area or change > REPAIR_TOLERANCE * valid.area:
        raise RegionError(
            f"{what} is not a valid polygon ({shapely.is_valid_reason(polygon)}); repair it first"
        )
    return valid


def _numbers(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind in "iuf":
        return values
    try:
        return np.array([np.nan if value is None else float(value) for value in values])
    except (TypeError, ValueError):
        return values


def _integers(values: NDArray[Any] | None) -> Integers | None:
    """Parse integers from numbers or texts; None if some value is not an integer."""
    if values is None:
        return None
    texts = [re.sub(r"\.0$", "", str(value)) for value in values]
    if not all(re.fullmatch(r"-?\d{1,18}", text) for text in texts):
        return None
    return np.array(texts, dtype=np.int64)


def _complete(columns: dict[str, NDArray[Any]], polygons: Objects, wkt: str | None) -> Regions:
    ids = _integers(columns.get("id"))
    if ids is None:
        polygons, origin = shapely.get_parts(polygons, return_index=True)
        columns = {
            name: values[origin] for name, values in columns.items() if name not in {"area_m2", "lon", "lat"}
        }
        ids = np.arange(1, len(polygons) + 1)
    lon, lat = np.full((2, len(polygons)), np.nan)
    if wkt is not None:
        lon, lat = _inner_points(polygons, columns.get("lon"), columns.get("lat"))
    area = columns.get("area_m2")
    if area is None or area.dtype.kind not in "iuf" or not np.isfinite(area).all():
        geod, area = geod_wgs84(), shapely.area(polygons)
        if wkt is not None:
            area = np.array([abs(geod.geometry_area_perimeter(polygon)[0]) for polygon in polygons])
    columns = {"id": ids, "area_m2": area, **columns} | {"id": ids, "area_m2": area, "lon": lon, "lat": lat}
    return Regions(columns, polygons, wkt).select(np.argsort(ids, kind="stable"))


def _inner_points(polygons: Objects, lon: Any, lat: Any) -> tuple[Any, Any]:
    """Return the given points where they lie inside their polygons, computed ones elsewhere."""
    if lon is None or lat is None or lon.dtype.kind != "f" or lat.dtype.kind != "f":
        lon = lat = np.full(len(polygons), np.nan)
    points = np.column_stack([lon, lat])
    for part in batch_slices(polygons):
        outside = part.start + np.flatnonzero(~shapely.contains_xy(polygons[part], *points[part].T))
        points[outside] = shapely.get_coordinates(shapely.point_on_surface(polygons[outside]))
        steps_done(part.stop, len(polygons))
    return points[:, 0], points[:, 1]


def as_areas(geometries: Objects, name: str, widths: Widths) -> tuple[Objects, Integers, list[str]]:
    """Return areas of geometries in degrees (lon, lat), of which features they are, and notes.

    Each point and line is an area of its own, with all that is nearer than half of the width, in the way of
    polygons that cross the antimeridian. Lines are straight in degrees. `name` is that of the file. A
    RegionError says that a coordinate is not finite, or nothing is left.
    """
    parts, owner = geometries, np.arange(len(geometries))
    while (several := np.isin(shapely.get_type_id(parts), OF_PARTS)).any():
        inner, of = shapely.get_parts(parts[several], return_index=True)
        owner = np.concatenate([owner[~several], owner[several][of]])
        parts = np.concatenate([parts[~several], inner])
    order = np.flatnonzero(~shapely.is_empty(parts))
    order = order[np.argsort(owner[order], kind="stable")]
    areas, owner, said = parts[order], owner[order], dict[str, list[str]]()
    kind = shapely.get_type_id(areas)
    is_line = ~np.isin(kind, (POINT, POLYGON, MULTIPOLYGON))
    for word, width_m, mask in (("point", widths.point_m, kind == POINT), ("line", widths.line_m, is_line)):
        chosen = np.flatnonzero(mask).tolist()
        if chosen and not np.isfinite(shapely.get_coordinates(areas[chosen])).all():
            raise RegionError(f"{name} has a coordinate that is not a finite number; repair it first")
        for k in chosen:
            areas[k] = None if width_m is None else _widened(areas[k], width_m)
        if chosen:
            counted = f"{len(chosen)} {word}{'s' * (len(chosen) != 1)}"
            said.setdefault(widths.left_out if width_m is None else widths.use, []).append(counted)
    notes = [f"{' and '.join(counted)} of {name}: {use}" for use, counted in said.items()]
    kept = ~shapely.is_missing(areas)
    if not kept.any():
        raise RegionError(f"{notes[-1]}, and there is nothing else in it")
    return areas[kept], owner[kept], notes


def _widened(shape: Any, width_m: float) -> Any:
    """Return the disc around a point, or the strip along a line, in a local plane around it."""
    from uavseg.flight.mission.track import LONGEST_EDGE_DEG, Plane

    lonlat = shapely.get_coordinates(shape)
    lonlat[:, 0] = unwrap_lon(lonlat[:, 0])
    lon, lat = (lonlat.min(axis=0) + lonlat.max(axis=0)) / 2
    plane = Plane(round(float(lat), 1), round(float(wrap_lon(lon)), 1))  # which neighbours share
    if len(lonlat) > 1:
        shape = shapely.segmentize(shapely.LineString(lonlat), LONGEST_EDGE_DEG)
    metres = shapely.transform(shape, lambda lonlat: np.column_stack(plane.xy_from_lonlat(*lonlat.T)))
    reach_m = width_m / 2 / math.cos(math.pi / (4 * QUARTER))  # the sides touch the circle
    area = shapely.buffer(metres, reach_m, quad_segs=QUARTER)
    return shapely.transform(area, lambda xy: np.column_stack(plane.lonlat_from_xy(*xy.T)))
