"""Polygons in flat arrays: ragged coordinates, and polygons that are built from their rings on demand."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from affine import Affine
from numpy.typing import NDArray

from uavseg._jit import inlined, kernel
from uavseg.arrays import Bools, Floats, Integers, Objects, Uint8s
from uavseg.dataclass import dataclass

if TYPE_CHECKING:
    from uavseg.regions.outline.rings import Rings


BATCH_VERTICES = 1 << 18  # of the polygons that are built at a time
_COUNTED, _VERTEX = 9, 16  # bytes of a geometry before its members (order, type, their number), of a vertex


class LazyPolygons:
    """Polygons of regions 1..n in map coordinates, indexed like an array of shapely Polygons.

    Exteriors run counter-clockwise on the map, holes clockwise. A region with several exteriors is a
    MultiPolygon. The transform is from pixel corners (col, row) to map coordinates.
    """

    def __init__(self, rings: "Rings", transform: Affine) -> None:
        self.rings = rings
        self.transform = transform
        self._count = int(rings.labels[-1]) if len(rings.labels) else 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, which: Any) -> Any:
        if isinstance(which, slice) and which.step in (None, 1):
            return self._build(*which.indices(len(self))[:2])
        return np.asarray(self)[which]

    def __iter__(self) -> Iterator[Any]:
        for part in batch_slices(self):
            yield from self[part]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Objects:
        return self._build(0, len(self))

    def vertex_counts(self) -> Integers:
        """Count the vertices of each region, (n,) int64, with the repeated first vertex of each ring."""
        firsts = self._first_rings(0, len(self))
        return np.diff(self.rings.starts[firsts]) + np.diff(firsts)

    def _first_rings(self, first: int, last: int) -> Integers:
        return np.searchsorted(self.rings.labels, np.arange(first + 1, last + 2))

    def _build(self, first: int, last: int) -> Objects:
        return np.empty(0, object) if last <= first else self.flat(first, last).to_geometries()

    def flat(self, first: int, last: int) -> "RaggedPolygons":
        """Return the regions from `first` to before `last`, counted from 0, in flat arrays; at least one."""
        of_region = self._first_rings(first, last)
        begin, end = int(of_region[0]), int(of_region[-1])
        starts = self.rings.starts[begin : end + 1]
        exteriors = np.flatnonzero(self.rings.exteriors_of(begin, end))
        coordinates = np.empty((int(starts[-1] - starts[0]) + len(starts) - 1, 2))
        affine = np.array(self.transform[:6])
        _close_rings(self.rings.vertices, starts, self.transform.determinant < 0, affine, coordinates)
        return RaggedPolygons(
            coordinates,
            starts - starts[0] + np.arange(len(starts)),
            np.append(exteriors, end - begin),
            np.searchsorted(exteriors, of_region - begin),
        )


PolygonArray = Objects | LazyPolygons


def batch_slices(polygons: PolygonArray, vertices: int = BATCH_VERTICES) -> Iterator[slice]:
    """Split regions into slices, in order, of at most `vertices` each, and at least one region."""
    if isinstance(polygons, LazyPolygons):
        ends = np.cumsum(polygons.vertex_counts())
    else:
        ends = np.cumsum(shapely.get_num_coordinates(polygons))
    first = 0
    while first < len(ends):
        before = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, before + vertices)))
        yield slice(first, last)
        first = last


def corner_counts(polygons: PolygonArray) -> Integers:
    """Count the corners of each polygon, with its holes; a MultiPolygon has several polygons."""
    if isinstance(polygons, LazyPolygons):
        return np.bincount(polygons.rings.parts, np.diff(polygons.rings.starts)).astype(np.int64)
    parts = shapely.get_parts(polygons)
    closing = shapely.get_num_interior_rings(parts) + 1
    return np.asarray(shapely.get_num_coordinates(parts) - closing, np.int64)


def total_area(polygons: PolygonArray) -> float:
    """Return the total area of polygons in square units of the map."""
    if isinstance(polygons, LazyPolygons):
        return float(polygons.rings.pixel_areas().sum() * abs(polygons.transform.determinant))
    return float(shapely.area(polygons).sum())


def as_multipolygons(polygons: Objects) -> Objects:
    """Convert (n,) polygons to multipolygons, each of its parts."""
    parts, owners = shapely.get_parts(polygons, return_index=True)
    return np.asarray(shapely.multipolygons(parts, indices=owners))


def has_multipolygons(polygons: PolygonArray) -> bool:
    """Check whether some geometry is a MultiPolygon."""
    if isinstance(polygons, LazyPolygons):
        return int(polygons.rings.exteriors.sum()) > len(polygons)
    return bool((shapely.get_type_id(polygons) != shapely.GeometryType.POLYGON).any())


@kernel("void(i4[:,::1], i8[::1], b1, f8[::1], f8[:,::1])")
def _close_rings(vertices, starts, reverse, affine, coordinates):  # type: ignore[no-untyped-def]
    used = 0
    for ring in range(starts.shape[0] - 1):
        begin = starts[ring]
        count = starts[ring + 1] - begin
        for k in range(count + 1):
            v = begin + (count - k if reverse else k) if k > 0 and k < count else begin
            row, col = np.float64(vertices[v, 0]), np.float64(vertices[v, 1])
            coordinates[used, 0] = affine[0] * col + affine[1] * row + affine[2]
            coordinates[used, 1] = affine[3] * col + affine[4] * row + affine[5]
            used += 1


@dataclass(frozen=True, slots=True)
class RaggedPolygons:
    """Regions of polygons of rings of vertices, each level by the offsets of its members (as in GeoArrow).

    Examples
    --------
    >>> flat = RaggedPolygons.from_geometries(np.array([shapely.box(0, 0, 2, 1), shapely.box(3, 0, 4, 1)]))
    >>> flat.rings.tolist(), flat.polygons.tolist(), flat.regions.tolist()
    ([0, 5, 10], [0, 1, 2], [0, 1, 2])
    """

    vertices: NDArray[Any]  # (v, 2): of closed rings
    rings: Integers  # (r + 1,) int64: offset of each ring in `vertices`; v at the end
    polygons: Integers  # (p + 1,): offset of each in `rings`, exterior first, then its holes; r at the end
    regions: Integers  # (n + 1,) int64: offset of each region in `polygons`; p at the end

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
        """Return shapely Polygons (empty for a region without polygons) and MultiPolygons, (n,)."""
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

    def bounds(self) -> Floats:
        """Return the least x and y and the greatest of regions, (n, 4); NaN for one without polygons."""
        found = np.empty((len(self.regions) - 1, 4))
        _bound(self.vertices, self.rings[self.polygons[self.regions]], found)
        return found

    def to_wkb(self, headers: Uint8s, promote: bool) -> list[memoryview]:
        """Return the regions as Well-Known Binary, little-endian, each after its header.

        Without `promote` each is one Polygon, else each is a MultiPolygon. `headers` are (n, h) bytes.
        Source: OGC 06-103r4, section 8.
        """
        vertices = np.diff(self.rings[self.polygons[self.regions]])
        rings = np.diff(self.polygons[self.regions])
        polygons = np.maximum(np.diff(self.regions), not promote)  # an empty one is written too
        extra = headers.shape[1] + _COUNTED * promote
        ends = np.cumsum(extra + _COUNTED * polygons + 4 * rings + _VERTEX * vertices)
        data = np.empty(int(ends[-1]) if len(ends) else 0, np.uint8)
        coordinates = np.ascontiguousarray(self.vertices, "<f8").view(np.uint8)
        _write_wkb(coordinates, self.rings, self.polygons, self.regions, promote, headers, data)
        view = data.data
        return [view[begin:end] for begin, end in pairwise([0, *ends.tolist()])]

    def without(self, dropped: Bools) -> "RaggedPolygons":
        """Return the same regions, some of them without their polygons; `dropped` is an (n,) mask."""
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
        """Return the region, 0..n - 1, that each of some vertices belongs to."""
        return np.searchsorted(self.rings[self.polygons[self.regions]], vertices, "right") - 1


@kernel("void(f8[:,::1], i8[::1], f8[:,::1])")
def _bound(vertices, starts, bounds):  # type: ignore[no-untyped-def]
    for region in range(len(starts) - 1):
        bounds[region] = np.nan
        for v in range(starts[region], starts[region + 1]):
            for axis in range(2):
                at = vertices[v, axis]
                if not bounds[region, axis] <= at:
                    bounds[region, axis] = at
                if not bounds[region, 2 + axis] >= at:
                    bounds[region, 2 + axis] = at


@inlined
def _put_count(data, at, count):  # type: ignore[no-untyped-def]
    """Write a number of 4 bytes; return the place after it."""
    for k in range(4):
        data[at + k] = np.uint8((count >> (8 * k)) & 255)
    return at + 4


@inlined
def _put_head(data, at, kind, members):  # type: ignore[no-untyped-def]
    """Write order of bytes (little-endian), type and number of members; return the place after them."""
    data[at] = 1
    return _put_count(data, _put_count(data, at + 1, kind), members)


@kernel("void(u1[:,::1], i8[::1], i8[::1], i8[::1], b1, u1[:,::1], u1[::1])")
def _write_wkb(coordinates, rings, polygons, regions, promote, headers, data):  # type: ignore[no-untyped-def]
    at = 0
    for region in range(len(regions) - 1):
        for k in range(headers.shape[1]):
            data[at + k] = headers[region, k]
        at += headers.shape[1]
        if promote:
            at = _put_head(data, at, 6, regions[region + 1] - regions[region])
        elif regions[region] == regions[region + 1]:
            at = _put_head(data, at, 3, 0)
        for polygon in range(regions[region], regions[region + 1]):
            at = _put_head(data, at, 3, polygons[polygon + 1] - polygons[polygon])
            for ring in range(polygons[polygon], polygons[polygon + 1]):
                at = _put_count(data, at, rings[ring + 1] - rings[ring])
                for vertex in range(rings[ring], rings[ring + 1]):
                    for k in range(16):
                        data[at + k] = coordinates[vertex, k]
                    at += 16


def flat_part(polygons: PolygonArray, part: slice) -> RaggedPolygons:
    """Return some regions, as of `batch_slices`, in flat arrays."""
    if isinstance(polygons, LazyPolygons):
        return polygons.flat(part.start, part.stop)
    return RaggedPolygons.from_geometries(polygons[part])


def _offsets(lengths: Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(lengths)])
