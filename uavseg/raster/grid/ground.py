"""Areas and lengths on the ellipsoid of rings along pixel edges, in any coordinate reference system.

The ground size of a pixel (the areal scale factor) varies slowly over a raster. It is sampled on the
ellipsoid, interpolated by Chebyshev polynomials, split by a singular value decomposition into a short sum of
products of a function of the row and one of the column, and integrated once into tables over rows and
columns. An area is then a sum around a ring (Green's theorem), and the length of an edge a difference of two
table entries. Rows of a geographic raster are integrated between their parallels directly.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.arrays import Floats
from uavseg.dataclass import dataclass
from uavseg.errors import RasterError
from uavseg.raster.geodesy.globe import Ellipsoid, densify_line, ellipsoid_under, geod_wgs84, unit_factor
from uavseg.raster.grid.geobox import GeoBox

Integers = NDArray[np.integer[Any]]

_CHUNK = 1 << 20  # vertices measured at a time
_MAX_NODES = 128  # of the interpolation, along rows and along columns
_TOLERANCE = 1e-11  # relative, of the last coefficients
_STEP = 1 / 1600  # of finite differences, in radii of the ellipsoid: 4 km on the Earth
TOLERANCE_DEG = 5e-8  # of the interpolation: half a centimetre
MAX_INTERVALS = 256
AREA_TOLERANCE = 1e-3  # of the area of a pixel, between neighbouring parts
MAX_AREA_INTERVALS = 64  # more would make a page large; only rasters of a continent need them
MAX_LATITUDE = 85.0  # Web Mercator ends at 85.05 degrees
_Product = tuple[Floats, Floats]
"""Rows (k, rows + 1) and columns (k, cols + 1): the sum over k of their products at pixel corners."""
_Tables = tuple[_Product, _Product, _Product]
"""Integrals at pixel corners: of the area over rows and columns, of lengths of rows, and of columns."""
_NOTHING = np.empty((0, 1)), np.empty((0, 1))  # the sum of no products: 0 everywhere


def ring_areas(geobox: GeoBox, vertices: Integers, starts: Integers) -> Floats:
    """Return the signed ground areas (r,) of rings along pixel edges, in square metres (or square map units).

    Map units are for a raster without CRS. `vertices` (v, 2) are pixel corners (row, col), with horizontal or
    vertical edges; a ring is not closed, and starts in them at `starts` (r + 1,), whose last entry is v.
    Areas are positive for rings that run clockwise on the image, negative for the others, as holes do.

    Examples
    --------
    >>> from affine import Affine
    >>> box = GeoBox((10, 10), Affine(2.0, 0.0, 0.0, 0.0, -2.0, 0.0), None)
    >>> ring_areas(box, np.array([[0, 0], [0, 3], [1, 3], [1, 0]]), np.array([0, 4]))
    array([12.])
    """
    return _sum_over_rings((_NOTHING, _tables(geobox)[0]), vertices, starts)


def ring_perimeters(geobox: GeoBox, vertices: Integers, starts: Integers) -> Floats:
    """Return ground lengths of rings in metres (map units without a CRS); parameters are of `ring_areas`."""
    return _sum_over_rings(_tables(geobox)[1:], vertices, starts, np.abs)


def ground_resolution(geobox: GeoBox) -> tuple[float, float]:
    """Return ground metres (without CRS map units) per pixel at the centre, along a row and a column."""
    return ground_steps(geobox, geobox.shape[0] / 2, geobox.shape[1] / 2)


def ground_steps(geobox: GeoBox, row: float, col: float) -> tuple[float, float]:
    """Return ground metres (without CRS map units) per pixel at a position, along a row and a column."""
    per_col, per_row, _ = pixel_on_ground(geobox, np.array([row]), np.array([col]))
    if np.isfinite(per_col[0]) and np.isfinite(per_row[0]):
        return float(per_col[0]), float(per_row[0])
    return pixel_on_map(geobox)[:2]


def pixel_on_ground(geobox: GeoBox, row: Floats, col: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the ground size of pixels at positions, whole numbers being corners, by finite differences.

    These are of points in space, of fourth order. The results are metres per pixel along a row and along a
    column, and square metres per pixel (units of the map where there is no CRS), of the broadcast shape of
    `row` and `col`; not finite where the projection ends.
    """
    ellipsoid = ellipsoid_under(geobox.wkt)
    row, col = np.broadcast_arrays(row, col)
    if ellipsoid is None:
        along_row, along_col, area = (np.full(row.shape, value) for value in pixel_on_map(geobox))
        return along_row, along_col, area
    t = geobox.transform
    steps = ellipsoid.radius * _STEP / (ellipsoid.unit_m * np.hypot([t.a, t.b], [t.d, t.e]))

    def point(row: Floats, col: Floats) -> Floats:
        return ellipsoid.xyz_from_xy(*geobox.xy_from_pixel(row, col))

    with np.errstate(invalid="ignore", over="ignore"):
        per_col = _derivative(lambda by: point(row, col + by), steps[0])
        per_row = _derivative(lambda by: point(row + by, col), steps[1])
        normal = np.cross(per_col, per_row)
        along_row, along_col, area = (np.sqrt((v * v).sum(axis=-1)) for v in (per_col, per_row, normal))
    return along_row, along_col, area


