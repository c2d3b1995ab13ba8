"""Morphological dilation of cells by a square.

Not `skimage.morphology.dilation`: the same values in 5 to 20 times the time.
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", np.bool_, np.uint8)


def dilate(cells: NDArray[T], reach: int = 1) -> NDArray[T]:
    """Maximum over the square of ``2 reach + 1`` cells around each cell.

    Parameters
    ----------
    cells : (m, n) bool or uint8 array
    reach : int
        Cells on every side.

    Examples
    --------
    >>> dilate(np.array([[0, 0, 0, 1]], np.uint8))
    array([[0, 0, 1, 1]], dtype=uint8)
    """
    rows = cells.copy()
    for k in range(1, reach + 1):
        np.maximum(rows[k:], cells[:-k], out=rows[k:])
        np.maximum(rows[:-k], cells[k:], out=rows[:-k])
    dilated = rows.copy()
    for k in range(1, reach + 1):
        np.maximum(dilated[:, k:], rows[:, :-k], out=dilated[:, k:])
        np.maximum(dilated[:, :-k], rows[:, k:], out=dilated[:, :-k])
    return dilated
