"""Measures of regions: moments and Fourier coefficients of their shape, and texture and bands inside them."""

import math
from typing import Any

import numpy as np
import shapely

from uavseg.arrays import Floats, Objects
from uavseg.raster.geodesy.globe import WGS84, geod_wgs84
from uavseg.raster.grid.geobox import pixels_inside
from uavseg.raster.grid.tiling import Window
from uavseg.regions.table import Regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.blocks.lbp import CONTRAST_BINS, UNCOUNTED, lbp_symbols
from uavseg.segmentation.source import GreySource
from uavseg.units import GREY_MAX

HARMONICS = 4
_MAX_PIXELS = 1 << 24  # of a window that is measured
_CONTRAST_EDGES = np.array([2**k for k in range(8, 15)], np.int32)  # of grey, the same for every raster
_CONTRASTS = np.array([0.0, *(_CONTRAST_EDGES * math.sqrt(2))]) / GREY_MAX  # the middle of each bin
# Rotation-invariant uniform patterns: the number of ones, or 9 where ones and zeros change more than twice.
_CHANGES = [(code ^ (code >> 1 | (code & 1) << 7)).bit_count() for code in range(256)]
_UNIFORM = np.array([code.bit_count() if _CHANGES[code] <= 2 else 9 for code in range(256)])


def local_metres(regions: Regions) -> Objects:
    """Project each polygon to metres around a corner of its own (azimuthal equidistant), y to true north.

    Without a CRS, coordinates are taken for metres and y for north.
    """
    if regions.wkt is None:
        return np.array([*regions.polygons], object)

    def placed(lon: Any, lat: Any) -> tuple[Any, Any]:
        bearing, _, metres = geod_wgs84().inv(np.full_like(lon, lon[0]), np.full_like(lat, lat[0]), lon, lat)
        return metres * np.sin(np.radians(bearing)), metres * np.cos(np.radians(bearing))

    degrees = regions.polygons if regions.wkt == WGS84 else to_wgs84.wgs84_geometries(regions)
    return np.array([shapely.transform(one, placed, interleaved=False) for one in degrees], object)


def shape_measures(polygons: Objects) -> dict[str, Floats]:
    """Measure shapes of polygons (n,) in metres, y to the north.

    Length, width and angle (degrees clockwise from north) of the smallest box; solidity, extent, orientation
    (likewise), eccentricity and Hu moments as `regionprops` of scikit-image has them, but of the polygons
    themselves; parts less holes; elliptic Fourier coefficients of the largest ring.
    """
    parts, of_parts = shapely.get_parts(shapely.orient_polygons(polygons), return_index=True)
    rings, of_rings = shapely.get_rings(parts, return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    owner, area = of_parts[of_rings][ring], shapely.area(polygons)
    xy = (xy - shapely.get_coordinates(shapely.centroid(polygons))[owner]) / np.sqrt(area)[owner, None]
    edges, z = np.flatnonzero(ring[1:] == ring[:-1]), xy[:, 0] + 1j * xy[:, 1]
    first, last, owner = z[edges], z[edges + 1], owner[edges]
    # Complex moments, integrals of z^p conj(z)^q: each edge adds a triangle with the centroid, for which
    # Gauss's rule of two nodes is exact for powers to 3.
    nodes = [first + (last - first) * (0.5 + sign / math.sqrt(12)) for sign in (-1, 1)]
    starts, cross = np.searchsorted(owner, np.arange(len(polygons))), (first.conj() * last).imag / 2
    c11, c20, c21, c30 = (
        np.add.reduceat(sum(cross * z**p * z.conj() ** q for z in nodes), starts) / (p + q + 2)
        for p, q in ((1, 1), (2, 0), (2, 1), (3, 0))
    )
    spread, cubed = np.abs(c20), c30 * c21.conj() ** 3
    hu = [c11.real, spread**2, np.abs(c30) ** 2, np.abs(c21) ** 2]
    hu += [cubed.real, (c20 * c21.conj() ** 2).real, cubed.imag]
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(polygons)).reshape(-1, 5, 2)
    sides = np.diff(box[:, :3, 0] + 1j * box[:, :3, 1])
    width, length = np.take_along_axis(sides, np.abs(sides).argsort(axis=1), axis=1).T
    bounds = np.diff(shapely.bounds(polygons).reshape(-1, 2, 2), axis=1)
    largest = (max(shapely.get_parts(one), key=shapely.area).exterior for one in polygons)
    efd = np.array([fourier_coefficients(ring) for ring in largest]).reshape(-1, 4 * HARMONICS)[:, 3:]
    return {
        "length_m": np.abs(length),
        "width_m": np.abs(width),
        "angle_deg": (90 - np.degrees(np.angle(length))) % 180,
        "orientation_deg": (90 - np.degrees(np.angle(c20)) / 2) % 180,
        "eccentricity": np.sqrt(2 * spread / (hu[0] + spread)),
        "solidity": area / shapely.area(shapely.convex_hull(polygons)),
        "extent": area / bounds.prod(axis=(1, 2)),
        "euler_number": 2 * np.bincount(of_parts) - np.bincount(of_parts[of_rings]),
        **{f"hu{k}": one for k, one in enumerate(hu)},
        **{f"efd{k // 4 + 1}_{'abcd'[k % 4]}": one for k, one in enumerate(efd.T, 3)},
    }


