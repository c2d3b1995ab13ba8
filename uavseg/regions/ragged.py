"""Ragged arrays of polygons: coordinates with ring, polygon and region offsets, and back to shapely."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Integers = NDArray[np.int64]
Objects = NDArray[np.object_]


@dataclass(frozen=True, slots=True)
class RaggedPolygons:
    """Regions of polygons of rings of vertices, each level by the offsets of its members (as in GeoArrow).

    Parameters
    ----------
    vertices : (v, 2) array
        Of closed rings.
    rings : (r + 1,) int64 array
        Offset of each ring in `vertices`; v at the end.
    polygons : (p + 1,) int64 array
        Offset of each polygon in `rings`, its exterior first, then its holes; r at the end.
    regions : (n + 1,) int64 array
        Offset of each region in `polygons`; p at the end.

    Examples
    --------
    >>> flat = RaggedPolygons.from_geometries(np.array([shapely.box(0, 0, 2, 1), shapely.box(3, 0, 4, 1)]))
    >>> flat.rings.tolist(), flat.polygons.tolist(), flat.regions.tolist()
    ([0, 5, 10], [0, 1, 2], [0, 1, 2])
    """

    vertices: NDArray[Any]
    rings: Integers
    polygons: Integers
    regions: Integers

    @classmethod
    def from_geometries(cls, geometries: Objects) -> "RaggedPolygons":
        """Flatten an (n,) object array of Polygons and MultiPolygons."""
        parts, owners = shapely.get_parts(geometries, return_index=True)
        rings, polygons = shapely.get_rings(parts, return_index=True)
        return cls(
            shapely.get_coordinates(parts),
            np.concatenate([[0], np.cumsum(shapely.get_num_coordinates(rings))]),
            np.searchsorted(polygons, np.arange(len(parts) + 1)),
            np.searchsorted(owners, np.arange(len(geometries) + 1)),
        )

    def to_geometries(self) -> Objects:
        """The regions as shapely Polygons (empty for a region without polygons) and MultiPolygons, (n,)."""
        parts: Objects = shapely.from_ragged_array(
            shapely.GeometryType.POLYGON, self.vertices, (self.rings, self.polygons)
        )
        counts = np.diff(self.regions)
        if (counts == 1).all():
            return parts
        single, multiple = counts == 1, counts > 1
        geometries = np.full(len(counts), shapely.Polygon(), object)
        geometries[single] = parts[np.repeat(single, counts)]
        if multiple.any():
            owners = np.repeat(np.arange(multiple.sum()), counts[multiple])
            geometries[multiple] = shapely.multipolygons(parts[np.repeat(multiple, counts)], indices=owners)
        return geometries

    def without(self, dropped: NDArray[np.bool_]) -> "RaggedPolygons":
        """The same regions, some of them without their polygons; `dropped` is an (n,) mask."""
        if not dropped.any():
            return self
        vertices, rings, polygons = np.diff(self.rings), np.diff(self.polygons), np.diff(self.regions)
        keep_polygon = np.repeat(~dropped, polygons)
        keep_ring = np.repeat(keep_polygon, rings)
        return RaggedPolygons(
            self.vertices[np.repeat(keep_ring, vertices)],
            _offsets(vertices[keep_ring]),
            _offsets(rings[keep_polygon]),
            _offsets(polygons * ~dropped),
        )

    def region_of(self, vertices: Integers) -> Integers:
        """The region, 0..n - 1, that each of some vertices belongs to."""
        return np.searchsorted(self.rings[self.polygons[self.regions]], vertices, "right") - 1


def _offsets(lengths: Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(lengths)])
