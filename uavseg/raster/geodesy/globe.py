"""Coordinate reference systems (CRS): kind, unit, transformers to longitude and latitude; wrapped longitudes.

The one module that asks pyproj, or GDAL in its place, about a CRS. A CRS is given as WKT, None where
coordinates are local; all coordinates are in the order x, y or longitude, latitude, whatever order the CRS
itself declares. Longitudes are wrapped, lines densified and lines split at the antimeridian here too.
"""

import math
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rasterio import Env
from rasterio.crs import CRS
from rasterio.errors import CRSError
from rasterio.warp import transform as gdal_transform

from uavseg.arrays import Floats, Integers
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError, RasterError, caused_errors
from uavseg.plain_text import shown

Transform = Callable[[Any, Any], tuple[Floats, Floats]]
"""From x and y to x and y of another CRS, arrays of one shape; infinite where there is no such place."""

WGS84 = "EPSG:4326"
MIN_DECIMALS, MAX_DECIMALS = 7, 11  # of degrees in files
_DEGREE_M = 111_320  # of latitude, and of longitude at the equator
_WGS84_RADIUS_M, _WGS84_POLAR_RADIUS_M = 6378137.0, 6356752.314245179  # semi-major and semi-minor axis
_UTM_DOMAIN_M = 1e7  # of coordinates that have a longitude and latitude in any case
_MAX_BY_GDAL = 20_000  # points, which GDAL takes one by one; pyproj takes arrays, and 60 ms to be imported
_SURE = 90  # per cent, of a CRS that is the same as a registered one
EARTH_RADII_M = (6.3e6, 6.4e6)  # ellipsoids of the Earth have their semi-major axis in here


@dataclass(frozen=True, slots=True)
class _Crs:
    """What is asked of a CRS that needs no transformation."""

    name: str
    is_geographic: bool
    is_projected: bool
    unit_name: str
    unit_factor: float  # metres, or radians, in one unit of coordinates
    radius: float | None  # semi-major axis in metres, None without an ellipsoid


@dataclass(frozen=True, slots=True)
class CrsDefinition:
    """How a file defines a CRS."""

    name: str
    authority: str | None  # such as "EPSG"; None for a CRS that none has numbered
    number: int  # 0 without an authority
    wkt1: str | None  # as GDAL writes it; None where WKT 1 cannot define it, such as one of three axes
    wkt2: str  # of 2015


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """The ellipsoid under a CRS, and the transform from the map to its longitude and latitude."""

    inverse: Transform | None  # to longitude and latitude; None if the map has them, of its pole
    unit: float  # radians in one unit of longitude and latitude
    unit_m: float  # metres, roughly, in one unit of the map
    radius: float  # semi-major axis in metres
    eccentricity2: float  # square of the first eccentricity

    def radii(self, lat: Floats) -> tuple[Floats, Floats]:
        """Return radii of curvature of the meridian and of the parallel, in metres; `lat` in radians."""
        squeeze = 1 - self.eccentricity2 * np.sin(lat) ** 2
        normal = self.radius / np.sqrt(squeeze)
        return normal * (1 - self.eccentricity2) / squeeze, normal * np.cos(lat)

    def xyz_from_xy(self, x: Floats, y: Floats) -> Floats:
        """Map coordinates (...) as geocentric coordinates (..., 3), in metres."""
        lon, lat = (x, y) if self.inverse is None else self.inverse(x, y)
        lon, lat = lon * self.unit, lat * self.unit
        normal = self.radius / np.sqrt(1 - self.eccentricity2 * np.sin(lat) ** 2)
        out = normal * np.cos(lat)
        up = normal * (1 - self.eccentricity2) * np.sin(lat)
        return np.stack([out * np.cos(lon), out * np.sin(lon), up], axis=-1)


@lru_cache(maxsize=32)
def parse_crs(wkt: str) -> Any:
    """Return the pyproj CRS of a WKT text; ProjError of pyproj if it is not that of one."""
    import pyproj

    return pyproj.CRS.from_wkt(wkt)


