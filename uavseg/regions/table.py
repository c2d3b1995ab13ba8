"""Region table: polygons in the raster's CRS with measured attributes (area, perimeter, mean, ...)."""

from collections.abc import Mapping
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from uavseg.arrays import Floats, GeoDataFrame
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.raster.geodesy.globe import transform_between, wrap_lon_beyond_180
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ring_areas, ring_perimeters
from uavseg.regions.shapes import LazyPolygons, PolygonArray, batch_slices
from uavseg.units import GREY_MAX

if TYPE_CHECKING:
    from uavseg.raster.spectral.bands import ValueAxis
    from uavseg.regions.outline.rings import Rings
    from uavseg.segmentation.components import Sums


_MIDDLE = 32768  # grey of the only intensity of a stretch without extent

COLUMNS: dict[str, type] = (
    {"id": np.int64, "area_m2": np.float64, "perimeter_m": np.float64, "mean": np.float64, "std": np.float64}
    | {"pixels": np.int64, "holes": np.int64, "lon": np.float64, "lat": np.float64}
    | {"range_low": np.float64, "range_high": np.float64, "source": object}
)  # columns of a region table, in order, with their types

VALUE_COLUMNS: dict[str, type] = {
    **dict.fromkeys(("mean_value", "value_low", "value_high"), np.float64),
    "unit": object,
}  # columns in the units of the raster, which follow `range_high`; see `with_values`


@dataclass(frozen=True)
class Regions:
    """Regions and their attributes, largest first.

    The columns, (n,), are `id` (the label, from 1), `area_m2` and `perimeter_m` on the ground (local units
    without a CRS), `mean` and `std` of intensity in [0, 1], `pixels`, `holes`, `lon` and `lat` of a point
    inside the region (NaN without a CRS), `range_low`, `range_high`, `source`.

    Polygons run along pixel edges in the raster's CRS, exteriors counter-clockwise: shapely's Polygon, or a
    MultiPolygon where the pixels of a region do not all share edges.
    """

    columns: dict[str, NDArray[Any]]
    polygons: PolygonArray  # (n,)
    wkt: str | None  # the CRS; None for local coordinates
    metadata: Mapping[str, Any] = field(default_factory=dict)  # source and parameters, plain values for JSON

    def __len__(self) -> int:
        return len(self.polygons)

    def select(self, which: NDArray[Any]) -> "Regions":
        """Return some of the regions, by index or mask, in that order."""
        columns = {name: column[which] for name, column in self.columns.items()}
        return replace(self, columns=columns, polygons=self.polygons[which])

    def frame(self) -> "GeoDataFrame":
        """Return a GeoDataFrame with the raster's CRS; its `attrs` have the metadata as "uavseg"."""
        from geopandas.array import from_shapely

        from uavseg.regions.frame import RegionFrame

        geometry = from_shapely(np.array(list(self.polygons), object), crs=self.wkt)
        frame = RegionFrame({**self.columns, "geometry": geometry}, geometry="geometry")
        frame.attrs["uavseg"] = dict(self.metadata)
        return frame


def in_crs(regions: Regions, crs: Any) -> Regions:
    """Return regions with their corners in another CRS (pyproj); measures stay those on the ground.

    RasterError if they have no CRS, there is no transformation, or a corner is beyond the domain of the other
    CRS or on the other side of the antimeridian.
    """
    if regions.wkt is None:
        raise RasterError(
            "the raster has no CRS, from which its regions could be transformed; leave --crs out"
        )
    transform = transform_between(regions.wkt, crs)
    corners = np.array(list(regions.polygons), object)
    polygons = np.asarray(shapely.transform(corners, transform, interleaved=False))
    bounds = shapely.bounds(polygons)
    if not np.isfinite(bounds).all() or (crs.is_geographic and (bounds[:, 2] - bounds[:, 0] > 180).any()):
        raise RasterError(
            f"regions have no coordinates in {crs.name}, or cross its edge; choose another --crs"
        )
    return replace(regions, polygons=polygons, wkt=crs.to_wkt("WKT2_2019"))


