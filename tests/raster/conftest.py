"""Rasters drawn for the tests of this folder."""

import warnings
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from rasterio.enums import ColorInterp

UTM = Affine(0.5, 0.0, 300000.0, 0.0, -0.5, 4000000.0)


@pytest.fixture(scope="session")
def write_raster(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A GeoTIFF of an array (rows, cols) or (bands, rows, cols); returns its path."""
    folder, numbers = tmp_path_factory.mktemp("rasters"), count()

    def write(
        pixels: np.ndarray,
        path: Path | None = None,
        colors: str | None = None,
        mask: np.ndarray | None = None,
        palette: dict[int, tuple[int, int, int, int]] | None = None,
        **how: Any,
    ) -> Path:
        planes = pixels[None] if pixels.ndim == 2 else pixels
        path = path or folder / f"{next(numbers)}.tif"
        bands, rows, cols = planes.shape
        how = {"transform": UTM, "crs": "EPSG:32618", "driver": "GTiff"} | how
        how |= {"width": cols, "height": rows, "count": bands, "dtype": planes.dtype.name}
        with warnings.catch_warnings(action="ignore"), rasterio.open(path, "w", **how) as file:
            if colors:
                file.colorinterp = [ColorInterp[color] for color in colors.split()]
            if palette:
                file.write_colormap(1, palette)
            file.write(planes)
            if mask is not None:
                file.write_mask(mask)
        return path

    return write
