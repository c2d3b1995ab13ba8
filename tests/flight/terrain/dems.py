"""Elevation models that are drawn for tests: formulas and noise on a grid around a home, in several CRS."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]
"""Height in metres of places so many metres east and north of the middle."""

EAST, NORTH = 500_000.0, 5_205_397.5
"""The middle of models in UTM zone 32; lat 47.0021, lon 9.0."""
HOME = (47.0021, 9.0)


def draw(
    path: Path, surface: Surface, pixel_m: float = 10.0, half_m: float = 1500.0, crs: Any = 32632, **how: Any
) -> Path:
    """A model in UTM of a surface, `half_m` metres from its middle to its edges."""
    count = round(2 * half_m / pixel_m)
    x = (np.arange(count) + 0.5) * pixel_m - half_m
    values = np.broadcast_to(surface(x[None, :], -x[:, None]), (count, count))
    transform = Affine(pixel_m, 0, EAST - half_m, 0, -pixel_m, NORTH + half_m)
    return write(path, values, transform, crs, **how)


def write(
    path: Path,
    values: Any,
    transform: Affine,
    crs: Any,
    nodata: float | None = -9999.0,
    dtype: str = "float32",
    unit: str | None = None,
    scale: float = 1.0,
    **how: Any,
) -> Path:
    """A raster of these values; NaN becomes nodata."""
    planes = np.atleast_3d(np.asarray(values, np.float64).T).T
    filled = planes if nodata is None else np.where(np.isnan(planes), nodata, planes)
    profile = {"driver": "GTiff", "width": planes.shape[2], "height": planes.shape[1], "count": len(planes)}
    profile |= {"crs": crs, "transform": transform, "nodata": nodata, "dtype": dtype, **how}
    with rasterio.open(path, "w", **profile) as target:
        target.write(filled.astype(dtype))
        if unit is not None:
            target.units = [unit] * len(planes)
        if scale != 1.0:
            target.scales = [scale] * len(planes)
    return path


def plane(east: float, north: float, at: float = 400.0) -> Surface:
    """A plane with these slopes."""
    return lambda x, y: at + east * x + north * y


def cone(height_m: float, radius_m: float, east_m: float = 0.0, north_m: float = 0.0) -> Surface:
    """A cone on flat ground at 400 m."""
    return lambda x, y: 400 + height_m * np.clip(1 - np.hypot(x - east_m, y - north_m) / radius_m, 0, None)


def cliff(height_m: float, east_m: float = 0.0) -> Surface:
    """Ground at 400 m that jumps up to the east of a line."""
    return lambda x, y: 400 + height_m * (x > east_m) + 0 * y


def hills(relief_m: float, seed: int = 0, wave_m: float = 400.0) -> Surface:
    """Waves of many directions."""
    rng = np.random.default_rng(seed)
    directions, phases = rng.uniform(0, 2 * np.pi, 6), rng.uniform(0, 2 * np.pi, 6)
    lengths = wave_m * rng.uniform(0.5, 1.5, 6)
    parts = list(zip(directions, phases, lengths, strict=True))
    return lambda x, y: (
        600
        + relief_m
        / 6
        * sum(np.sin(2 * np.pi * (x * np.cos(a) + y * np.sin(a)) / wave + phase) for a, phase, wave in parts)
    )


def noise(relief_m: float, seed: int = 0) -> Surface:
    """Every pixel a height of its own."""
    return lambda x, y: 500 + relief_m * np.random.default_rng(seed).random(np.broadcast(x, y).shape)