def crs_named(text: str) -> Any:
    """Return the horizontal pyproj CRS of a name, such as EPSG:2056; ParameterError if there is none."""
    import pyproj

    wanted = f"--crs is a CRS such as EPSG:2056, not {shown(text)}"
    with caused_errors(wanted, ParameterError, pyproj.exceptions.ProjError, form="{}"):
        crs = pyproj.CRS.from_user_input(text)
    if not (crs.is_geographic or crs.is_projected):
        raise ParameterError(f"--crs {shown(text)} is neither geographic nor projected")
    return crs


@lru_cache(maxsize=32)
def _crs_of(wkt: str | None) -> _Crs | None:
    """Return what is asked of a CRS; None where there is none, or the text is not that of one."""
    if wkt is None:
        return None
    if _utm_zone(wkt) is not None:
        return _Crs(wkt.split('"')[1], False, True, "metre", 1.0, _WGS84_RADIUS_M)
    from pyproj.exceptions import ProjError

    try:
        crs = parse_crs(wkt)
    except ProjError:
        return None
    axes, ellipsoid = crs.axis_info, crs.ellipsoid
    return _Crs(
        name=str(crs.name),
        is_geographic=bool(crs.is_geographic),
        is_projected=bool(crs.is_projected),
        unit_name=str(axes[0].unit_name) if axes else "unknown",
        unit_factor=float(axes[0].unit_conversion_factor) if axes else 1.0,
        radius=None if ellipsoid is None else float(ellipsoid.semi_major_metre),
    )


@lru_cache(maxsize=32)
def _utm_zone(wkt: str) -> CRS | None:
    """Return the CRS of a UTM zone on WGS 84, about which GDAL is asked, not pyproj; None for every other."""
    code = re.search(r'ID\["EPSG",(32[67]\d\d)\]\]$', wkt)
    if code is None or not 1 <= int(code[1]) % 100 <= 60:
        return None
    zone = CRS.from_epsg(int(code[1]))
    return zone if CRS.from_wkt(wkt) == zone else None


def utm_crs(lat: float, lon: float) -> CRS:
    """Return the CRS of the UTM zone (WGS 84) of a place in degrees."""
    zone = int(wrap_lon(lon) + 180) // 6 + 1
    return CRS.from_epsg((32600 if lat >= 0 else 32700) + zone)


def define_crs(wkt: str) -> CrsDefinition:
    """Return the definition of a CRS; if it has no number, with that of a registered one that is the same."""
    with Env():  # in which messages of GDAL are not printed
        crs = CRS.from_user_input(wkt)
        named = crs.to_authority(confidence_threshold=100)  # by itself
        if named is None:
            named = crs.to_authority(confidence_threshold=_SURE)
            registered = named and CRS.from_authority(*named)
            if registered == crs:
                crs = registered
            else:  # such as UTM in feet, which is like UTM in metres
                named = None
        authority, code = named or (None, "")
        try:
            wkt1 = crs.to_wkt(version="WKT1_GDAL")
        except CRSError:
            wkt1 = None
        number = int(code) if code.isdecimal() else 0
        wkt2 = crs.to_wkt(version="WKT2_2015")
    name = (wkt1 or wkt2).split('"')[1]
    return CrsDefinition(name, authority if number else None, number, wkt1, wkt2)


def is_geographic(wkt: str | None) -> bool:
    """Return whether coordinates are longitude and latitude."""
    crs = _crs_of(wkt)
    return crs is not None and crs.is_geographic


def is_in_metres(wkt: str | None) -> bool:
    """Return whether coordinates are metres; local ones are taken for metres."""
    crs = _crs_of(wkt)
    return wkt is None or (crs is not None and crs.is_projected and math.isclose(crs.unit_factor, 1.0))


def unit_name(wkt: str | None) -> str:
    """Return the unit of coordinates: "degrees", the name of a unit of length, or "unknown"."""
    crs = _crs_of(wkt)
    if crs is None or not (crs.is_geographic or crs.is_projected):
        return "unknown"
    return "degrees" if crs.is_geographic else crs.unit_name


