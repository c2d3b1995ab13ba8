"""Ground to fly over: hills by a formula, and the same as an elevation model in a file."""

import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import ArrayLike, NDArray

from benchmarks.flight.fields import HOME

Floats = NDArray[np.float64]

PIXEL_M, HALF_M = 5.0, 1200.0
_WAVES = ((18.0, 420.0, 0.6), (9.0, 230.0, 2.1), (4.0, 110.0, 4.0))  # amplitude, length, direction
_SLOPE = 0.06  # to the east


def ground_m(x: ArrayLike, y: ArrayLike) -> Floats:
    """Height of the ground above the sea, metres, at places east and north of home."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    height = HOME[2] + _SLOPE * x
    for amplitude, length, direction in _WAVES:
        along = x * math.cos(direction) + y * math.sin(direction)
        height = height + amplitude * np.sin(2 * math.pi * along / length)
    return np.asarray(height, np.float64)


def rise_m(x: float, y: float) -> float:
    """Height of the ground above that at home."""
    return float(ground_m(x, y) - ground_m(0.0, 0.0))


@contextmanager
def elevation_model() -> Iterator[Path]:
    """The ground in a GeoTIFF, for as long as it is needed."""
    count = round(2 * HALF_M / PIXEL_M)
    x = (np.arange(count) + 0.5) * PIXEL_M - HALF_M
    values = ground_m(x[None, :], -x[:, None]).astype("float32")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hills.tif"
        with rasterio.open(
            path,
            "w",
            driver="GTiff",
            width=count,
            height=count,
            count=1,
            dtype="float32",
            crs=f"+proj=aeqd +lat_0={HOME[0]} +lon_0={HOME[1]} +datum=WGS84",
            transform=Affine(PIXEL_M, 0, -HALF_M, 0, -PIXEL_M, HALF_M),
        ) as target:
            target.write(values, 1)
        yield path
