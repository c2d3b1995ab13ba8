"""Measures of regions: moments and Fourier coefficients of their shape, and texture and bands inside them."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.raster.geodesy.globe import WGS84
from uavseg.raster.grid.polygon_mask import pixels_inside
from uavseg.raster.grid.tiling import Window
from uavseg.regions.table import Regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.blocks.lbp import CONTRAST_BINS, UNCOUNTED, lbp_symbols
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

Floats = NDArray[np.float64]
Objects = NDArray[np.object_]

HARMONICS = 4
_RADIUS_M, _ECCENTRICITY2 = 6378137.0, 0.00669437999014  # of WGS 84
_PROPERTIES = ("eccentricity", "solidity", "extent", "euler_number", "orientation", "moments_hu")
_ACROSS = 256  # cells of the mask of which moments are computed
_MAX_PIXELS = 1 << 24  # of a window that is measured
_CONTRAST_EDGES = np.array([2**k for k in range(8, 15)], np.int32)  # of grey, the same for every raster
_CONTRASTS = np.array([0.0, *(_CONTRAST_EDGES * math.sqrt(2))]) / GREY_MAX  # the middle of each bin
# Rotation-invariant uniform patterns: the number of ones, or 9 where ones and zeros change more than twice.
_UNIFORM = np.array(
    [
        code.bit_count() if (code ^ (code >> 1 | (code & 1) << 7)).bit_count() <= 2 else 9
        for code in range(256)
    ]
)


def objects(polygons: Iterable[Any]) -> Objects:
    """Return polygons as an array of objects."""
    return np.array([*polygons, None], object)[:-1]


def local_metres(regions: Regions) -> list[Any]:
    """Return polygons in metres around a corner of their own: x to the east, y to true north.

    Without a CRS, coordinates are taken for metres and y for north.
    """
    if regions.wkt is None:
        return list(regions.polygons)

    def placed(lonlat: Floats) -> Floats:
        lon, lat = np.radians(lonlat).T
        squeeze = 1 - _ECCENTRICITY2 * math.sin(lat.mean()) ** 2
        across = _RADIUS_M / math.sqrt(squeeze)  # radius of curvature of the prime vertical
        along = across * (1 - _ECCENTRICITY2) / squeeze  # and of the meridian
        east = (lon - lon[0] + math.pi) % math.tau - math.pi
        return np.column_stack([east * across * np.cos(lat.mean()), (lat - lat[0]) * along])

    degrees = regions.polygons if regions.wkt == WGS84 else to_wgs84.wgs84_geometries(regions)
    return [shapely.transform(polygon, placed) for polygon in degrees]


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
        **fourier_coefficients(largest_part(polygon).exterior),
    }


def largest_part(polygon: Any) -> Any:
    """Return the polygon, or the largest of several."""
    return max(shapely.get_parts(polygon), key=lambda part: part.area)


def fourier_coefficients(ring: Any) -> dict[str, float]:
    """Compute elliptic Fourier coefficients a, b, c, d of harmonics 1 to 4, invariant to similarity.

    F. P. Kuhl and C. R. Giardina, "Elliptic Fourier features of a closed contour", Computer Graphics and
    Image Processing 18 (1982) 236-258: start, rotation and size are those of the first ellipse, so that a, b
    and c of harmonic 1 are 1, 0 and 0, and left out. Of the two ends of that ellipse, the start is the one
    for which a of harmonic 2 is not negative.
    """
    steps = np.diff(shapely.get_coordinates(ring if ring.is_ccw else ring.reverse()), axis=0)
    lengths = np.hypot(*steps.T)
    steps, lengths = steps[lengths > 0], lengths[lengths > 0]
    along = np.concatenate([[0.0], np.cumsum(lengths)]) * math.tau / lengths.sum()
    matrices = []
    for n in range(1, HARMONICS + 1):
        waves = np.stack([np.diff(np.cos(n * along)), np.diff(np.sin(n * along))])
        matrices.append((steps / lengths[:, None]).T @ waves.T / n**2)  # [[a, b], [c, d]], up to a factor
    (a, b), (c, d) = matrices[0]
    start = 0.5 * math.atan2(2 * (a * b + c * d), a**2 - b**2 + c**2 - d**2)
    first = matrices[0] @ _rotation(start)
    turn = math.atan2(first[1, 0], first[0, 0])
    size = math.hypot(first[0, 0], first[1, 0])
    normal = [
        _rotation(turn).T @ one @ _rotation(n * start) / size if size else one * 0.0
        for n, one in enumerate(matrices, 1)
    ]
    sign = -1.0 if normal[1][0, 0] < 0 else 1.0  # the other end of the ellipse: even harmonics change sign
    names = [(n, k) for n in range(1, HARMONICS + 1) for k in range(4) if n > 1 or k == 3]
    return {
        f"efd{n}_{'abcd'[k]}": float(normal[n - 1].flat[k] * (sign if n % 2 == 0 else 1)) for n, k in names
    }


def _rotation(angle: float) -> Floats:
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def pixel_measures(polygon: Any, source: GreySource, up_deg: float) -> dict[str, Any]:
    """Measure what a raster holds inside a polygon, which is in its pixels as (col, row).

    `texture` counts pixels by rotation-invariant uniform LBP (10) and contrast (8 bins that double), as text;
    `contrast` is its mean in v. `rows_deg` is the direction of rows, clockwise from north: along the least
    eigenvector of the structure tensor; `rows_strength` its coherence, 0 without a direction. Then mean,
    standard deviation, minimum and maximum of each band. All is NaN where no pixel is valid, or too many are.

    `up_deg` is the direction of decreasing rows, clockwise from north.
    """
    left, top, right, bottom = np.clip(polygon.bounds, 0, [*source.shape[::-1], *source.shape[::-1]])
    window = Window(int(top), int(left), math.ceil(bottom) - int(top), math.ceil(right) - int(left))
    if not 0 < window.rows * window.cols <= _MAX_PIXELS:
        window = Window(0, 0, 1, 1)
    inside = pixels_inside(objects([polygon]), window)
    tile = source.read(window, 1)
    symbols = lbp_symbols(tile.grey, tile.mask, _CONTRAST_EDGES)[: window.rows, : window.cols]
    counted = inside & (symbols != UNCOUNTED)
    code, contrast = np.divmod(symbols[counted], CONTRAST_BINS)
    counts = np.bincount(_UNIFORM[code] * CONTRAST_BINS + contrast, minlength=10 * CONTRAST_BINS)
    gradients: Any = np.gradient(tile.grey / GREY_MAX)
    down, right_ = (one[1 : window.rows + 1, 1 : window.cols + 1][counted] for one in gradients)
    xx, xy, yy = (float((a * b).sum()) for a, b in ((right_, right_), (right_, down), (down, down)))
    strength = math.hypot(xx - yy, 2 * xy) / (xx + yy) if xx + yy > 0 else math.nan
    across = math.degrees(0.5 * math.atan2(2 * xy, xx - yy))  # of the gradient, from columns towards rows
    found: dict[str, Any] = {
        "texture": " ".join(map(str, counts.tolist())) if counted.any() else "",
        "contrast": float(_CONTRASTS[contrast].mean()) if counted.any() else math.nan,
        "rows_deg": (across + up_deg) % 180 if strength > 0 else math.nan,
        "rows_strength": strength,
    }
    roles = source.dataset.mosaic.files[0].layout.roles
    for band in (k for k, role in enumerate(roles, 1) if role != "alpha"):
        values, valid = source.dataset.of_band(band).read(window)
        chosen = values[0][inside if valid is None else inside & valid].astype(np.float64)
        for what in ("mean", "std", "min", "max"):
            found[f"b{band}_{what}"] = float(getattr(chosen, what)()) if len(chosen) else math.nan
    return found
