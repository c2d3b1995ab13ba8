"""Multiresolution LBP at twice the scale: codes and contrast of means of 2 x 2 pixels.

Texture several pixels wide survives the mean of four pixels, while the noise of single pixels is halved.
Ojala, Pietikäinen and Mäenpää, "Multiresolution gray-scale and rotation invariant texture classification with
local binary patterns", IEEE Transactions on Pattern Analysis and Machine Intelligence 24 (2002) 971-987.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.lbp import lbp_symbols

COARSE_HALO = 3  # pixels: largest distance from a pixel to a pixel of its means


def coarse_symbols(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8] | None, bin_edges: NDArray[np.int32]
) -> NDArray[np.uint16]:
    """LBP code and contrast bin of the mean of each pixel with those above and to the left of it.

    The neighbours of a mean are the eight means of 2 x 2 pixels that touch it, so a pixel is counted where
    the 6 x 6 pixels around it are valid.

    Parameters
    ----------
    grey : (M + 6, N + 6) uint16 array
        Image with a border of three pixels.
    valid : (M + 6, N + 6) uint8 array or None
        1 where a pixel is valid; None where all are.
    bin_edges : (7,) int32 array, from `contrast_bin_edges`

    Returns
    -------
    symbols : (M, N) uint16 array
        0 to 2047; 65535 where a pixel is not counted.
    """
    rows, cols = (max(length - 2 * COARSE_HALO, 0) for length in grey.shape)
    symbols = np.empty((rows, cols), np.uint16)
    means = _means_of_2x2(grey)
    whole = None if valid is None else valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1] & valid[1:, 1:]
    for row, col in np.ndindex(2, 2):  # means that touch each other are two pixels apart
        own = symbols[row::2, col::2]
        if own.size:
            part = np.s_[row : row + 2 * own.shape[0] + 3 : 2, col : col + 2 * own.shape[1] + 3 : 2]
            mask = None if whole is None else np.ascontiguousarray(whole[part])
            own[:] = lbp_symbols(np.ascontiguousarray(means[part]), mask, bin_edges)
    return symbols


def _means_of_2x2(grey: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Means of 2 x 2 pixels, rounded down."""
    pairs = grey[:-1].astype(np.uint32) + grey[1:]
    means: NDArray[np.uint16] = ((pairs[:, :-1] + pairs[:, 1:]) >> 2).astype(np.uint16)
    return means
