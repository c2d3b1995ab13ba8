"""Regions: polygons in the raster's coordinates with what is known of each of them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from uavseg.errors import RasterError
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.ground import ring_areas, ring_perimeters
from uavseg.regions.outline.rings import Rings
from uavseg.regions.shapes import Polygons, Shapes, batches
from uavseg.units import GREY_MAX

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

COLUMNS: dict[str, type] = {
    "id": np.int64,
    "area_m2": np.float64,
    "perimeter_m": np.float64,
    "mean": np.float64,
    "std": np.float64,
    "pixels": np.int64,
    "holes": np.int64,
    "lon": np.float64,
    "lat": np.float64,
    "range_low": np.float64,
    "range_high": np.float64,
    "source": object,
}
"""The columns in their order, and what they hold."""


@dataclass(frozen=True)
class Regions:
    """Regions and their attributes, the one with most pixels first.

    Parameters
    ----------
    columns : dict of str -> (n,) array
        `id` (the label, from 1), `area_m2` and `perimeter_m` on the ground (local units where there is no
        CRS), `mean` and `std` of intensity in [0, 1], `pixels`, `holes`, `lon` and `lat` of a point inside
        the region (NaN where there is no CRS), `range_low`, `range_high`, `source`.
    polygons : (n,) object array of shapely Polygon, or Shapes
        In the raster's CRS; along pixel edges, exteriors counter-clockwise. A MultiPolygon where the pixels
        of a region do not all share edges.
    wkt : str or None
        The CRS; None where coordinates are local.
    """

    columns: dict[str, NDArray[Any]]
    polygons: Polygons
    wkt: str | None

    def __len__(self) -> int:
        return len(self.polygons)

    def select(self, which: NDArray[Any]) -> "Regions":
        """The regions at these places (indices or a mask), in this order."""
        columns = {name: column[which] for name, column in self.columns.items()}
        return Regions(columns, self.polygons[which], self.wkt)

    def frame(self) -> "GeoDataFrame":
        """The regions as a GeoDataFrame with the raster's CRS."""
        import geopandas

        return geopandas.GeoDataFrame(dict(self.columns), geometry=list(self.polygons), crs=self.wkt)


def make(
    rings: Rings,
    geobox: GeoBox,
    counts: NDArray[np.integer[Any]],
    sums: NDArray[np.integer[Any]],
    square_sums: NDArray[Any],
    interval: tuple[ArrayLike, ArrayLike],
    source: str,
    pixels: NDArray[np.integer[Any]] | None = None,
) -> Regions:
    """Measure regions.

    Parameters
    ----------
    rings : Rings
        Outlines of regions 1..n on the grid of `geobox`.
    geobox : GeoBox
    counts : (n,) integer array
        Pixels of each region.
    sums, square_sums : (n,) arrays
        Over the pixels of each region, the sum of grey levels 0..65535 and of their squares.
    interval : (float, float) or two (n,) arrays
        The range of intensity that was asked for, of all regions or of each.
    source : str
        The raster's name.
    pixels : (n,) integer array, optional
        Pixels that the outlines enclose, where not all of them were summed.
    """
    polygons = Shapes(rings, geobox.transform)
    n = len(polygons)
    mean, std = _mean_and_std(counts, sums, square_sums)
    lon, lat = _points_inside(polygons, geobox)
    low, high = interval
    values: list[Any] = [
        np.arange(1, n + 1),
        _per_region(rings.labels, ring_areas(geobox, rings.vertices, rings.starts), n),
        _per_region(rings.labels, ring_perimeters(geobox, rings.vertices, rings.starts), n),
        mean,
        std,
        counts if pixels is None else pixels,
        _per_region(rings.labels, ~rings.exteriors, n),
        lon,
        lat,
        np.broadcast_to(low, n).copy(),
        np.broadcast_to(high, n).copy(),
        np.full(n, source, object),
    ]
    columns: dict[str, NDArray[Any]] = {
        name: np.asarray(value).astype(kind, copy=False)
        for (name, kind), value in zip(COLUMNS.items(), values, strict=True)
    }
    return Regions(columns, polygons, geobox.wkt)


def _per_region(labels: Integers, values: NDArray[Any], n: int) -> NDArray[Any]:
    return np.bincount(labels, weights=values, minlength=n + 1)[1:]


def _mean_and_std(
    counts: NDArray[np.integer[Any]], sums: NDArray[np.integer[Any]], square_sums: NDArray[Any]
) -> tuple[Floats, Floats]:
    mean = sums / counts
    variance = np.maximum(square_sums / counts - mean * mean, 0)
    return mean / GREY_MAX, np.sqrt(variance) / GREY_MAX


def _points_inside(polygons: Shapes, geobox: GeoBox) -> tuple[Floats, Floats]:
    """Longitude and latitude of a point inside each polygon; NaN where there is none or no CRS."""
    points = np.concatenate(
        [np.empty(0, object), *(shapely.point_on_surface(polygons[part]) for part in batches(polygons))]
    )
    try:
        lon, lat = geobox.lonlat_from_xy(shapely.get_x(points), shapely.get_y(points))
    except RasterError:
        return np.full(len(polygons), np.nan), np.full(len(polygons), np.nan)
    nowhere = ~(np.isfinite(lon) & np.isfinite(lat))
    lon[nowhere] = lat[nowhere] = np.nan
    return np.where(np.abs(lon) > 180, np.remainder(lon + 180, 360) - 180, lon), lat
