"""Intensities beyond the ends of a stretch, so that means of values are those of the pixels themselves."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.bands import Valid, Values
from uavseg.raster.intensity.grey import luminance
from uavseg.raster.intensity.stretch import Stretch
from uavseg.units import GREY_MAX

_LIMIT = 1 << 30  # greys: what lies farther beyond counts as so far


def greys_beyond(values: Values, valid: Valid | None, stretch: Stretch) -> NDArray[np.int32] | None:
    """By how many greys each valid pixel lies beyond the end of a stretch, negative below it.

    Parameters
    ----------
    values : (1, rows, cols) or (3, rows, cols) array of any real type
    valid : (rows, cols) bool array, optional
    stretch : Stretch

    Returns
    -------
    beyond : (rows, cols) int32 array, or None if it is 0 everywhere
        Its sum and that of the greys is the sum of the intensities, to half a grey for each pixel.
    """
    low, high = stretch.low, stretch.high
    if not stretch.clips or low == high or _is_within(values.dtype, low, high):
        return None
    intensity = luminance(values) if len(values) == 3 else values[0]
    outside = (intensity < low) | (intensity > high)
    if valid is not None:
        outside &= valid
    if not outside.any():
        return None
    v = (intensity[outside].astype(np.float64) - low) / (high - low)
    beyond = np.zeros(intensity.shape, np.int32)
    beyond[outside] = np.clip(np.floor(GREY_MAX * np.where(v > 1, v - 1, v) + 0.5), -_LIMIT, _LIMIT)
    return beyond


def _is_within(dtype: np.dtype[np.generic], low: float, high: float) -> bool:
    """Whether a type has no number beyond the ends."""
    return dtype.kind in "iu" and low <= np.iinfo(dtype.name).min and np.iinfo(dtype.name).max <= high
