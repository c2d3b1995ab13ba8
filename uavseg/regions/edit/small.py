"""Small things away: holes are filled first, then small regions are dropped."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import ParameterError
from uavseg.raster.geobox import GeoBox
from uavseg.raster.geodesy.ground import ring_areas
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.stitch import Outlined, taken
from uavseg.segmentation.components import Sums


@dataclass(frozen=True, slots=True)
class Area:
    """An area in square metres, or in pixels.

    Examples
    --------
    >>> parse_area("64px")
    Area(value=64.0, in_pixels=True)
    """

    value: float
    in_pixels: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.value < float("inf"):
            raise ParameterError(f"an area is a number that is not negative, not {self.value:g}")


def parse_area(text: str) -> Area:
    """An area from text: square metres, or pixels with the suffix px.

    Raises
    ------
    ParameterError
        If it is not a number that is not negative.
    """
    number = text.strip().lower()
    in_pixels = number.endswith("px")
    try:
        return Area(float(number.removesuffix("px")), in_pixels)
    except ValueError as error:
        raise ParameterError(
            f"an area is square metres such as 500, or pixels such as 64px, not {text!r}"
        ) from error


def without_small_holes(outlined: Outlined, geobox: GeoBox, smallest: Area) -> Outlined:
    """Regions whose holes of less than an area are filled; regions within such a hole become part of it.

    The sums are those of the pixels that were regions before: `extract` measures filled regions again.
    """
    rings = outlined.rings
    small = ~rings.exteriors & (-_areas(rings, geobox, smallest) < smallest.value)
    if not small.any():
        return outlined
    kept = ~small & ~np.isin(rings.parts, _parts_inside(rings, small))
    return numbered_by_size(rings, outlined.sums, kept)


def without_small_regions(outlined: Outlined, geobox: GeoBox, smallest: Area) -> Outlined:
    """Regions of at least an area; the rest keep their order and are numbered 1..n."""
    rings = outlined.rings
    areas = region_areas(outlined, geobox, smallest)
    return numbered_by_size(rings, outlined.sums, areas[rings.labels - 1] >= smallest.value)


def region_areas(outlined: Outlined, geobox: GeoBox, unit: Area) -> NDArray[np.float64]:
    """Area of each region, (n,), in the unit of `unit`: square metres or pixels.

    Raises
    ------
    ParameterError
        If square metres are asked for where there is no CRS.
    """
    rings = outlined.rings
    areas = np.bincount(rings.labels, _areas(rings, geobox, unit), len(outlined.sums.counts) + 1)
    return np.asarray(areas[1:], np.float64)


def numbered_by_size(rings: Rings, sums: Sums, kept: NDArray[np.bool_] | None = None) -> Outlined:
    """Regions with labels 1..n: the one that encloses most pixels first, ties in raster order.

    Parameters
    ----------
    rings : Rings
    sums : Sums
        Of the regions of `rings`, in the order of their labels.
    kept : (r,) bool array, optional
        The rings that are kept; all, if left out.
    """
    kept = np.ones(len(rings.labels), bool) if kept is None else kept
    left = np.unique(rings.labels[kept])
    pixels = np.bincount(rings.labels[kept], rings.pixel_areas()[kept], len(sums.counts) + 1)[left]
    firsts = sums.firsts[left - 1]
    order = np.lexsort((firsts[:, 1], firsts[:, 0], -pixels))
    number = np.empty(len(order), np.int64)
    number[order] = np.arange(1, len(order) + 1)
    labels = number[np.searchsorted(left, rings.labels[kept])]
    return Outlined(rings.chosen(kept, labels), taken(sums, left[order] - 1))


def _areas(rings: Rings, geobox: GeoBox, unit: Area) -> NDArray[np.float64]:
    """Area of each ring, negative for holes, in the unit of `unit`.

    Raises
    ------
    ParameterError
        If square metres are asked for where there is no CRS.
    """
    if unit.in_pixels:
        return rings.pixel_areas().astype(np.float64)
    if geobox.crs is None:
        raise ParameterError(
            "the raster has no CRS, so there are no square metres; give the area in pixels, "
            f"such as {unit.value:g}px"
        )
    return ring_areas(geobox, rings.vertices, rings.starts)


def _parts_inside(rings: Rings, holes: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The polygons that lie within some of the holes."""
    corners = rings.vertices[rings.starts[:-1][rings.exteriors]]
    centres = shapely.points(corners[:, ::-1] + 0.5)  # a region's uppermost, then leftmost pixel
    filled = [
        shapely.Polygon(rings.vertices[rings.starts[k] : rings.starts[k + 1], ::-1])
        for k in np.flatnonzero(holes)
    ]
    _, within = shapely.STRtree(centres).query(filled, predicate="contains")
    return np.unique(rings.parts[rings.exteriors][within])
