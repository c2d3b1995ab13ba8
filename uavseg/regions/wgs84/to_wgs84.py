"""Reproject polygons to WGS 84 as GeoJSON requires: decimals as the pixels need, cut at the antimeridian.

Coordinates are integers of the last decimal in ragged arrays; the few polygons that need a geometry library
(cut at the antimeridian, around a pole, or invalid after rounding) are returned as separate geometries.

There a ring is unwrapped first, so that its longitudes never jump; one that encloses a pole is closed through
it. The planar result gets a vertex wherever it crosses an odd multiple of 180 degrees, the same in rings that
share an edge, is cut there and shifted back. Holes are processed separately and subtracted at the end.

Edges are not split by `shapely.segmentize`: it has one length for a whole polygon, and how long an edge may
be depends on its latitude; 100,000 polygons take 0.36 s in place of 0.005.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Bools, Floats, Integers, Objects
from uavseg.dataclass import dataclass
from uavseg.errors import OutputError, RasterError
from uavseg.raster.geodesy import globe
from uavseg.regions import shapes
from uavseg.regions.shapes import RaggedPolygons
from uavseg.regions.table import Regions

_AT_POLE = 90 * (1 - 1e-11)
_MAX_TURNS = 16  # around the Earth, by one region
_MAX_ADDED = 10_000_000  # vertices that may be added to the edges of a batch
PAST_EDGE = "a region reaches past the edge of its projection; write a .gpkg instead"
_SAG = 1 / 500  # largest distance of an edge from its true course, in pixels


@dataclass(frozen=True, slots=True)
class Wgs84Batch:
    """A batch of consecutive regions in WGS 84."""

    polygons: RaggedPolygons  # int64 longitudes and latitudes in units of the last of `decimals`
    decimals: int  # see `globe.decimals_for`
    others: dict[int, Any]  # geometries in degrees of regions without polygons, by index in the batch

    def geometries(self) -> Objects:
        """Return the regions as shapely geometries, in degrees."""
        degrees = replace(self.polygons, vertices=self.polygons.vertices / 10**self.decimals)
        wgs84_geometries = degrees.to_geometries()
        wgs84_geometries[list(self.others)] = list(self.others.values())
        return wgs84_geometries


def wgs84_batches(regions: Regions, vertices: int = shapes.BATCH_VERTICES) -> Iterator[Wgs84Batch]:
    """Yield the regions in WGS 84, in batches of about so many vertices.

    Exteriors run counter-clockwise, holes clockwise. An OutputError says that the CRS is of another celestial
    body or local, or that the regions exceed the domain of their projection.
    """
    if not len(regions):
        return
    reprojection = _Reprojection.of(regions.wkt)
    pixels = np.asarray(regions.columns.get("pixels", 0)).sum()
    if not (isinstance(pixels, np.number) and pixels > 0):  # regions of other programs
        pixels = shapely.get_num_coordinates(list(regions.polygons)).sum()
    pixel = shapes.total_area(regions.polygons) / pixels
    decimals = globe.decimals_for(float(np.sqrt(np.nansum(regions.columns["area_m2"]) / pixels)))
    for part in shapes.batch_slices(regions.polygons, vertices):
        yield _batch(regions.polygons[part], pixel, decimals, reprojection)


def wgs84_geometries(regions: Regions) -> Objects:
    """Return the regions in WGS 84 as shapely geometries, with the same coordinates as in GeoJSON, (n,)."""
    return np.concatenate([np.empty(0, object), *(batch.geometries() for batch in wgs84_batches(regions))])


def check_on_earth(wkt: str | None) -> None:
    """Check that a CRS is one of the Earth; raise OutputError if it is not, or there is none."""
    _Reprojection.of(wkt)


@dataclass(frozen=True, slots=True)
class _Reprojection:
    """Reprojection of a CRS to longitude and latitude in WGS 84."""

    transform: globe.Transform
    geographic: bool  # edges stay straight, and longitudes never jump
    radius: float  # of the Earth in units of the map, unless geographic
    turn: float  # 360 degrees in units of the map, if geographic

    @classmethod
    def of(cls, wkt: str | None) -> "_Reprojection":
        try:
            on_earth = globe.is_on_earth(wkt)
            transform = globe.lonlat_transform(wkt) if on_earth else None
        except RasterError as error:
            raise OutputError(
                "these regions have no place on the globe, which GeoJSON and KML need; write a .gpkg instead"
            ) from error
        if transform is None:
            raise OutputError(
                "these regions are not on the Earth, and GeoJSON and KML are WGS 84; write a .gpkg instead"
            )
        ellipsoid, unit = globe.ellipsoid_under(wkt), globe.unit_factor(wkt)
        radius = 1.0 if globe.is_geographic(wkt) else globe.equatorial_radius(wkt)
        geographic = ellipsoid is not None and ellipsoid.inverse is None
        return cls(transform, geographic, radius / unit, 2 * np.pi / unit)

    def degrees(self, xy: Floats) -> Floats:
        x, y = xy.T
        if self.geographic:
            y = np.clip(y, -self.turn / 4, self.turn / 4)
        lonlat = np.stack(self.transform(x, y), axis=1)
        if not np.isfinite(lonlat).all():
            raise OutputError(PAST_EDGE)
        if self.geographic:
            lonlat[:, 0] += 360 * np.round(x / self.turn - lonlat[:, 0] / 360)
        return lonlat

    def mirrors(self, xy: Floats) -> bool:
        """Return whether the reprojection mirrors orientation at a vertex (1, 2), and so everywhere."""
        if self.geographic:
            return False
        step = self.radius * 1e-5
        there = self.degrees(xy + np.array([[0, 0], [step, 0], [0, step]]))
        (a, b), (c, d) = globe.wrap_lon(there[1:] - there[0])
        return bool(a * d - b * c < 0)


def _batch(polygons: Objects, pixel: float, decimals: int, reprojection: _Reprojection) -> Wgs84Batch:
    flat = RaggedPolygons.from_geometries(shapely.orient_polygons(polygons))
    degrees = reprojection.degrees(flat.vertices)
    if reprojection.mirrors(flat.vertices[np.argmin(np.abs(degrees[:, 1]))]):
        flat = RaggedPolygons.from_geometries(shapely.orient_polygons(polygons, exterior_cw=True))
        degrees = reprojection.degrees(flat.vertices)
    degree = 10**decimals
    safe = _rounding_is_safe(flat, degrees * degree, pixel)
    jumping = not reprojection.geographic
    if jumping:
        flat = densify_edges(flat, degrees, np.sqrt(pixel), reprojection.radius, reprojection.degrees)
    else:
        flat = replace(flat, vertices=degrees)
    exact = replace(flat, vertices=flat.vertices * degree)
    units = np.rint(exact.vertices).astype(np.int64)
    np.clip(units[:, 1], -90 * degree, 90 * degree, out=units[:, 1])
    find_crossing = _find_jumps if jumping else _shift_turns
    rounded, crossing = find_crossing(replace(flat, vertices=units), degree)
    kept = _drop_repeats(rounded.without(crossing))
    broken = np.zeros(len(kept.regions) - 1, bool)
    broken[kept.region_of(kept.rings[:-1][np.diff(kept.rings) < 4])] = True  # rounded to less than a triangle
    if not safe:
        broken |= ~shapely.is_valid(kept.without(broken).to_geometries())
    precise = rounded if safe else exact  # cut where vertices lie, if that is possible
    others = {}
    for i in np.flatnonzero(crossing | broken).tolist():
        source = precise if crossing[i] else exact
        pieces = []
        for polygon in range(source.regions[i], source.regions[i + 1]):
            ends = source.rings[source.polygons[polygon] : source.polygons[polygon + 1] + 1]
            rings = [source.vertices[start:end].astype(np.float64) for start, end in pairwise(ends)]
            if crossing[i]:
                pieces.append(cut_at_antimeridian(rings, jumping, degree))
            else:
                pieces.append(shapely.Polygon(rings[0], rings[1:]))
        geometry = _round(shapely.union_all(pieces) if len(pieces) > 1 else pieces[0])
        others[i] = shapely.transform(geometry, lambda lonlat: lonlat / degree)
    return Wgs84Batch(polygons=kept.without(broken), decimals=decimals, others=others)


def _shift_turns(flat: RaggedPolygons, degree: int) -> tuple[RaggedPolygons, Bools]:
    """Shift regions by whole turns into -180..180, and mask those that cross the antimeridian."""
    starts = flat.rings[flat.polygons[flat.regions]]
    lon = flat.vertices[:, 0]
    west, east = np.minimum.reduceat(lon, starts[:-1]), np.maximum.reduceat(lon, starts[:-1])
    shifts = 360 * degree * ((west + 180 * degree) // (360 * degree))
    lon = lon - np.repeat(shifts, np.diff(starts))
    crossing = east - shifts > 180 * degree
    return replace(flat, vertices=np.stack([lon, flat.vertices[:, 1]], axis=1)), crossing


def _find_jumps(flat: RaggedPolygons, degree: int) -> tuple[RaggedPolygons, Bools]:
    """Return regions unchanged, and a mask of those whose longitudes jump or that have a vertex at a pole."""
    jumps = np.abs(np.diff(flat.vertices[:, 0])) > 180 * degree
    jumps[flat.rings[1:-1] - 1] = False
    at_pole = np.abs(flat.vertices[:, 1]) == 90 * degree
    crossing = np.zeros(len(flat.regions) - 1, bool)
    crossing[flat.region_of(np.append(np.flatnonzero(jumps), np.flatnonzero(at_pole)))] = True
    return flat, crossing


def _drop_repeats(flat: RaggedPolygons) -> RaggedPolygons:
    x, y = flat.vertices.T
    repeats = (x[1:] == x[:-1]) & (y[1:] == y[:-1])
    repeats[flat.rings[1:-1] - 1] = False
    if not repeats.any():
        return flat
    keep = np.concatenate([[True], ~repeats])
    rings = np.concatenate([[0], np.cumsum(keep)])[flat.rings]
    return replace(flat, vertices=flat.vertices[keep], rings=rings)


def _rounding_is_safe(flat: RaggedPolygons, units: Floats, pixel: float) -> bool:
    """Return whether polygons follow the edges of pixels so large that rounding cannot make them invalid."""
    # Then validity need not be tested for each polygon, which takes longer than writing it. A pixel is at
    # least as wide as its area divided by the shortest edge along its height, and vice versa.
    across, down = np.abs(np.diff(flat.vertices, axis=0)).T
    across[flat.rings[1:-1] - 1] = down[flat.rings[1:-1] - 1] = 0
    if (across * down).any():
        return False
    side = pixel / max(across[across > 0].min(), down[down > 0].min())
    some = np.flatnonzero(across + down > 0)[:: max(1, len(across) // 1000)]
    scale = np.hypot(*(units[some + 1] - units[some]).T) / (across + down)[some]
    return bool(side * scale.min() > 2.5)


def _round(geometry: Any) -> Any:
    """Return a valid geometry of whole numbers, exteriors counter-clockwise; unrounded if it would vanish."""
    rounded = shapely.transform(geometry, np.rint)
    if not rounded.is_valid:  # edges that nearly touch in the map may cross in degrees
        try:
            rounded = shapely.set_precision(geometry, 1)
        except shapely.errors.GEOSException:
            rounded = shapely.make_valid(geometry, method="structure", keep_collapsed=False)
    parts = shapely.get_parts(shapely.orient_polygons(geometry if rounded.is_empty else rounded))
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts.tolist())


def cut_at_antimeridian(rings: Sequence[Floats], jumping: bool, degree: float = 1.0) -> Any:
    """Cut one polygon into longitudes -180..180 and latitudes -90..90.

    Its closed rings are longitudes and latitudes, (m, 2): the exterior, counter-clockwise as seen from above,
    then the holes, clockwise. `jumping` tells whether longitudes jump from 180 to -180 where a ring crosses
    the antimeridian, or continue past 180 or -180. `degree` is a degree in the unit of the rings, and of the
    result.

    Examples
    --------
    >>> ring = np.array([[170, 0], [190, 0], [190, 10], [170, 10], [170, 0]])
    >>> cut_at_antimeridian([ring], jumping=False).bounds
    (-180.0, 0.0, 180.0, 10.0)
    """
    exterior, *holes = (
        _cut_ring(ring if i == 0 else ring[::-1], jumping, degree) for i, ring in enumerate(rings)
    )
    return shapely.difference(exterior, shapely.union_all(holes)) if holes else exterior


def _cut_ring(ring: Floats, jumping: bool, degree: float) -> Any:
    """Return the area to the left of a ring."""
    if jumping:
        ring = _split_at_poles(ring, degree)
        ring = np.stack([globe.unwrap_lon(ring[:, 0], 360 * degree), ring[:, 1]], axis=1)
        ring = _close_at_pole(ring, degree)
    width = np.ptp(ring[:, 0])
    if not width <= 360 * degree * _MAX_TURNS:
        raise OutputError(
            f"a region is {width / degree:.3g} degrees wide; the georeference of the raster is damaged"
        )
    polygon = shapely.Polygon(_with_crossings(ring, degree))
    west, _, east, _ = np.array(polygon.bounds) / degree
    bands = range(int(np.floor((west + 180) / 360)), int(np.ceil((east + 180) / 360)))
    try:
        return shapely.union_all([_band_of(polygon, 360.0 * k, degree) for k in bands])
    except shapely.errors.GEOSException as error:  # far outside of a projection, outlines cross themselves
        raise OutputError(PAST_EDGE) from error


def _split_at_poles(ring: Floats, degree: float) -> Floats:
    """Split a vertex at a pole, which has every longitude, into two at the longitudes of its neighbours."""
    at_pole = np.abs(ring[:, 1]) > _AT_POLE * degree
    if not at_pole.any():
        return ring
    open_ring = np.roll(ring[:-1], -int(np.argmin(at_pole[:-1])), axis=0)
    at_pole = np.abs(open_ring[:, 1]) > _AT_POLE * degree
    twice = np.repeat(open_ring, 1 + at_pole, axis=0)
    second = np.flatnonzero(np.repeat(at_pole, 1 + at_pole))
    twice[second[0::2], 0] = twice[second[0::2] - 1, 0]
    twice[second[1::2], 0] = np.roll(twice[:, 0], -1)[second[1::2]]
    return np.concatenate([twice, twice[:1]])


def _close_at_pole(ring: Floats, degree: float) -> Floats:
    """Return a ring that ends a turn away from its start, closed through the pole on its left."""
    turn = ring[-1, 0] - ring[0, 0]
    if abs(turn) < 180 * degree:
        return ring
    pole = np.copysign(90.0 * degree, turn)
    nearest = int(np.argmax(ring[:-1, 1] * np.sign(pole)))
    ring = np.concatenate([ring[nearest:-1], ring[: nearest + 1] + np.array([turn, 0])])
    return np.concatenate([ring, [[ring[-1, 0], pole], [ring[0, 0], pole], ring[0]]])


def _with_crossings(ring: Floats, degree: float) -> Floats:
    """Return a ring with a vertex wherever it crosses an odd multiple of 180 degrees."""
    half, turn = 180 * degree, 360 * degree
    west, east = (side(ring[:-1, 0], ring[1:, 0]) for side in (np.minimum, np.maximum))  # of each edge
    first, last = np.floor((west - half) / turn) + 1, np.ceil((east - half) / turn) - 1
    counts = np.maximum(last - first + 1, 0).astype(np.int64)
    edge = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    here, there = ring[edge], ring[edge + 1]
    forward = here[:, 0] < there[:, 0]
    lon = half + turn * np.where(forward, first[edge] + step, last[edge] - step)
    # From the western end, so that the result depends neither on the direction nor on whole turns.
    from_lon, from_lat = np.where(forward, here.T, there.T)
    to_lon, to_lat = np.where(forward, there.T, here.T)
    lat = from_lat + (to_lat - from_lat) * ((lon - from_lon) / (to_lon - from_lon))
    return np.insert(ring, edge + 1, np.stack([lon, lat], axis=1), axis=0)


def _band_of(polygon: Any, centre: float, degree: float) -> Any:
    """Return the part of a polygon within 180 degrees of a meridian, shifted to longitude 0."""
    box = shapely.box(*(np.array([centre - 180, -90, centre + 180, 90]) * degree))
    parts = shapely.get_parts(shapely.intersection(polygon, box))
    areas = shapely.union_all(parts[shapely.area(parts) > 0])
    return shapely.transform(areas, lambda lonlat: lonlat - [centre * degree, 0])


def densify_edges(
    flat: RaggedPolygons, degrees: Floats, side: float, radius: float, to_degrees: Callable[[Floats], Floats]
) -> RaggedPolygons:
    """Add vertices to edges of rings that would deviate if they were straight in degrees.

    The rings, the side of a pixel and the radius of the Earth are in units of the map; `degrees`, (v, 2), are
    the longitudes and latitudes of the vertices, and `to_degrees` computes them, both of (m, 2) arrays. An
    OutputError says that edges are so long that millions of vertices would be added.
    """
    xy, starts = flat.vertices, flat.rings
    for _ in range(8):
        pieces = _pieces(xy, degrees, starts, side, radius)
        if pieces.max() == 1:
            break
        if pieces.sum() > 10 * len(xy) + _MAX_ADDED:
            longest = np.hypot(*np.diff(xy, axis=0).T).max()
            raise OutputError(
                f"outlines have edges of up to {longest:.3g} map units, which is too long for the Earth; "
                "the georeference of the raster is damaged"
            )
        xy, starts = globe.densify_rings(xy, starts, pieces)
        degrees = to_degrees(xy)
    return replace(flat, vertices=degrees, rings=starts)


def _pieces(xy: Floats, degrees: Floats, starts: Integers, side: float, radius: float) -> Integers:
    """Return the number of pieces to split each edge, from a vertex to the next, into."""
    steps = np.append(np.hypot(*np.diff(xy, axis=0).T), 0)
    steps[starts[1:] - 1] = 0
    slope = np.abs(degrees[:, 1])
    if steps.max() <= _straight_enough(slope.max(), side, radius):
        return np.ones(len(xy), np.int64)
    limit = _straight_enough(np.maximum(slope, np.roll(slope, -1)), side, radius)
    return np.asarray(np.clip(np.ceil(steps / np.maximum(limit, side / 16)), 1, 1 << 32).astype(np.int64))


def _straight_enough(lat: Any, side: float, radius: float) -> Any:
    """Return the longest edge with a sag of _SAG pixels at a latitude: meridians converge to the poles."""
    curvature = np.maximum(np.tan(np.radians(np.minimum(lat, 89.999999))), 0.3) / radius
    return np.sqrt(8 * _SAG * side / curvature)