def unit_factor(wkt: str | None) -> float:
    """Return metres (radians, where the CRS is geographic) in one unit of coordinates; 1 if unknown."""
    crs = _crs_of(wkt)
    return 1.0 if crs is None else crs.unit_factor


def crs_name(wkt: str | None) -> str | None:
    """Return the name of a CRS, such as "WGS 84 / UTM zone 18N"."""
    crs = _crs_of(wkt)
    return None if crs is None else crs.name


def is_on_earth(wkt: str | None) -> bool:
    """Return whether a CRS belongs to the Earth, not to another body; RasterError if it has no ellipsoid."""
    return EARTH_RADII_M[0] < equatorial_radius(wkt) < EARTH_RADII_M[1]


def equatorial_radius(wkt: str | None) -> float:
    """Return the semi-major axis of the ellipsoid of a CRS, in metres; RasterError if it has none."""
    crs = _crs_of(wkt)
    if crs is None or crs.radius is None:
        raise _no_lonlat()
    return crs.radius


@lru_cache(maxsize=32)
def lonlat_transform(wkt: str | None) -> Transform:
    """Return the transform from a CRS to longitude and latitude in degrees; RasterError if it has none.

    WGS 84 on the Earth; on another celestial body, the geographic CRS that the CRS is made from.
    """
    on_earth = is_on_earth(wkt)
    utm = _utm_zone(wkt or "")
    if utm is not None:
        return _utm_transform(utm, wkt or "")
    target = WGS84 if on_earth else parse_crs(wkt or "").geodetic_crs
    try:
        return transform_between(parse_crs(wkt or ""), target)
    except RasterError as error:
        raise _no_lonlat() from error


def _no_lonlat() -> RasterError:
    return RasterError("the coordinate reference system has no transformation to longitude and latitude")


def _utm_transform(zone: CRS, wkt: str) -> Transform:
    """Transform a UTM zone to longitude and latitude: by GDAL, and many points by pyproj, faster then."""

    @lru_cache(maxsize=1)
    def by_pyproj() -> Transform:
        return transform_between(parse_crs(wkt), WGS84)

    def transform(x: Any, y: Any) -> tuple[Floats, Floats]:
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        within = (np.abs(x) < _UTM_DOMAIN_M) & (np.abs(y) < _UTM_DOMAIN_M)
        if x.size > _MAX_BY_GDAL or not within.all():
            return by_pyproj()(x, y)
        lonlat = gdal_transform(zone, WGS84, x.ravel().tolist(), y.ravel().tolist())
        lon, lat = (np.reshape(values, x.shape)[()] for values in lonlat)
        return lon, lat

    return transform


@lru_cache(maxsize=32)
def ellipsoid_under(wkt: str | None) -> Ellipsoid | None:
    """Return the ellipsoid of a CRS; None where there is no CRS, or one without longitude and latitude."""
    if wkt is None:
        return None
    utm = _utm_zone(wkt)
    if utm is not None:
        eccentricity2 = 1 - (_WGS84_POLAR_RADIUS_M / _WGS84_RADIUS_M) ** 2
        return Ellipsoid(_utm_transform(utm, wkt), math.radians(1), 1.0, _WGS84_RADIUS_M, eccentricity2)
    from pyproj.exceptions import ProjError

    try:
        crs = parse_crs(wkt)
        base, to_base = crs.geodetic_crs, True
        if base is None:
            return None
        if base.is_derived:  # its pole is not that of the ellipsoid
            base = base.source_crs
        elif crs.is_geographic:
            to_base = False
        transform = transform_between(crs, base) if to_base else None
    except (ProjError, RasterError):
        return None
    radius = base.ellipsoid.semi_major_metre
    return Ellipsoid(
        inverse=transform,
        unit=base.axis_info[0].unit_conversion_factor,
        unit_m=unit_factor(wkt) * (radius if is_geographic(wkt) else 1.0),
        radius=radius,
        eccentricity2=1 - (base.ellipsoid.semi_minor_metre / radius) ** 2,
    )


