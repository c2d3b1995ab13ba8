"""Intensities beyond the ends of a stretch, so that means of values are those of the pixels themselves."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.intensity.grey import Grey, luminance
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.spectral.bands import Valid, Values
from uavseg.units import GREY_MAX

_LIMIT = 1 << 30  # greys: what lies farther beyond counts as so far


def greys_beyond(
    values: Values, valid: Valid | None, grey: Grey, stretch: Stretch
) -> NDArray[np.int32] | None:
    """By how many greys each valid pixel lies beyond the end of a stretch, negative below it.

    Parameters
    ----------
    values : (1, rows, cols) or (3, rows, cols) array of any real type
    valid : (rows, cols) bool array, optional
    grey : (rows, cols) uint16 array
        Of the pixels, by that stretch.
    stretch : Stretch

    Returns
    -------
    beyond : (rows, cols) int32 array, or None if it is 0 everywhere
        Its sum and that of the greys is the sum of the intensities, to half a grey for each pixel.
    """
    low, high = stretch.low, stretch.high
    if not stretch.clips or low == high or _is_within(values.dtype, low, high):
        return None
    at_ends = np.flatnonzero(grey.reshape(-1) - np.uint16(1) >= GREY_MAX - 1)  # 0 becomes 65535
    if valid is not None:
        at_ends = at_ends[valid.reshape(-1)[at_ends]]
    pixels = np.ascontiguousarray(values).reshape(len(values), -1)[:, at_ends]
    # Infinity is clipped below; where the stretch is infinitely wide, a quotient is no number and not beyond.
    with np.errstate(over="ignore", invalid="ignore"):
        v = ((luminance(pixels) if len(pixels) == 3 else pixels[0].astype(np.float64)) - low) / (high - low)
        outside = np.flatnonzero((v < 0) | (v > 1))
        if not outside.size:
            return None
        v = v[outside]
        steps = np.floor(GREY_MAX * np.where(v > 1, v - 1, v) + 0.5)
    beyond = np.zeros(grey.shape, np.int32)
    beyond.reshape(-1)[at_ends[outside]] = np.clip(steps, -_LIMIT, _LIMIT)
    return beyond


def _is_within(dtype: np.dtype[np.generic], low: float, high: float) -> bool:
    """Whether a type has no number beyond the ends."""
    return dtype.kind in "iu" and low <= np.iinfo(dtype.name).min and np.iinfo(dtype.name).max <= high