def pixel_on_map(geobox: GeoBox) -> tuple[float, float, float]:
    """Return a pixel's width, height and area in the plane of the map: in metres where its unit is known."""
    t, unit = geobox.transform, unit_factor(geobox.wkt)
    along_row, along_col = np.hypot([t.a, t.b], [t.d, t.e]) * unit
    return float(along_row), float(along_col), abs(t.determinant) * unit**2


def _derivative(point: Callable[[float], Floats], step: float) -> Floats:
    """Compute the derivative of points by central differences of fourth order."""
    near, far = point(step) - point(-step), point(2 * step) - point(-2 * step)
    return (8 * near - far) / (12 * step)


def line_length(geobox: GeoBox, row: Floats, col: Floats) -> float:
    """Return the ground length of a polyline on a raster, whose edges are straight on the map.

    It is in metres on the ellipsoid, or map units if there is no CRS; pixel corners are whole numbers.

    Examples
    --------
    >>> from affine import Affine
    >>> box = GeoBox((10, 10), Affine(2, 0, 0, 0, -2, 0), None)
    >>> line_length(box, np.array([0.5, 4.5]), np.array([1.5, 4.5]))
    10.0
    """
    ellipsoid = ellipsoid_under(geobox.wkt)
    pieces = np.maximum(np.maximum(np.abs(np.diff(row)), np.abs(np.diff(col))), 1).astype(np.int64)
    rows, cols = densify_line(np.stack([row, col], axis=-1), pieces).T
    x, y = geobox.xy_from_pixel(rows, cols)
    points = np.stack([x, y], axis=-1) if ellipsoid is None else ellipsoid.xyz_from_xy(x, y)
    steps = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    return float(steps.sum()) * (unit_factor(geobox.wkt) if ellipsoid is None else 1.0)


def _sum_over_rings(
    tables: Sequence[_Product],
    vertices: Integers,
    starts: Integers,
    of_edge: Callable[[Floats], Floats] = np.asarray,
) -> Floats:
    """Sum over rings what is measured of each edge by the tables of horizontal and vertical ones."""
    corners = np.ascontiguousarray(vertices, np.int32)
    starts = np.ascontiguousarray(starts, np.int64)
    factors = [np.ascontiguousarray(table) for product in tables for table in product]
    sums = np.zeros(len(starts) - 1)
    ring = 0
    while ring < len(sums):
        last = int(np.searchsorted(starts, starts[ring] + _CHUNK, "right")) - 1
        last = max(last, ring + 1)
        edges = np.empty(starts[last] - starts[ring])
        _measure_edges(corners, starts[ring : last + 1], *factors, edges)
        sums[ring:last] = np.add.reduceat(of_edge(edges), starts[ring:last] - starts[ring])
        ring = last
    return sums


@kernel("void(i4[:,::1], i8[::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1])")
def _measure_edges(vertices, starts, rows, cols, rows_down, cols_down, measures):  # type: ignore[no-untyped-def]
    """Measure edges of rings along rows and columns, signed: length, or area up to the first column."""
    for ring in range(len(starts) - 1):
        first, end = starts[ring], starts[ring + 1]
        for i in range(first, end):
            following = i + 1 if i + 1 < end else first
            row, below = vertices[i, 0], vertices[following, 0]
            col, right = vertices[i, 1], vertices[following, 1]
            measure = 0.0
            if row == below:
                for k in range(rows.shape[0]):
                    measure += rows[k, row] * (cols[k, right] - cols[k, col])
            else:
                for k in range(rows_down.shape[0]):
                    measure += (rows_down[k, below] - rows_down[k, row]) * cols_down[k, col]
            measures[i - starts[0]] = measure


