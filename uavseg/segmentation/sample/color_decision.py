"""Per-pixel classification by texture, grey and the intensity of further bands.

Bands are taken for independent, given the side that a pixel is on, as in a naive Bayes classifier.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.lbp import UNCOUNTED
from uavseg.segmentation.sample.pixel_decision import WINDOW_RADIUS, PixelWeights

Image = NDArray[np.uint16]
Mask = NDArray[np.uint8]


@dataclass(frozen=True)
class ColorPlane:
    """Grey and validity of one band, and the weight of each of its 64 bins of grey.

    Parameters
    ----------
    grey : (M, N) uint16 array
    valid : (M, N) uint8 array
    weights : (64,) int64 array
        Log-likelihood ratio of one side to the other, in units of 1 / 1024.
    """

    grey: Image
    valid: Mask
    weights: NDArray[np.int64]


def classify_colored_pixels(
    cells: Mask,
    valid: Mask,
    grey: Image,
    symbols: tuple[Image, Image],
    weights: PixelWeights,
    colors: Sequence[ColorPlane],
) -> Mask:
    """Pixels inside, see `pixel_decision.classify_pixels`, with the weights of further bands added.

    Parameters
    ----------
    cells, valid, grey, weights
        As of `classify_pixels`.
    symbols : pair of uint16 arrays
        The symbols and the coarse symbols of `classify_pixels`.
    colors : sequence of ColorPlane

    Returns
    -------
    inside : (M, N) uint8 array
    """
    total = np.zeros(valid.shape, np.int64)
    inner = total[1:-1, 1:-1]
    inner += weights.greys[grey[1:-1, 1:-1] >> 10]
    for table, found in zip((weights.texture, weights.coarse), symbols, strict=True):
        margin = (inner.shape[0] - found.shape[0]) // 2
        around = np.pad(found, margin, constant_values=UNCOUNTED)
        counted = around != UNCOUNTED
        inner += np.where(counted, table[np.where(counted, around, 0)], 0)
    for color in colors:
        inner += np.where(color.valid, color.weights[color.grey >> 10], 0)[1:-1, 1:-1]
    inner *= valid[1:-1, 1:-1]
    sides = cells.repeat(8, 0).repeat(8, 1)
    inside: Mask = ((valid != 0) & ((sides == 1) | ((sides == 2) & (_box_sums(total) > 0)))).view(np.uint8)
    return inside


def _box_sums(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sums over the window of each pixel, without what lies outside of the array."""
    for axis in (0, 1):
        length = values.shape[axis]
        sums = np.concatenate([np.zeros_like(values.take([0], axis)), values.cumsum(axis)], axis)
        ends = np.arange(length)
        low, high = np.maximum(ends - WINDOW_RADIUS, 0), np.minimum(ends + WINDOW_RADIUS + 1, length)
        values = sums.take(high, axis) - sums.take(low, axis)
    return values
