"""Line of sight over the cells of a mask, and the length of a path, for the tests of paths."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.occupancy.paths.any_angle import has_line_of_sight


def is_visible(mask: NDArray[np.bool_], one: Any, other: Any) -> bool:
    """Whether every cell that the leg between two centres touches is passable.

    Examples
    --------
    >>> mask = np.array([[1, 1, 1], [1, 0, 1]], bool)
    >>> is_visible(mask, (0, 0), (0, 2)), is_visible(mask, (1, 0), (0, 1))
    (True, False)
    """
    return bool(has_line_of_sight(mask, *one, *other))


def path_length(corners: NDArray[np.int64]) -> float:
    """Length of a path in cells, from corner to corner."""
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())