def transform_between(source: Any, target: Any) -> Transform:
    """Return the transform between two CRS (pyproj CRS or text), x first; RasterError if there is none."""
    transform: Transform = transformer_between(source, target).transform
    return transform


def transformer_between(source: Any, target: Any, **how: bool) -> Any:
    """Return as `transform_between` the pyproj Transformer, which is chosen as its options say."""
    import pyproj

    lost = "there is no transformation between two of the coordinate reference systems"
    with caused_errors(lost, RasterError, pyproj.exceptions.ProjError):
        return pyproj.Transformer.from_crs(source, target, always_xy=True, **how)


def geod_of(wkt: str) -> Any:
    """Return the pyproj Geod (geodesics) of the ellipsoid of a CRS."""
    return parse_crs(wkt).get_geod()


@lru_cache(maxsize=1)
def geod_wgs84() -> Any:
    """Return the pyproj Geod (geodesics) of WGS 84."""
    from pyproj import Geod

    return Geod(ellps="WGS84")


def decimals_for(pixel_m: float) -> int:
    """Return the decimals of degrees (7 to 11) with which rounding moves a vertex by 1 % of a pixel at most.

    `pixel_m` is the side of a pixel in metres.

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
    """Move longitudes (or differences of them), in degrees, by turns into [around - 180, around + 180).

    Examples
    --------
    >>> wrap_lon([190.0, -180.0, 180.0]), wrap_lon([-179.0], around=170.0)
    (array([-170., -180., -180.]), array([181.]))
    """
    return around + np.remainder(np.asarray(lon, np.float64) - around + 180, 360) - 180


def wrap_lon_beyond_180(lon: Floats) -> Floats:
    """Wrap longitudes into [-180, 180]; those that lie there already, 180 included, stay exact.

    Examples
    --------
    >>> wrap_lon_beyond_180(np.array([190.0, 180.0, 0.5]))
    array([-170. ,  180. ,    0.5])
    """
    return np.where(np.abs(lon) > 180, wrap_lon(lon), lon)


def unwrap_lon(lon: Floats, turn: float = 360.0) -> Floats:
    """Let longitudes (n,) along a line run on past 180 where they jump to -180, and the other way round.

    `turn` is a whole turn in their unit.

    Examples
    --------
    >>> unwrap_lon(np.array([170.0, -175.0, 178.0]))
    array([170., 185., 178.])
    """
    unwrapped = lon.copy()
    unwrapped[1:] += turn * np.cumsum(-np.round(np.diff(lon) / turn))
    return unwrapped


def split_at_antimeridian(lonlat: Floats) -> list[Floats]:
    """Return the parts of a line on either side of the antimeridian; each ends and begins on it.

    `lonlat` (n, 2) are degrees, longitudes in [-180, 180]; a step of more than 180 degrees crosses the
    antimeridian.

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


def densify_line(vertices: Floats, pieces: Integers) -> Floats:
    """Divide each of the n - 1 edges of a line of n vertices, (n, 2), into some equal pieces, at least 1.

    Examples
    --------
    >>> densify_line(np.array([[0.0, 0.0], [2.0, 4.0], [3.0, 4.0]]), np.array([2, 1])).tolist()
    [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0], [3.0, 4.0]]
    """
    ends = np.concatenate([[0], np.cumsum(pieces)])
    steps = np.arange(ends[-1] + 1)
    return np.stack([np.interp(steps, ends, axis) for axis in vertices.T], axis=-1)


def densify_rings(vertices: Floats, starts: Integers, pieces: Integers) -> tuple[Floats, Integers]:
    """Divide each edge of closed rings into equal pieces, at the same points in both directions.

    The last of the vertices (v, 2) of a ring is its first; rings start at `starts` (r + 1,), whose last entry
    is v. `pieces` (v,) are for the edge from each vertex to the next; 1 for the last vertex of a ring. The
    results are vertices and starts again.

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
