"""Morphological dilation of cells by a square.

Not `skimage.morphology.dilation`: the same values in 5 to 20 times the time.
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", np.bool_, np.uint8)


def dilate(cells: NDArray[T], reach: int = 1) -> NDArray[T]:
    """Return the maximum over the square of ``2 reach + 1`` cells around each cell.

    Examples
    --------
    >>> dilate(np.array([[0, 0, 0, 1]], np.uint8))
    array([[0, 0, 1, 1]], dtype=uint8)
    """
    size = 2 * reach + 1
    for axis in (0, 1):
        cells = np.pad(cells, [(reach, reach) if k == axis else (0, 0) for k in (0, 1)])
        width = 1
        while width < size:  # a window of maxima that doubles
            step = min(width, size - width)
            one, other = (slice(None, -step), slice(step, None))
            pair = (cells[one], cells[other]) if axis == 0 else (cells[:, one], cells[:, other])
            cells = np.maximum(*pair)
            width += step
    return cells
