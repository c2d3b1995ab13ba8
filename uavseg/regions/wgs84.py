"""Polygons of any coordinate system as GeoJSON wants them: WGS 84, seven decimals, cut at the antimeridian.

Coordinates stay integers of 1e-7 degrees in flat arrays; the few polygons that need a geometry library
(cut in two, around a pole, or made invalid by rounding) are handed back as geometries of their own.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.errors import OutputError
from uavseg.regions.fold import fold
from uavseg.regions.ragged import polygons_from_rings, rings_from_polygons
from uavseg.regions.table import Regions

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Objects = NDArray[np.object_]
Flags = NDArray[np.bool_]

UNITS = 10_000_000
"""Units in a degree: seven decimals."""

_HALF_TURN = 180 * UNITS
_EARTH_RADII_M = (6.3e6, 6.4e6)
_SAG = 1 / 20  # how far an edge may leave its true course, in pixels


@dataclass(frozen=True, slots=True)
class Batch:
    """Some regions, in order.

    Parameters
    ----------
    lonlat : (v, 2) int64 array
        Vertices of closed rings in 1e-7 degrees.
    starts : (r + 1,) int64 array
        Where each ring starts.
    firsts : (n + 1,) int64 array
        The exterior ring of each region, its holes follow; r at the end.
    others : dict of int -> shapely Polygon or MultiPolygon
        Regions, counted from the batch's first, that have no rings here but this geometry (degrees).
    """

    lonlat: Integers
    starts: Integers
    firsts: Integers
    others: dict[int, Any]


def batches(regions: Regions, vertices: int = 1 << 18) -> Iterator[Batch]:
    """The regions in WGS 84, about so many vertices at a time.

    Exteriors run counter-clockwise, holes clockwise.

    Raises
    ------
    OutputError
        If the regions lie on another celestial body, have no place on the globe, or reach past the edge of
        their projection.
    """
    if not len(regions):
        return
    way = _Way.of(regions.wkt)
    pixel = shapely.area(regions.polygons).sum() / regions.columns["pixels"].sum()
    ends = np.cumsum(shapely.get_num_coordinates(regions.polygons))
    first = 0
    while first < len(regions):
        passed = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, passed + vertices)))
        yield _batch(regions.polygons[first:last], pixel, way)
        first = last


def geometries(regions: Regions) -> Objects:
    """The regions in WGS 84 as shapely geometries, with the very coordinates that GeoJSON gets."""
    parts = [np.empty(0, object)]
    for batch in batches(regions):
        drawn = polygons_from_rings(batch.lonlat / UNITS, batch.starts, batch.firsts)
        drawn[list(batch.others)] = list(batch.others.values())
        parts.append(drawn)
    return np.concatenate(parts)


@dataclass(frozen=True, slots=True)
class _Way:
    """From a CRS to longitude and latitude."""

    transformer: Any
    straight: bool  # the CRS is geographic: edges stay straight, longitudes never jump
    radius: float  # of the Earth, in units of the map

    @classmethod
    def of(cls, wkt: str | None) -> "_Way":
        import pyproj
        from pyproj.exceptions import ProjError

        try:
            crs = pyproj.CRS.from_wkt(wkt or "")
            radius = crs.ellipsoid.semi_major_metre
            transformer = pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
        except (ProjError, AttributeError) as error:
            raise OutputError(
                "these regions have no place on the globe, which GeoJSON and KML need; write a .gpkg instead"
            ) from error
        if not _EARTH_RADII_M[0] < radius < _EARTH_RADII_M[1]:
            raise OutputError(
                "these regions are not on the Earth, and GeoJSON and KML are WGS 84; write a .gpkg instead"
            )
        return cls(transformer, crs.is_geographic, radius / crs.axis_info[0].unit_conversion_factor)

    def degrees(self, xy: Floats) -> Floats:
        lonlat = np.stack(self.transformer.transform(xy[:, 0], xy[:, 1]), axis=1)
        if not np.isfinite(lonlat).all():
            raise OutputError("a region reaches past the edge of its projection; write a .gpkg instead")
        return lonlat

    def mirrors(self, xy: Floats) -> bool:
        """Whether left and right change places on the way (at this vertex, and so everywhere)."""
        step = self.radius * 1e-5
        there = self.degrees(xy + np.array([[0, 0], [step, 0], [0, step]]))
        (a, b), (c, d) = np.remainder(there[1:] - there[0] + 180, 360) - 180
        return bool(a * d - b * c < 0)


def _batch(polygons: Objects, pixel: float, way: _Way) -> Batch:
    xy, starts, firsts = rings_from_polygons(shapely.orient_polygons(polygons))
    degrees = way.degrees(xy)
    if way.mirrors(xy[np.argmin(np.abs(degrees[:, 1]))]):
        xy, starts, firsts = rings_from_polygons(shapely.orient_polygons(polygons, exterior_cw=True))
        degrees = way.degrees(xy)
    far = _far_apart(xy, degrees, starts, pixel)
    if way.straight:
        degrees, crossing = _turned(degrees, starts[firsts])
    else:
        degrees, starts = _bent(xy, degrees, starts, way)
        crossing = _jumping(degrees, starts, firsts)
    lonlat = np.rint(degrees * UNITS).astype(np.int64)
    np.clip(lonlat[:, 1], -90 * UNITS, 90 * UNITS, out=lonlat[:, 1])
    kept = _without(*_without_repeats(lonlat, starts), firsts, crossing)
    broken = _collapsed(*kept) if far else _broken(*kept)
    others = {}
    for i in np.flatnonzero(crossing | broken):
        rings = [degrees[starts[r] : starts[r + 1]] for r in range(firsts[i], firsts[i + 1])]
        whole = fold(rings, not way.straight) if crossing[i] else shapely.Polygon(rings[0], rings[1:])
        others[int(i)] = _rounded(whole)
    return Batch(*_without(*kept, broken), others)


def _turned(degrees: Floats, region_starts: Integers) -> tuple[Floats, Flags]:
    """Regions moved by whole turns into -180..180; and which of them cross the antimeridian."""
    lon = degrees[:, 0]
    west = np.minimum.reduceat(lon, region_starts[:-1])
    east = np.maximum.reduceat(lon, region_starts[:-1])
    turns = np.floor((west + 180 + 0.5 / UNITS) / 360)
    if turns.any():
        lon = lon - np.repeat(360 * turns, np.diff(region_starts))
    return np.stack([lon, degrees[:, 1]], axis=1), east - 360 * turns > 180 + 0.5 / UNITS


def _jumping(degrees: Floats, starts: Integers, firsts: Integers) -> Flags:
    """Which regions have longitudes that jump, or a vertex at a pole."""
    jumps = np.abs(np.diff(degrees[:, 0])) > 180
    jumps[starts[1:-1] - 1] = False
    vertices = np.append(np.flatnonzero(jumps), np.flatnonzero(np.abs(degrees[:, 1]) > 90 - 1e-9))
    crossing = np.zeros(len(firsts) - 1, bool)
    crossing[np.searchsorted(starts[firsts], vertices, "right") - 1] = True
    return crossing


def _bent(xy: Floats, degrees: Floats, starts: Integers, way: _Way) -> tuple[Floats, Integers]:
    """More vertices on edges that would leave their course if drawn straight in longitude and latitude."""
    for _ in range(8):
        pieces = _pieces(xy, degrees, starts, way.radius)
        if pieces.max() == 1:
            break
        edge = np.repeat(np.arange(len(xy)), pieces)
        places = np.cumsum(pieces) - pieces
        along = (np.arange(len(edge)) - places[edge]) / pieces[edge]
        following = np.minimum(edge + 1, len(xy) - 1)
        xy = xy[edge] + (xy[following] - xy[edge]) * along[:, None]
        degrees = way.degrees(xy)
        starts = np.append(places, len(xy))[starts]
    return degrees, starts


def _pieces(xy: Floats, degrees: Floats, starts: Integers, radius: float) -> Integers:
    """Into how many pieces the edge from each vertex to the next has to be cut."""
    steps = np.append(np.hypot(*np.diff(xy, axis=0).T), 0)
    steps[starts[1:] - 1] = 0
    pixel = steps[steps > 0].min()
    curvature = max(np.tan(np.radians(min(np.abs(degrees[:, 1]).max(), 89.999999))), 0.3)
    if steps.max() <= np.sqrt(8 * _SAG * pixel * radius / curvature):
        return np.ones(len(xy), np.int64)
    curvatures = np.maximum(np.tan(np.radians(np.abs(degrees[:, 1]))), 0.3)
    limit = np.sqrt(8 * _SAG * pixel * radius / np.maximum(curvatures, np.roll(curvatures, -1)))
    return np.maximum(np.ceil(steps / np.maximum(limit, pixel)), 1).astype(np.int64)


def _without_repeats(lonlat: Integers, starts: Integers) -> tuple[Integers, Integers]:
    """Rings whose vertices differ each from the one before."""
    repeats = (lonlat[1:, 0] == lonlat[:-1, 0]) & (lonlat[1:, 1] == lonlat[:-1, 1])
    repeats[starts[1:-1] - 1] = False
    if not repeats.any():
        return lonlat, starts
    keep = np.concatenate([[True], ~repeats])
    return lonlat[keep], np.concatenate([[0], np.cumsum(keep)])[starts]


def _without(
    lonlat: Integers, starts: Integers, firsts: Integers, dropped: Flags
) -> tuple[Integers, Integers, Integers]:
    """Rings without those of some regions."""
    if not dropped.any():
        return lonlat, starts, firsts
    rings, vertices = np.diff(firsts), np.diff(starts)
    keep = np.repeat(~dropped, rings)
    kept_starts = np.concatenate([[0], np.cumsum(vertices[keep])])
    return lonlat[np.repeat(keep, vertices)], kept_starts, np.concatenate([[0], np.cumsum(rings * ~dropped)])


def _collapsed(lonlat: Integers, starts: Integers, firsts: Integers) -> Flags:
    """Which regions have a ring of which rounding has left less than a triangle."""
    collapsed = np.zeros(len(firsts) - 1, bool)
    short = np.flatnonzero(np.diff(starts) < 4)
    collapsed[np.searchsorted(firsts, short, "right") - 1] = True
    return collapsed


def _broken(lonlat: Integers, starts: Integers, firsts: Integers) -> Flags:
    """Which regions rounding has made invalid."""
    collapsed = _collapsed(lonlat, starts, firsts)
    lonlat, starts, firsts = _without(lonlat, starts, firsts, collapsed)
    return collapsed | ~shapely.is_valid(polygons_from_rings(lonlat / UNITS, starts, firsts))


def _far_apart(xy: Floats, degrees: Floats, starts: Integers, pixel: float) -> bool:
    """Whether polygons follow the edges of pixels so large that rounding cannot make anything touch.

    Then looking at each polygon, which takes longer than writing it, is not needed. A pixel is at least as
    wide as its area divided by the shortest edge along its height, and the other way round.
    """
    across, down = np.abs(np.diff(xy, axis=0)).T
    across[starts[1:-1] - 1] = down[starts[1:-1] - 1] = 0
    if (across * down).any():
        return False
    side = pixel / max(across[across > 0].min(), down[down > 0].min())
    some = np.flatnonzero(across + down > 0)[:: max(1, len(xy) // 1000)]
    units = np.hypot(*(degrees[some + 1] - degrees[some]).T) * UNITS / (across + down)[some]
    return bool(side * units.min() > 2.5)


def _rounded(geometry: Any) -> Any:
    """Valid, with seven decimals, exteriors counter-clockwise; as it came where nothing would be left of it."""
    rounded = shapely.set_precision(geometry, 1 / UNITS)
    return shapely.orient_polygons(geometry if rounded.is_empty else rounded)