@lru_cache(maxsize=4)
def _tables(geobox: GeoBox) -> _Tables:
    ellipsoid = ellipsoid_under(geobox.wkt)
    fitted = None  # polynomials for the lengths and the area of pixels over the raster
    if ellipsoid is not None:
        if ellipsoid.inverse is None and geobox.transform.b == 0 == geobox.transform.d:
            return _geographic_tables(geobox, ellipsoid)
        fitted = _interpolate(geobox)
        fitted = _least_squares(geobox) if fitted is None else fitted
    if fitted is None:  # pixels of equal ground size
        per_col, per_row, size = pixel_on_map(geobox)
        rows, cols = (np.arange(length + 1.0)[None] for length in geobox.shape)
        ones = np.ones_like
        return (rows, cols * size), (ones(rows), cols * per_col), (rows * per_row, ones(cols))
    along_rows, along_cols, area = fitted
    lengths = _product(geobox, along_rows, False, True), _product(geobox, along_cols, True, False)
    return _product(geobox, area, True, True), *lengths


def _geographic_tables(geobox: GeoBox, ellipsoid: Ellipsoid) -> _Tables:
    """Make tables for a geographic raster whose rows are parallels; no ground lies beyond the poles."""
    rows, cols = (np.arange(length + 1.0) for length in geobox.shape)
    lat = np.clip((geobox.transform.f + geobox.transform.e * rows) * ellipsoid.unit, -np.pi / 2, np.pi / 2)
    cols = cols * abs(geobox.transform.a * ellipsoid.unit)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(lat)[:, None] / 2
    meridian, parallel = ellipsoid.radii(lat[:-1, None] + half * (1 + nodes))
    arcs = np.abs(half) * weights * meridian
    areas, lengths = (np.append(0.0, np.cumsum(of.sum(axis=1)))[None] for of in (arcs * parallel, arcs))
    along_rows = ellipsoid.radii(lat)[1][None], cols[None]
    return (areas, cols[None]), along_rows, (lengths, np.ones((1, len(cols))))


def _interpolate(geobox: GeoBox) -> Floats | None:
    """Interpolate by Chebyshev coefficients (3, m, n), as many as needed; None if ground is missing."""
    shape = [8, 8]
    while True:
        nodes = [np.cos(np.pi * (np.arange(n) + 0.5) / n) for n in shape]
        row, col = (length * (1 + x) / 2 for length, x in zip(geobox.shape, nodes, strict=True))
        samples = np.stack(pixel_on_ground(geobox, row[:, None], col[None, :]))
        if not np.isfinite(samples).all():
            return None
        into_rows, into_cols = (_from_nodes(x) for x in nodes)
        fitted: Floats = into_rows @ samples @ into_cols.T
        size = np.abs(fitted).max(axis=(1, 2), keepdims=True) * _TOLERANCE
        tails = [(np.abs(fitted[:, -2:, :]) > size).any(), (np.abs(fitted[:, :, -2:]) > size).any()]
        if not any(tails):
            return fitted
        shape = [2 * n if tail else n for n, tail in zip(shape, tails, strict=True)]
        if max(shape) > _MAX_NODES:
            return None


def _from_nodes(x: Floats) -> Floats:
    """Return the matrix from values at Chebyshev nodes to coefficients."""
    matrix: Floats = chebyshev.chebvander(x, len(x) - 1).T * 2 / len(x)
    matrix[0] /= 2
    return matrix


def _least_squares(geobox: GeoBox, degree: int = 16) -> Floats | None:
    """Return the same by least squares, for a raster that extends past the domain of its projection."""
    x, y = np.meshgrid(np.linspace(-1, 1, 49), np.linspace(-1, 1, 49))
    row, col = (length * (1 + at) / 2 for length, at in zip(geobox.shape, (y, x), strict=True))
    samples = np.stack(pixel_on_ground(geobox, row, col))
    inside = np.isfinite(samples).all(axis=0)
    if inside.sum() < 4 * (degree + 1) ** 2:
        return None
    basis = chebyshev.chebvander2d(y[inside], x[inside], [degree, degree])
    fitted = np.linalg.lstsq(basis, samples[:, inside].T, rcond=1e-12)[0]
    return np.ascontiguousarray(fitted.T).reshape(3, degree + 1, degree + 1)


