"""Elevation models around a place, as functions of metres east and north of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.transform import from_origin

LAT, LON = 47.0, 8.0
CRS = f"+proj=aeqd +lat_0={LAT} +lon_0={LON} +datum=WGS84 +units=m +type=crs"


def write_dem(
    path: Path, height_m: Callable[[Any, Any], Any], half_m: float = 400, pixel_m: float = 2, crs: str = CRS
) -> Path:
    """Write heights above the sea at the centres of pixels, from their metres east and north of the place."""
    side = int(2 * half_m / pixel_m)
    centre = (np.arange(side) + 0.5) * pixel_m - half_m
    east, north = np.meshgrid(centre, -centre)
    pixels = np.broadcast_to(height_m(east, north), (side, side)).astype(np.float64)
    how = {"driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "float64", "crs": crs}
    with rasterio.open(path, "w", transform=from_origin(-half_m, half_m, pixel_m, pixel_m), **how) as file:
        file.write(pixels, 1)
    return path
