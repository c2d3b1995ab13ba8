"""Measures of regions: moments and Fourier coefficients of their shape, and texture and bands inside them."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.raster.geodesy.globe import WGS84, geod_wgs84
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.polygon_mask import pixels_inside
from uavseg.raster.grid.tiling import Window
from uavseg.regions.table import Regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.blocks.lbp import CONTRAST_BINS, UNCOUNTED, lbp_symbols
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

HARMONICS = 4
_PROPERTIES = ("eccentricity", "solidity", "extent", "euler_number", "orientation", "moments_hu")
_ACROSS = 256  # cells of the mask of which moments are computed
_MAX_PIXELS = 1 << 24  # of a window that is measured
_CONTRAST_EDGES = np.array([2**k for k in range(8, 15)], np.int32)  # of grey, the same for every raster
_CONTRASTS = np.array([0.0, *(_CONTRAST_EDGES * math.sqrt(2))]) / GREY_MAX  # the middle of each bin
# Rotation-invariant uniform patterns: the number of ones, or 9 where ones and zeros change more than twice.
_CHANGES = [(code ^ (code >> 1 | (code & 1) << 7)).bit_count() for code in range(256)]
_UNIFORM = np.array([code.bit_count() if _CHANGES[code] <= 2 else 9 for code in range(256)])


def objects(polygons: Iterable[Any]) -> NDArray[np.object_]:
    """Return polygons as an array of objects."""
    return np.array([*polygons, None], object)[:-1]


def local_metres(regions: Regions) -> list[Any]:
    """Return each polygon in metres around a corner of its own: x to the east, y to true north.

    The projection is azimuthal equidistant. Without a CRS, coordinates are taken for metres and y for north.
    """
    if regions.wkt is None:
        return list(regions.polygons)

    def placed(lon: Any, lat: Any) -> tuple[Any, Any]:
        bearing, _, metres = geod_wgs84().inv(np.full_like(lon, lon[0]), np.full_like(lat, lat[0]), lon, lat)
        return metres * np.sin(np.radians(bearing)), metres * np.cos(np.radians(bearing))

    degrees = regions.polygons if regions.wkt == WGS84 else to_wgs84.wgs84_geometries(regions)
    return [shapely.transform(polygon, placed, interleaved=False) for polygon in degrees]


def shape_measures(polygon: Any) -> dict[str, float]:
    """Measure the shape of a polygon in metres, y to the north.

    Length, width and angle (degrees clockwise from north) of the smallest box around it; eccentricity,
    solidity, extent, Euler number, orientation (likewise) and Hu moments as `regionprops` of scikit-image has
    them, of a mask 256 cells across; elliptic Fourier coefficients of the largest ring.
    """
    from skimage.measure import regionprops_table

    x_min, y_min, x_max, y_max = polygon.bounds
    cell = max(x_max - x_min, y_max - y_min) / _ACROSS
    pixels = shapely.transform(polygon, lambda xy: (xy - (x_min, y_max)) * (1, -1) / cell)
    mask = pixels_inside(objects([pixels]), Window(0, 0, _ACROSS, _ACROSS))
    mask[0, 0] |= not mask.any()  # of a sliver without the centre of a cell
    table = regionprops_table(mask.astype(np.uint8), properties=_PROPERTIES)
    found = {name.replace("moments_hu-", "hu"): float(value[0]) for name, value in table.items()}
    turn = found.pop("orientation")  # between the rows and the major axis
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(polygon))
    width, length = sorted(np.diff(corners[:3], axis=0).tolist(), key=lambda side: math.hypot(*side))
    return {
        "length_m": math.hypot(*length),
        "width_m": math.hypot(*width),
        "angle_deg": math.degrees(math.atan2(*length)) % 180,
        "orientation_deg": math.degrees(math.atan2(math.sin(turn), -math.cos(turn))) % 180,
        **found,
        **fourier_coefficients(max(shapely.get_parts(polygon), key=shapely.area).exterior),
    }


def fourier_coefficients(ring: Any) -> dict[str, float]:
    """Compute elliptic Fourier coefficients a, b, c, d of harmonics 1 to 4, invariant to similarity.

    F. P. Kuhl and C. R. Giardina, "Elliptic Fourier features of a closed contour", Computer Graphics and
    Image Processing 18 (1982) 236-258, with x + iy for the two coordinates: start, rotation and size are
    those of the first ellipse, so that a, b and c of harmonic 1 are 1, 0 and 0, and left out. Of the two ends
    of that ellipse, the start is the one for which a of harmonic 2 is not negative.
    """
    steps = np.diff(shapely.get_coordinates(ring if ring.is_ccw else ring.reverse()) @ (1, 1j))
    steps = steps[steps != 0]
    along = np.concatenate([[0.0], np.cumsum(np.abs(steps))]) * math.tau / np.abs(steps).sum()
    n = np.arange(1, HARMONICS + 1)
    forward, back = (
        np.diff(np.exp(-1j * np.outer(k, along))) @ (steps / np.abs(steps)) / k**2 for k in (n, -n)
    )
    first, last = np.angle(forward[0]), np.angle(back[0])
    size = np.exp(0.5j * (first + last)) * (abs(forward[0]) + abs(back[0]))
    forward *= np.exp(0.5j * n * (last - first)) / size
    back *= np.exp(0.5j * n * (first - last)) / size
    ac, bd = forward + back, 1j * (forward - back)
    sign = np.where((n % 2 == 0) & (ac[1].real < 0), -1, 1)  # the other end: even harmonics change sign
    table = np.stack([ac.real, bd.real, ac.imag, bd.imag], axis=1) * sign[:, None]
    kept = [(k, j) for k in n.tolist() for j in range(4) if k > 1 or j == 3]
    return {f"efd{k}_{'abcd'[j]}": float(table[k - 1, j]) for k, j in kept}


def pixel_measures(polygon: Any, source: GreySource) -> dict[str, Any]:
    """Measure what a raster holds inside a polygon, which is in its pixels as (col, row).

    `texture` counts pixels by rotation-invariant uniform LBP (10) and contrast (8 bins that double), as text;
    `contrast` is its mean in v. `rows_deg` is the direction of the least eigenvector of the structure tensor,
    clockwise from north; `rows_strength` its coherence. All is NaN where no pixel is valid, or too many are.
    """
    left, top, right, bottom = np.clip(polygon.bounds, 0, [*source.shape[::-1], *source.shape[::-1]])
    window = Window(int(top), int(left), math.ceil(bottom) - int(top), math.ceil(right) - int(left))
    fits = 0 < window.rows * window.cols <= _MAX_PIXELS
    window = window if fits else Window(0, 0, 1, 1)
    inside, tile = pixels_inside(objects([polygon]), window) & fits, source.read(window, 1)
    symbols = lbp_symbols(tile.grey, tile.mask, _CONTRAST_EDGES)[: window.rows, : window.cols]
    counted = inside & (symbols != UNCOUNTED)
    code, contrast = np.divmod(symbols[counted], CONTRAST_BINS)
    counts = np.bincount(_UNIFORM[code] * CONTRAST_BINS + contrast, minlength=10 * CONTRAST_BINS)
    slopes: Any = np.gradient(tile.grey / GREY_MAX)
    y, x = (one[1 : window.rows + 1, 1 : window.cols + 1][counted] for one in slopes)
    energy, tensor = float((x * x + y * y).sum()), complex(((x + 1j * y) ** 2).sum())
    strength = abs(tensor) / energy if energy > 0 else math.nan
    rows_deg = (math.degrees(np.angle(tensor)) / 2 + _up_deg(polygon, source.dataset.geobox)) % 180
    found: dict[str, Any] = {
        "texture": " ".join(map(str, counts.tolist())) if counted.any() else "",
        "contrast": float(_CONTRASTS[contrast].mean()) if counted.any() else math.nan,
        "rows_deg": rows_deg if strength > 0 else math.nan,
        "rows_strength": strength,
    }
    roles = source.dataset.mosaic.files[0].layout.roles
    for band in (k for k, role in enumerate(roles, 1) if role != "alpha"):
        values, valid = source.dataset.of_band(band).read(window)
        chosen = values[0][inside if valid is None else inside & valid].astype(np.float64)
        for what in ("mean", "std", "min", "max"):
            found[f"b{band}_{what}"] = float(getattr(chosen, what)()) if len(chosen) else math.nan
    return found


def _up_deg(polygon: Any, geobox: GeoBox) -> float:
    """Return the direction of decreasing rows at a polygon in pixels, clockwise from true north."""
    col, row = polygon.centroid.coords[0]
    x, y = geobox.xy_from_pixel([row, row - 1], [col, col])
    if geobox.crs is None:
        return math.degrees(math.atan2(x[1] - x[0], y[1] - y[0]))
    lon, lat = geobox.lonlat_from_xy(x, y)
    return float(geod_wgs84().inv(lon[0], lat[0], lon[1], lat[1])[0])
