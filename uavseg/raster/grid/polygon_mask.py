"""Polygon rasterisation: a mask of the pixels whose centres lie inside polygons."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.warning_filters import changing_filters


def pixels_inside(polygons: Iterable[Any], window: Window) -> NDArray[np.bool_]:
    """Return the mask (rows, cols) of the pixels of a window whose centres lie inside polygons.

    These (shapely) are in pixels as (col, row); the outer corner of the first pixel is (0, 0).
    """
    from rasterio.features import geometry_mask

    shape, place = (window.rows, window.cols), Affine.translation(window.col, window.row)
    with changing_filters():  # rasterio changes them itself
        mask: NDArray[Any] = geometry_mask(list(polygons), shape, place, invert=True)
    return mask
