"""Regions whose outlines follow pixels, with as many corners, holes and specks as blurred noise has."""

from typing import Any

import numpy as np
import rasterio.features
import shapely
from affine import Affine
from scipy.ndimage import gaussian_filter


def pixel_region(side: int, seed: int, pixel_m: float = 0.5, sigma: float = 1.5) -> list[Any]:
    """The polygons, in metres, of the brighter half of blurred noise of so many pixels a side."""
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), sigma)
    bright = (noise > 0).astype(np.uint8)
    shapes = rasterio.features.shapes(bright, bright == 1, transform=Affine.scale(pixel_m, pixel_m))
    return [shapely.geometry.shape(shape) for shape, _ in shapes]
