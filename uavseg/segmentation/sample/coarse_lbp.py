"""Texture at twice the scale: LBP codes and contrast of means of 2 x 2 pixels.

What is several pixels wide outlives the mean of four, while half of the noise of single pixels does not.
After Ojala, Pietikäinen and Mäenpää, "Multiresolution gray-scale and rotation invariant texture
classification with local binary patterns", IEEE Transactions on Pattern Analysis and Machine Intelligence 24
(2002) 971-987.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg.segmentation.blocks.lbp import lbp_symbols

COARSE_HALO = 3  # pixels: how far from a pixel its means may reach


def coarse_symbols(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8] | None, cuts: NDArray[np.int32]
) -> NDArray[np.uint16]:
    """LBP code and bin of contrast of the mean of each pixel, those above and to the left of it.

    Its neighbours are the eight means of 2 x 2 pixels that touch it. So a pixel is counted where the 6 x 6
    pixels around are valid.

    Parameters
    ----------
    grey : (M + 6, N + 6) uint16 array
        Image with a border of three pixels.
    valid : (M + 6, N + 6) uint8 array or None
        1 where a pixel is valid; None where all are.
    cuts : (7,) int32 array, from `texture.contrast_cuts`

    Returns
    -------
    symbols : (M, N) uint16 array
        0 to 2047; 65535 where a pixel is not counted.
    """
    rows, cols = (max(length - 2 * COARSE_HALO, 0) for length in grey.shape)
    found = np.empty((rows, cols), np.uint16)
    means = _means_of_2x2(grey)
    whole = None if valid is None else valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1] & valid[1:, 1:]
    for row, col in np.ndindex(2, 2):  # means that touch each other are two pixels apart
        own = found[row::2, col::2]
        if own.size:
            part = np.s_[row : row + 2 * own.shape[0] + 3 : 2, col : col + 2 * own.shape[1] + 3 : 2]
            known = None if whole is None else np.ascontiguousarray(whole[part])
            own[:] = lbp_symbols(np.ascontiguousarray(means[part]), known, cuts)
    return found


def _means_of_2x2(grey: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Of each 2 x 2 pixels, rounded down."""
    pairs = grey[:-1].astype(np.uint32) + grey[1:]
    means: NDArray[np.uint16] = ((pairs[:, :-1] + pairs[:, 1:]) >> 2).astype(np.uint16)
    return means
