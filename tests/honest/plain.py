"""Plain answers: what rasterio, pyproj and shapely say of a raster, without any code of ours."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import shapely
from affine import Affine
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from rasterio.enums import ColorInterp
from rasterio.features import rasterize

from tests.honest.picture import quiet

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True, eq=False)
class Plain:
    """A raster as rasterio reads it.

    Parameters
    ----------
    intensity : (rows, cols) float64 array
        The band, or the luminance of three.
    valid : (rows, cols) bool array
    """

    intensity: NDArray[np.float64]
    valid: NDArray[np.bool_]
    transform: Affine
    crs: Any


def read(path: Path, bands: tuple[int, ...]) -> Plain:
    """Read a raster."""
    with quiet(), rasterio.open(path) as file:
        values = file.read(list(bands))
        valid = np.logical_and.reduce([file.read_masks(band) != 0 for band in bands])
        if file.nodata is not None and len(bands) == 3 and values.dtype.kind == "u":
            valid = file.dataset_mask() != 0  # black is a colour, and nodata where all three are
        if values.dtype.kind == "f":
            valid &= np.isfinite(values).all(axis=0)
        if ColorInterp.alpha in file.colorinterp:  # GDAL counts it for 8 and 16 bits alone
            valid &= file.read(1 + file.colorinterp.index(ColorInterp.alpha)) != 0
        transform, crs = file.transform, file.crs
    numbers = values.astype(np.float64)
    intensity = numbers[0] if len(bands) == 1 else np.tensordot(LUMINANCE, numbers, 1)
    return Plain(intensity, valid, transform, None if crs is None else crs.to_wkt())


def v_of(intensity: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """Intensity stretched to 0..1."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.clip((intensity - low) / (high - low), 0, 1)


def area_m2(which: NDArray[np.bool_], transform: Affine, crs: Any) -> float:
    """True area of some pixels, by an equal-area projection around the raster; square units without a CRS."""
    if crs is None:
        return float(np.count_nonzero(which) * abs(transform.determinant))
    system = CRS.from_user_input(crs)
    rows, cols = which.shape
    to_degrees = Transformer.from_crs(system, system.geodetic_crs, always_xy=True)
    lon, lat = to_degrees.transform(*(transform * (cols / 2, rows / 2)))
    ellipsoid = system.ellipsoid
    equal = CRS.from_proj4(
        f"+proj=laea +lat_0={lat!r} +lon_0={lon!r} +a={ellipsoid.semi_major_metre!r} "
        f"+b={ellipsoid.semi_minor_metre!r} +units=m"
    )
    to_metres = Transformer.from_crs(equal.geodetic_crs, equal, always_xy=True)
    # The area of a pixel hardly changes from place to place: a polynomial over cells of metres at least.
    size = abs(transform.determinant) ** 0.5 * (111_000 if system.is_geographic else 1)
    across = [n * max(1.0, 2000 / (n * size)) for n in (rows, cols)]
    down, right = (
        n / 2 + np.linspace(-0.5, 0.5, 41) * more for n, more in zip((rows, cols), across, strict=True)
    )
    x, y = transform * tuple(np.meshgrid(right, down))
    density = quad_areas(*to_metres.transform(*to_degrees.transform(x, y)))
    density *= 1600 / (across[0] * across[1])
    centres = np.meshgrid((down[1:] + down[:-1]) / 2, (right[1:] + right[:-1]) / 2, indexing="ij")
    place = [((n / 2), more) for n, more in zip((rows, cols), across, strict=True)]

    def powers(*axes: NDArray[np.float64]) -> NDArray[np.float64]:
        return _powers(*((axis - middle) / more for axis, (middle, more) in zip(axes, place, strict=True)))

    fitted = np.linalg.lstsq(powers(*(axis.ravel() for axis in centres)), density.ravel(), rcond=None)[0]
    row, col = np.nonzero(which)
    return float(np.sum(powers(row + 0.5, col + 0.5) @ fitted))


def _powers(row: NDArray[np.float64], col: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([row**i * col**j for i in range(5) for j in range(5 - i)], axis=-1)


def quad_areas(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas of the cells of a grid of corners."""
    ax, ay = x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1]
    bx, by = x[1:, :-1] - x[:-1, 1:], y[1:, :-1] - y[:-1, 1:]
    return np.abs(ax * by - ay * bx) / 2


def drawn_pixels(shapes: Any, shape: tuple[int, int], transform: Affine) -> NDArray[np.uint8]:
    """How many polygons cover each pixel's centre."""
    own = ~transform
    total = np.zeros(shape, np.uint8)
    for polygon in shapes:
        if polygon.is_empty:
            continue
        local = shapely.transform(polygon, lambda xy: np.column_stack(own * (xy[:, 0], xy[:, 1])))
        total += rasterize([(local, 1)], out_shape=shape, transform=Affine.identity(), dtype="uint8")
    return total
