"""Rasters with drawn collars: a picture with texture, turned, in a constant frame."""

from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from skimage.filters import gaussian

PLACE = {"crs": "EPSG:32618", "transform": Affine(2, 0, 4e5, 0, -2, 5e6)}


def texture(shape: tuple[int, int], seed: int = 0, low: int = 40, high: int = 215) -> NDArray[np.uint8]:
    """Fields of about 20 pixels with noise, from `low` to `high`."""
    rng = np.random.default_rng(seed)
    smooth = gaussian(rng.standard_normal(shape), 10)
    v = 0.5 + 0.22 * smooth / smooth.std() + rng.normal(0, 0.03, shape)
    return np.round(low + (high - low) * np.clip(v, 0, 1)).astype(np.uint8)


def turned(shape: tuple[int, int], degrees: float, scale: float = 0.5) -> NDArray[np.bool_]:
    """A rectangle of this share of the sides, turned around the middle."""
    rows, cols = np.mgrid[: shape[0], : shape[1]]
    y, x = rows - shape[0] / 2 + 0.5, cols - shape[1] / 2 + 0.5
    cos, sin = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    along, across = x * cos + y * sin, y * cos - x * sin
    return (abs(along) < scale * shape[1]) & (abs(across) < scale * shape[0])


def ragged(shape: tuple[int, int], seed: int = 0) -> NDArray[np.bool_]:
    """A rectangle whose sides wander by about ten pixels."""
    rng = np.random.default_rng(seed)
    rows, cols = np.mgrid[: shape[0], : shape[1]]
    wander = gaussian(rng.standard_normal(shape), 12)
    from_edge = np.minimum(np.minimum(rows, shape[0] - 1 - rows), np.minimum(cols, shape[1] - 1 - cols))
    return np.asarray(from_edge + 8 * wander / wander.std() > 40)


def framed(image: NDArray[Any], picture: NDArray[np.bool_], value: int) -> NDArray[Any]:
    """The image with a value outside its picture."""
    return np.where(picture, image, image.dtype.type(value))


def write(path: Path, image: NDArray[Any], **how: Any) -> Path:
    """Write a (rows, cols) or (bands, rows, cols) image as GeoTIFF."""
    bands = image if image.ndim == 3 else image[None]
    size = {"count": len(bands), "height": bands.shape[1], "width": bands.shape[2], "dtype": bands.dtype}
    tiled = {"tiled": True, "blockxsize": 128, "blockysize": 128}
    with rasterio.open(path, "w", "GTiff", **(size | tiled | PLACE | how)) as file:
        file.write(bands)
    return path