def plain_columns(*tables: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return columns of tables, one after the other, as integers, floats or texts, which every format has.

    A text that a table lacks is empty, a number NaN.
    """
    import pandas

    plain: dict[str, NDArray[Any]] = {}
    for name, column in pandas.concat([pandas.DataFrame(dict(one)) for one in tables]).items():
        if name.lower() in ("fid", "geom"):  # of GeoPackages
            continue
        if column.dtype.kind in "biuf":
            plain[name] = column.to_numpy(np.float64 if column.dtype.kind == "f" else np.int64)
        else:
            plain[name] = column.astype(str).where(column.notna(), "").to_numpy(object)
    return plain


def make_regions(
    rings: "Rings",
    sums: "Sums",
    geobox: GeoBox,
    interval: tuple[ArrayLike, ArrayLike],
    source: str,
    pixels: NDArray[np.integer[Any]] | None = None,
) -> Regions:
    """Measure regions.

    `rings` are the outlines of regions 1..n on the grid of `geobox`, `sums` are of each: pixels, and over
    them grey levels 0..65535 and their squares. `interval` is the requested range of intensity, of all
    regions or of each, (n,), and `source` the name of the raster. `pixels`, (n,), are those that the outlines
    enclose, if not all of them were summed.
    """
    polygons = LazyPolygons(rings, geobox.transform)
    n = len(polygons)
    mean = sums.greys / sums.counts
    std = np.sqrt(np.maximum(sums.squares / sums.counts - mean * mean, 0)) / GREY_MAX
    lon, lat = _points_inside(polygons, geobox)
    low, high = (np.broadcast_to(end, n).copy() for end in interval)
    areas, lengths = (of(geobox, rings.vertices, rings.starts) for of in (ring_areas, ring_perimeters))
    measures = (areas, lengths, ~rings.exteriors)
    area, perimeter, holes = (np.bincount(rings.labels, one, n + 1)[1:] for one in measures)
    values: list[Any] = [np.arange(1, n + 1), area, perimeter, mean / GREY_MAX, std]
    values += [sums.counts if pixels is None else pixels, holes, lon, lat, low, high]
    values.append(np.full(n, source, object))
    columns: dict[str, NDArray[Any]] = {
        name: np.asarray(value).astype(dtype, copy=False)
        for (name, dtype), value in zip(COLUMNS.items(), values, strict=True)
    }
    return Regions(columns, polygons, geobox.wkt)


def _points_inside(polygons: LazyPolygons, geobox: GeoBox) -> tuple[Floats, Floats]:
    """Return longitude and latitude of a point inside each polygon; NaN where they are not defined."""
    parts = (shapely.point_on_surface(polygons[part]) for part in batch_slices(polygons))
    points = np.concatenate([np.empty(0, object), *parts])
    try:
        lon, lat = geobox.lonlat_from_xy(shapely.get_x(points), shapely.get_y(points))
    except RasterError:
        return np.full(len(polygons), np.nan), np.full(len(polygons), np.nan)
    undefined = ~(np.isfinite(lon) & np.isfinite(lat))
    lon[undefined] = lat[undefined] = np.nan
    return wrap_lon_beyond_180(lon), lat


def with_values(
    regions: Regions, sums: "Sums", axis: "ValueAxis | None", ends: tuple[ArrayLike, ArrayLike] | None = None
) -> Regions:
    """Return regions with columns in the units of the raster after `range_high`, see `VALUE_COLUMNS`.

    `axis` maps v to values; where it is None they are NaN and the unit is empty. `ends` are the range in
    values of all regions or of each, NaN where it is open; by default that of `range_low` and `range_high`.
    """
    columns, n = regions.columns, len(regions)
    if ends is None:
        ends = axis.ends(columns["range_low"], columns["range_high"]) if axis else (np.nan, np.nan)
    mean = np.full(n, np.nan)
    if axis is not None:  # NaN where the stretch clips pixels, and more is not known
        v = columns["mean"] + (0 if sums.excess is None else sums.excess / sums.counts / GREY_MAX)
        is_plain = axis.low < axis.high
        unknown = np.isnan(columns["std"]) if is_plain else columns["mean"] != _MIDDLE / GREY_MAX
        mean = np.where(unknown & axis.clips, np.nan, axis.values(v))
    low, high = (np.broadcast_to(np.asarray(end, np.float64), n).copy() for end in ends)
    unit = np.full(n, "" if axis is None else axis.unit, object)
    values = dict(zip(VALUE_COLUMNS, (mean, low, high, unit), strict=True))
    completed = {}
    for name, column in columns.items():
        completed[name] = column
        if name == "range_high":
            completed |= values
    return replace(regions, columns=completed)
