"""Coordinate reference systems (CRS): kind, unit, transformers to longitude and latitude; wrapped longitudes.

The one module that asks pyproj about a CRS. A CRS is given as WKT, None where coordinates are local; all
coordinates are in the order x, y or longitude, latitude, whatever order the CRS itself declares. Longitudes
are wrapped, lines densified and lines split at the antimeridian here too.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavseg.errors import RasterError
from uavseg.plain_text import cause_of

Floats = NDArray[np.float64]
Transform = Callable[[Any, Any], tuple[Floats, Floats]]
"""From x and y to x and y of another CRS, arrays of one shape; infinite where there is no such place."""

WGS84 = "EPSG:4326"
MIN_DECIMALS, MAX_DECIMALS = 7, 11  # of degrees in files
_DEGREE_M = 111_320  # of latitude, and of longitude at the equator
EARTH_RADII_M = (6.3e6, 6.4e6)  # ellipsoids of the Earth have their semi-major axis in here


@lru_cache(maxsize=32)
def parse_crs(wkt: str) -> Any:
    """The pyproj CRS of a WKT text.

    Raises
    ------
    pyproj.exceptions.ProjError
        If the text is not that of a CRS.
    """
    import pyproj

    return pyproj.CRS.from_wkt(wkt)


def is_geographic(wkt: str | None) -> bool:
    """Whether coordinates are longitude and latitude."""
    return _is_kind(wkt, "is_geographic")


def is_in_metres(wkt: str | None) -> bool:
    """Whether coordinates are metres; local ones are taken for metres."""
    return wkt is None or (_is_kind(wkt, "is_projected") and math.isclose(unit_factor(wkt), 1.0))


def _is_kind(wkt: str | None, kind: str) -> bool:
    from pyproj.exceptions import ProjError

    try:
        return wkt is not None and bool(getattr(parse_crs(wkt), kind))
    except ProjError:
        return False


def unit_name(wkt: str | None) -> str:
    """The unit of coordinates: "degrees", the name of a unit of length, or "unknown"."""
    if is_geographic(wkt):
        return "degrees"
    return str(parse_crs(wkt).axis_info[0].unit_name) if wkt and _is_kind(wkt, "is_projected") else "unknown"


@lru_cache(maxsize=32)
def unit_factor(wkt: str | None) -> float:
    """Metres (radians, where the CRS is geographic) in one unit of coordinates; 1 where that is unknown."""
    if wkt is None:
        return 1.0
    axes = parse_crs(wkt).axis_info
    return float(axes[0].unit_conversion_factor) if axes else 1.0


def crs_name(wkt: str | None) -> str | None:
    """The name of a CRS, such as "WGS 84 / UTM zone 18N"."""
    return None if wkt is None else str(parse_crs(wkt).name)


def is_on_earth(wkt: str | None) -> bool:
    """Whether a CRS belongs to the Earth, and not to another celestial body.

    Raises
    ------
    RasterError
        If it belongs to neither: it has no ellipsoid.
    """
    return EARTH_RADII_M[0] < equatorial_radius(wkt) < EARTH_RADII_M[1]


def equatorial_radius(wkt: str | None) -> float:
    """Semi-major axis of the ellipsoid of a CRS, in metres.

    Raises
    ------
    RasterError
        If the CRS has no ellipsoid.
    """
    from pyproj.exceptions import ProjError

    try:
        return float(parse_crs(wkt or "").ellipsoid.semi_major_metre)
    except (ProjError, AttributeError) as error:
        raise _no_lonlat() from error


@lru_cache(maxsize=32)
def lonlat_transform(wkt: str | None) -> Transform:
    """From a CRS to longitude and latitude in degrees.

    WGS 84 on the Earth; on another celestial body, the geographic CRS that the CRS is made from.

    Raises
    ------
    RasterError
        If the CRS has no longitude and latitude.
    """
    from pyproj.exceptions import ProjError

    target = WGS84 if is_on_earth(wkt) else parse_crs(wkt or "").geodetic_crs
    try:
        return _transformer(parse_crs(wkt or ""), target)
    except ProjError as error:
        raise _no_lonlat() from error


def _no_lonlat() -> RasterError:
    return RasterError("the coordinate reference system has no transformation to longitude and latitude")


def geodetic_base(wkt: str | None) -> tuple[Any, Transform | None] | None:
    """The geographic CRS that a CRS is made from, and the transform to it.

    Returns
    -------
    (pyproj CRS, Transform or None), or None
        No transform where the CRS is geographic itself and its pole is that of the ellipsoid; None where it
        has no geographic CRS at all.
    """
    from pyproj.exceptions import ProjError

    if wkt is None:
        return None
    try:
        crs = parse_crs(wkt)
        base = crs.geodetic_crs
        if base is None:
            return None
        if base.is_derived:  # its pole is not that of the ellipsoid
            base = base.source_crs
        elif crs.is_geographic:
            return base, None
        return base, _transformer(crs, base)
    except ProjError:
        return None


def transform_between(source: Any, target: Any) -> Transform:
    """From one CRS to another, each a pyproj CRS or a text; x (longitude) first on both sides.

    Raises
    ------
    RasterError
        If one is not a CRS, or there is no transformation.
    """
    from pyproj.exceptions import ProjError

    try:
        return _transformer(source, target)
    except ProjError as error:
        reason = cause_of(error)
        raise RasterError(
            f"there is no transformation between two of the coordinate reference systems ({reason})"
        ) from error


def _transformer(source: Any, target: Any) -> Transform:
    import pyproj

    transform: Transform = pyproj.Transformer.from_crs(source, target, always_xy=True).transform
    return transform


def geod_of(wkt: str) -> Any:
    """The pyproj Geod (geodesics) of the ellipsoid of a CRS."""
    return parse_crs(wkt).get_geod()


@lru_cache(maxsize=1)
def geod_wgs84() -> Any:
    """The pyproj Geod (geodesics) of WGS 84."""
    from pyproj import Geod

    return Geod(ellps="WGS84")


def decimals_for(pixel_m: float) -> int:
    """Decimals of degrees with which rounding moves a vertex by a hundredth of a pixel at most; 7 to 11.

    Parameters
    ----------
    pixel_m : float
        Side of a pixel in metres.

    Examples
    --------
    >>> [decimals_for(side) for side in (30, 1, 0.5, 0.05, 0.003)]
    [7, 7, 8, 9, 10]
    """
    if not pixel_m > 0:
        return MIN_DECIMALS
    needed = np.ceil(np.log10(_DEGREE_M / 2 / (pixel_m / 100)))
    return int(np.clip(needed, MIN_DECIMALS, MAX_DECIMALS))


def wrap_lon(lon: ArrayLike, around: float = 0.0) -> Floats:
    """Longitudes (or differences of them), in degrees, moved by turns into [around - 180, around + 180).

    Examples
    --------
    >>> wrap_lon([190.0, -180.0, 180.0]), wrap_lon([-179.0], around=170.0)
    (array([-170., -180., -180.]), array([181.]))
    """
    wrapped: Floats = around + np.remainder(np.asarray(lon, np.float64) - around + 180, 360) - 180
    return wrapped


def wrap_lon_beyond_180(lon: Floats) -> Floats:
    """Longitudes in [-180, 180]; those that lie there already, 180 included, keep their exact value.

    Examples
    --------
    >>> wrap_lon_beyond_180(np.array([190.0, 180.0, 0.5]))
    array([-170. ,  180. ,    0.5])
    """
    return np.where(np.abs(lon) > 180, wrap_lon(lon), lon)


def unwrap_lon(lon: Floats, turn: float = 360.0) -> Floats:
    """Longitudes along a line that run on past 180 where they jumped to -180, and the other way round.

    Parameters
    ----------
    lon : (n,) float64 array
    turn : float
        A whole turn in its unit.

    Examples
    --------
    >>> unwrap_lon(np.array([170.0, -175.0, 178.0]))
    array([170., 185., 178.])
    """
    unwrapped = lon.copy()
    unwrapped[1:] += turn * np.cumsum(-np.round(np.diff(lon) / turn))
    return unwrapped


def split_at_antimeridian(lonlat: Floats) -> list[Floats]:
    """The parts of a line on either side of the antimeridian; each ends and begins on it.

    Parameters
    ----------
    lonlat : (n, 2) float64 array
        Degrees, longitudes in [-180, 180]; a step of more than 180 degrees crosses the antimeridian.

    Examples
    --------
    >>> [part.tolist() for part in split_at_antimeridian(np.array([[179.0, 0.0], [-179.0, 2.0]]))]
    [[[179.0, 0.0], [180.0, 1.0]], [[-180.0, 1.0], [-179.0, 2.0]]]
    """
    jumps = np.flatnonzero(np.abs(np.diff(lonlat[:, 0])) > 180)
    parts, begin = [], lonlat[:0]
    last = 0
    for k in jumps.tolist():
        (lon, lat), (next_lon, next_lat) = lonlat[k], lonlat[k + 1]
        edge = np.copysign(180.0, lon)
        share = (edge - lon) / (next_lon + 2 * edge - lon) if next_lon + 2 * edge != lon else 0.0
        crossing = lat + share * (next_lat - lat)
        parts.append(np.concatenate([begin, lonlat[last : k + 1], [[edge, crossing]]]))
        begin, last = np.array([[-edge, crossing]]), k + 1
    return [*parts, np.concatenate([begin, lonlat[last:]])]


def densify_line(vertices: Floats, pieces: NDArray[np.int64]) -> Floats:
    """A line of n vertices, (n, 2), with each of its n - 1 edges divided into some equal pieces, at least 1.

    Examples
    --------
    >>> densify_line(np.array([[0.0, 0.0], [2.0, 4.0], [3.0, 4.0]]), np.array([2, 1])).tolist()
    [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0], [3.0, 4.0]]
    """
    ends = np.concatenate([[0], np.cumsum(pieces)])
    steps = np.arange(ends[-1] + 1)
    return np.stack([np.interp(steps, ends, axis) for axis in vertices.T], axis=-1)


def densify_rings(
    vertices: Floats, starts: NDArray[np.int64], pieces: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.int64]]:
    """Closed rings with each of their edges divided into equal pieces, at the same points in both directions.

    Parameters
    ----------
    vertices : (v, 2) float64 array
        The last vertex of a ring is its first.
    starts : (r + 1,) int64 array
        Where each ring starts in `vertices`; the last entry is v.
    pieces : (v,) int64 array
        For the edge from each vertex to the next; 1 for the last vertex of a ring.

    Returns
    -------
    vertices : (sum of pieces, 2) float64 array
    starts : (r + 1,) int64 array

    Examples
    --------
    >>> ring = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 0.0]])
    >>> dense, starts = densify_rings(ring, np.array([0, 4]), np.array([2, 1, 1, 1]))
    >>> dense.tolist(), starts.tolist()
    ([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 0.0]], [0, 5])
    """
    edge = np.repeat(np.arange(len(vertices)), pieces)
    first = np.cumsum(pieces) - pieces
    steps, following = np.arange(len(edge)) - first[edge], np.minimum(edge + 1, len(vertices) - 1)
    # From the smaller end: regions that share an edge run along it in opposite directions.
    (x, y), (next_x, next_y) = vertices[edge].T, vertices[following].T
    back = (x > next_x) | ((x == next_x) & (y > next_y))
    start, end = np.where(back, following, edge), np.where(back, edge, following)
    share = np.where(back, pieces[edge] - steps, steps) / pieces[edge]
    dense = vertices[start] + (vertices[end] - vertices[start]) * share[:, None]
    dense[first] = vertices
    return dense, np.append(first, len(dense))[starts]
