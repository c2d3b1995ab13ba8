"""Random fields for drawing shapes and textures: filtered noise, rotated coordinates, Voronoi cells."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Plane = NDArray[np.float64]
Rng = np.random.Generator


def smooth_noise(side: int, scale: float, rng: Rng) -> Plane:
    """Gaussian-filtered white noise, with structures about `scale` pixels wide.

    Parameters
    ----------
    side : int
        Number of rows, and of columns.
    scale : float
        Standard deviation of the Gaussian, in pixels.
    rng : numpy.random.Generator

    Returns
    -------
    plane : (side, side) float64 array
        With mean 0 and standard deviation 1.
    """
    return standard(ndimage.gaussian_filter(rng.standard_normal((side, side)), scale, mode="wrap"))


def standard(plane: Plane) -> Plane:
    """Standardise a plane to mean 0 and standard deviation 1.

    Examples
    --------
    >>> standard(np.array([[1.0, 3.0]]))
    array([[-1.,  1.]])
    """
    centred = plane - plane.mean()
    return np.asarray(centred / centred.std())


def rotated_axes(side: int, angle: float) -> tuple[Plane, Plane]:
    """Coordinates of each pixel along and across a direction, from the centre, in pixels."""
    rows, cols = np.indices((side, side), float) - (side - 1) / 2
    return cols * np.cos(angle) + rows * np.sin(angle), rows * np.cos(angle) - cols * np.sin(angle)


def nearest_seed(side: int, pitch: int, rng: Rng) -> tuple[Plane, NDArray[np.intp]]:
    """Distance to the nearest of random seed points, and its number (a Voronoi diagram).

    The seed points are `pitch` pixels apart on average.
    """
    count = max((side // pitch) ** 2, 2)
    free = np.ones((side, side), bool)
    free.flat[rng.choice(side * side, count, replace=False)] = False
    distance, seeds = ndimage.distance_transform_edt(free, return_indices=True)
    labels = np.zeros((side, side), np.intp)
    labels[~free] = np.arange(count)
    return distance, labels[tuple(seeds)]
