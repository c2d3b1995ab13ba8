"""Morphological dilation of cells by a square."""

from typing import Any, TypeVar

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
    dilated: NDArray[Any] = cells
    for axis in (0, 1):
        line = np.moveaxis(dilated, axis, 0)
        wide = line.copy()
        for k in range(1, reach + 1):
            np.maximum(wide[k:], line[:-k], out=wide[k:])
            np.maximum(wide[:-k], line[k:], out=wide[:-k])
        dilated = np.moveaxis(wide, 0, axis)
    return np.ascontiguousarray(dilated)
