"""Many polygons as flat arrays, and back."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

Integers = NDArray[np.int64]
Objects = NDArray[np.object_]


@dataclass(frozen=True, slots=True)
class Ragged:
    """Regions made of polygons made of rings made of vertices, each level by where its members start.

    Parameters
    ----------
    vertices : (v, 2) array
        Of closed rings.
    rings : (r + 1,) int64 array
        Where each ring starts in `vertices`; v at the end.
    polygons : (p + 1,) int64 array
        Where each polygon starts in `rings`, with its exterior, which its holes follow; r at the end.
    regions : (n + 1,) int64 array
        Where each region starts in `polygons`; p at the end.

    Examples
    --------
    >>> flat = Ragged.of(np.array([shapely.box(0, 0, 2, 1), shapely.box(3, 0, 4, 1)]))
    >>> flat.rings.tolist(), flat.polygons.tolist(), flat.regions.tolist()
    ([0, 5, 10], [0, 1, 2], [0, 1, 2])
    """

    vertices: NDArray[Any]
    rings: Integers
    polygons: Integers
    regions: Integers

    @classmethod
    def of(cls, geometries: Objects) -> "Ragged":
        """Take apart an array of Polygons and MultiPolygons."""
        parts, owners = shapely.get_parts(geometries, return_index=True)
        rings, polygons = shapely.get_rings(parts, return_index=True)
        return cls(
            shapely.get_coordinates(parts),
            np.concatenate([[0], np.cumsum(shapely.get_num_coordinates(rings))]),
            np.searchsorted(polygons, np.arange(len(parts) + 1)),
            np.searchsorted(owners, np.arange(len(geometries) + 1)),
        )

    def built(self) -> Objects:
        """A Polygon for each region of one polygon (an empty one for one of none), else a MultiPolygon."""
        parts: Objects = shapely.from_ragged_array(
            shapely.GeometryType.POLYGON, self.vertices, (self.rings, self.polygons)
        )
        counts = np.diff(self.regions)
        if (counts == 1).all():
            return parts
        alone, several = counts == 1, counts > 1
        whole = np.full(len(counts), shapely.Polygon(), object)
        whole[alone] = parts[np.repeat(alone, counts)]
        if several.any():
            owners = np.repeat(np.arange(several.sum()), counts[several])
            whole[several] = shapely.multipolygons(parts[np.repeat(several, counts)], indices=owners)
        return whole

    def without(self, dropped: NDArray[np.bool_]) -> "Ragged":
        """The same where some regions have no polygons."""
        if not dropped.any():
            return self
        vertices, rings, polygons = np.diff(self.rings), np.diff(self.polygons), np.diff(self.regions)
        keep_polygon = np.repeat(~dropped, polygons)
        keep_ring = np.repeat(keep_polygon, rings)
        return Ragged(
            self.vertices[np.repeat(keep_ring, vertices)],
            _starts(vertices[keep_ring]),
            _starts(rings[keep_polygon]),
            _starts(polygons * ~dropped),
        )

    def region_of(self, vertices: Integers) -> Integers:
        """The region that each of these vertices belongs to."""
        return np.searchsorted(self.rings[self.polygons[self.regions]], vertices, "right") - 1


def _starts(lengths: Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(lengths)])
