"""Polygons that are built from their rings when they are asked for, some at a time."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.regions.ragged import Ragged

if TYPE_CHECKING:
    from uavseg.regions.outline.rings import Rings

Integers = NDArray[np.int64]
Objects = NDArray[np.object_]

BATCH = 1 << 18  # vertices that are built at a time


class Shapes:
    """The polygons of regions 1..n on the map; reads as an array of shapely Polygons.

    Exteriors are counter-clockwise on the map, holes clockwise. A region with several exteriors is a
    MultiPolygon.

    Parameters
    ----------
    rings : Rings
        Outlines of regions 1..n.
    transform : affine.Affine
        From pixel corners (col, row) to map coordinates.
    """

    def __init__(self, rings: "Rings", transform: Affine) -> None:
        self._rings = rings
        self._transform = transform
        self._count = int(rings.labels[-1]) if len(rings.labels) else 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, which: Any) -> Any:
        if isinstance(which, slice) and which.step in (None, 1):
            return self._built(*which.indices(len(self))[:2])
        return np.asarray(self)[which]

    def __iter__(self) -> Iterator[Any]:
        for part in batches(self):
            yield from self[part]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Objects:
        return self._built(0, len(self))

    @property
    def several(self) -> bool:
        """Whether a region has more than one polygon."""
        return int(self._rings.exteriors.sum()) > len(self)

    def vertex_counts(self) -> Integers:
        """Vertices of each region's polygons, the first of a ring counted twice as it closes it."""
        starts = self._rings.starts[self._first_rings(0, len(self))]
        return np.diff(starts) + np.diff(self._first_rings(0, len(self)))

    def total_area(self) -> float:
        """Area of all of them in units of the map."""
        return float(self._rings.pixel_areas().sum() * abs(self._transform.determinant))

    def _first_rings(self, first: int, last: int) -> Integers:
        return np.searchsorted(self._rings.labels, np.arange(first + 1, last + 2))

    def _built(self, first: int, last: int) -> Objects:
        if last <= first:
            return np.empty(0, object)
        of_region = self._first_rings(first, last)
        begin, end = int(of_region[0]), int(of_region[-1])
        starts = self._rings.starts[begin : end + 1]
        exteriors = np.flatnonzero(self._rings.exteriors_of(begin, end))
        return Ragged(
            self._on_map(starts),
            starts - starts[0] + np.arange(len(starts)),
            np.append(exteriors, end - begin),
            np.searchsorted(exteriors, of_region - begin),
        ).built()

    def _on_map(self, starts: Integers) -> NDArray[np.float64]:
        """Rings in map coordinates, each from its first vertex back to it."""
        coordinates = np.empty((int(starts[-1] - starts[0]) + len(starts) - 1, 2))
        way = np.array(self._transform[:6])
        _close(self._rings.vertices, starts, self._transform.determinant < 0, way, coordinates)
        return coordinates


Polygons = Objects | Shapes


def batches(polygons: Polygons, vertices: int = BATCH) -> Iterator[slice]:
    """Slices of regions of about so many vertices, in order; at least one region each."""
    if isinstance(polygons, Shapes):
        ends = np.cumsum(polygons.vertex_counts())
    else:
        ends = np.cumsum(shapely.get_num_coordinates(polygons))
    first = 0
    while first < len(ends):
        passed = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, passed + vertices)))
        yield slice(first, last)
        first = last


def total_area(polygons: Polygons) -> float:
    """Area of all polygons in units of the map."""
    return polygons.total_area() if isinstance(polygons, Shapes) else float(shapely.area(polygons).sum())


def any_multi(polygons: Polygons) -> bool:
    """Whether one of them is a MultiPolygon."""
    if isinstance(polygons, Shapes):
        return polygons.several
    return bool((shapely.get_type_id(polygons) != shapely.GeometryType.POLYGON).any())


@kernel("void(i4[:,::1], i8[::1], b1, f8[::1], f8[:,::1])")
def _close(vertices, starts, backwards, way, coordinates):  # type: ignore[no-untyped-def]
    used = 0
    for ring in range(starts.shape[0] - 1):
        begin = starts[ring]
        count = starts[ring + 1] - begin
        for k in range(count + 1):
            v = begin
            if k > 0 and k < count:
                v = begin + (count - k if backwards else k)
            row = np.float64(vertices[v, 0])
            col = np.float64(vertices[v, 1])
            coordinates[used, 0] = way[0] * col + way[1] * row + way[2]
            coordinates[used, 1] = way[3] * col + way[4] * row + way[5]
            used += 1