def fourier_coefficients(ring: Any) -> Floats:
    """Compute elliptic Fourier coefficients a, b, c, d (4, 4) of harmonics 1 to 4, invariant to similarity.

    F. P. Kuhl and C. R. Giardina, "Elliptic Fourier features of a closed contour", Computer Graphics and
    Image Processing 18 (1982) 236-258. Start, rotation and size are those of the first ellipse, so a, b and c
    of harmonic 1 are 1, 0 and 0; the start is that of its two ends for which a of harmonic 2 is not negative.
    """
    steps = np.diff(shapely.get_coordinates(ring if ring.is_ccw else ring.reverse()) @ (1, 1j))
    steps = steps[steps != 0]
    along = np.concatenate([[0.0], np.cumsum(np.abs(steps))]) * math.tau / np.abs(steps).sum()
    n = np.outer((1, -1), np.arange(1, HARMONICS + 1))
    waves = np.diff(np.exp(-1j * n[..., None] * along)) @ (steps / np.abs(steps)) / n**2
    first, last = np.angle(waves[:, 0])
    waves *= np.exp(0.5j * (n * (last - first) - first - last)) / np.abs(waves[:, 0]).sum()
    ac, bd = waves[0] + waves[1], 1j * (waves[0] - waves[1])
    sign = np.where((n[0] % 2 == 0) & (ac[1].real < 0), -1, 1)  # the other end: even harmonics change sign
    return np.asarray(np.stack([ac.real, bd.real, ac.imag, bd.imag], axis=1) * sign[:, None])


def pixel_measures(source: GreySource, polygon: Any) -> dict[str, Any]:
    """Measure what a raster holds inside a polygon, which is in its pixels as (col, row).

    `texture` counts pixels by rotation-invariant uniform LBP (10) and contrast (8 bins that double), as text;
    `contrast` is its mean in v. `rows_deg` is the direction of the least eigenvector of the structure tensor,
    clockwise from north; `rows_strength` its coherence. All is NaN where no pixel is valid, or too many are.
    """
    left, top, right, bottom = np.clip(polygon.bounds, 0, [*source.shape[::-1], *source.shape[::-1]])
    window = Window(int(top), int(left), math.ceil(bottom) - int(top), math.ceil(right) - int(left))
    fits = 0 < window.rows * window.cols <= _MAX_PIXELS
    window = window if fits else Window(0, 0, 1, 1)
    inside, tile = pixels_inside([polygon], window) & fits, source.read(window, 1)
    symbols = lbp_symbols(tile.grey, tile.mask, _CONTRAST_EDGES)[: window.rows, : window.cols]
    counted = inside & (symbols != UNCOUNTED)
    code, contrast = np.divmod(symbols[counted], CONTRAST_BINS)
    counts = np.bincount(_UNIFORM[code] * CONTRAST_BINS + contrast, minlength=10 * CONTRAST_BINS)
    slopes: Any = np.gradient(tile.grey / GREY_MAX)
    y, x = (one[1 : window.rows + 1, 1 : window.cols + 1][counted] for one in slopes)
    energy, tensor = float((x * x + y * y).sum()), complex(((x + 1j * y) ** 2).sum())
    strength = abs(tensor) / energy if energy > 0 else math.nan
    (col, row), geobox = polygon.centroid.coords[0], source.dataset.geobox
    place: Any = geobox.xy_from_pixel([row, row - 1], [col, col])
    up = math.degrees(math.atan2(*np.diff(place)[:, 0]))
    if geobox.crs is not None:
        up = geod_wgs84().inv(*np.transpose(geobox.lonlat_from_xy(*place)).ravel())[0]
    found: dict[str, Any] = {
        "texture": " ".join(map(str, counts.tolist())) if counted.any() else "",
        "contrast": float(_CONTRASTS[contrast].mean()) if counted.any() else math.nan,
        "rows_deg": (math.degrees(np.angle(tensor)) / 2 + up) % 180 if strength > 0 else math.nan,
        "rows_strength": strength,
    }
    for band, role in enumerate(source.dataset.mosaic.files[0].layout.roles, 1):
        if role == "alpha":
            continue
        values, valid = source.dataset.of_band(band).read(window)
        chosen = values[0][inside if valid is None else inside & valid].astype(np.float64)
        for what in ("mean", "std", "min", "max"):
            found[f"b{band}_{what}"] = float(getattr(chosen, what)()) if len(chosen) else math.nan
    return found
