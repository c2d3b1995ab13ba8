"""Random planes that shapes and textures are drawn with."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Plane = NDArray[np.float64]
Dice = np.random.Generator


def waves(side: int, scale: float, dice: Dice) -> Plane:
    """Smooth noise whose hills are about `scale` pixels wide.

    Parameters
    ----------
    side : int
        Rows, and columns.
    scale : float
        Standard deviation of the Gaussian that white noise is blurred with.
    dice : numpy.random.Generator

    Returns
    -------
    plane : (side, side) float64 array
        Of mean 0 and standard deviation 1.
    """
    return standard(ndimage.gaussian_filter(dice.standard_normal((side, side)), scale, mode="wrap"))


def standard(plane: Plane) -> Plane:
    """A plane moved and scaled to mean 0 and standard deviation 1.

    Examples
    --------
    >>> standard(np.array([[1.0, 3.0]]))
    array([[-1.,  1.]])
    """
    moved = plane - plane.mean()
    return np.asarray(moved / moved.std())


def turned(side: int, angle: float) -> tuple[Plane, Plane]:
    """How far each pixel lies along a direction from the middle, and across it, in pixels."""
    rows, cols = np.indices((side, side), float) - (side - 1) / 2
    return cols * np.cos(angle) + rows * np.sin(angle), rows * np.cos(angle) - cols * np.sin(angle)


def nearest(side: int, pitch: int, dice: Dice) -> tuple[Plane, NDArray[np.intp]]:
    """Points strewn `pitch` pixels apart on average: how far the nearest is, and which one it is."""
    count = max((side // pitch) ** 2, 2)
    free = np.ones((side, side), bool)
    free.flat[dice.choice(side * side, count, replace=False)] = False
    far, places = ndimage.distance_transform_edt(free, return_indices=True)
    names = np.zeros((side, side), np.intp)
    names[~free] = np.arange(count)
    return far, names[tuple(places)]