def _product(geobox: GeoBox, fitted: Floats, over_rows: bool, over_cols: bool) -> _Product:
    """Write a bivariate polynomial as a sum of products at pixel corners, integrated over rows or columns."""
    left, sizes, right = np.linalg.svd(fitted)
    terms = max(1, int((sizes > sizes[0] * 1e-12).sum()))
    in_rows, in_cols = left[:, :terms] * sizes[:terms], right[:terms].T
    rows, cols = geobox.shape
    return _at_corners(in_rows, rows, over_rows), _at_corners(in_cols, cols, over_cols)


def _at_corners(polynomials: Floats, length: int, integrated: bool) -> Floats:
    series = chebyshev.chebint(polynomials, lbnd=-1, scl=length / 2) if integrated else polynomials
    return np.asarray(chebyshev.chebval(np.linspace(-1, 1, length + 1), series), np.float64)


@dataclass(frozen=True)
class GroundGrid:
    """Longitude and latitude of pixel corners that divide a raster evenly."""

    lon: Floats  # (n + 1, n + 1), in degrees
    lat: Floats
    pixel_m2: Floats  # (n, n), area of a pixel on the ellipsoid, as the mean of each part


def ground_grid(geobox: GeoBox) -> GroundGrid:
    """Return the coarsest table between whose places interpolation errs by half a centimetre at most.

    A RasterError says that a part of the raster has no longitude and latitude or lies beyond 85 degrees of
    latitude, or that it crosses the antimeridian: a map in Web Mercator cannot show it.
    """
    intervals = 4
    while True:
        lon, lat = _corners(geobox, 2 * intervals)
        areas = _pixel_areas(geobox, lon[::2, ::2], lat[::2, ::2])
        is_coarse = intervals < MAX_INTERVALS and _error(lon, lat) > TOLERANCE_DEG
        largest = max(float(np.abs(np.diff(areas, axis=axis)).max()) for axis in (0, 1)) / float(areas.min())
        if not is_coarse and (intervals >= MAX_AREA_INTERVALS or largest <= AREA_TOLERANCE):
            return GroundGrid(lon[::2, ::2], lat[::2, ::2], areas)
        intervals *= 2


def _pixel_areas(geobox: GeoBox, lon: Floats, lat: Floats) -> Floats:
    intervals = len(lon) - 1
    rows, cols = geobox.shape
    areas = [
        abs(geod_wgs84().polygon_area_perimeter(x, y)[0])
        for x, y in zip(_quadrilaterals(lon), _quadrilaterals(lat), strict=True)
    ]
    pixels = rows / intervals * (cols / intervals)
    return np.reshape(areas, (intervals, intervals)) / pixels


def _corners(geobox: GeoBox, intervals: int) -> tuple[Floats, Floats]:
    rows, cols = (np.linspace(0, length, intervals + 1) for length in geobox.shape)
    lon, lat = geobox.lonlat_from_xy(*geobox.xy_from_pixel(*np.meshgrid(rows, cols, indexing="ij")))
    if not (np.isfinite(lon).all() and np.isfinite(lat).all()):
        raise RasterError("a part of the raster has no longitude and latitude, so a map cannot show it")
    if np.abs(lat).max() > MAX_LATITUDE:
        raise RasterError(
            f"the raster reaches {np.abs(lat).max():.1f} degrees of latitude; a map in Web Mercator shows "
            f"up to {MAX_LATITUDE:g}: draw it with uavseg preview"
        )
    if lon.max() - lon.min() > 180:
        raise RasterError(
            "the raster crosses the antimeridian, where a map in Web Mercator is cut: split it there, or "
            "draw it with uavseg preview"
        )
    return lon, lat


def _error(lon: Floats, lat: Floats) -> float:
    """Return largest difference between every second place and the mean of its neighbours."""
    worst = 0.0
    for values in (lon, lat):
        known = values[::2, ::2]
        rows, cols = (known[1:] + known[:-1]) / 2, (known[:, 1:] + known[:, :-1]) / 2
        centres = (cols[1:] + cols[:-1]) / 2
        for found, true in (
            (rows, values[1::2, ::2]),
            (cols, values[::2, 1::2]),
            (centres, values[1::2, 1::2]),
        ):
            worst = max(worst, float(np.abs(found - true).max()))
    return worst


def _quadrilaterals(values: Floats) -> Floats:
    corners = [values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]]
    return np.stack(corners, axis=-1).reshape(-1, 4)
