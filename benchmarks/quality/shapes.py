"""Shapes of the objects: ground-truth masks, each a function of a side and a random generator."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.quality.planes import Rng, nearest_seed, rotated_axes, smooth_noise

Mask = NDArray[np.bool_]
Shape = Callable[[int, Rng], Mask]

MIN_PIXELS = 9  # smaller components and holes are removed from the ground truth
_PITCH = 28  # pixels between the centres of islands
_RADII = (2.0, 8.0)


def blobs(side: int, rng: Rng) -> Mask:
    """Rounded blobs of several sizes."""
    return (smooth_noise(side, 30, rng) > 0.6) | (smooth_noise(side, 10, rng) > 1.7)


def roads(side: int, rng: Rng) -> Mask:
    """Ten curved roads, 3 to 12 pixels wide, which cross."""
    return np.asarray(np.logical_or.reduce([road(side, width, rng) for width in range(3, 13)]))


def road(side: int, width: float, rng: Rng) -> Mask:
    """A sinusoidal road from one side of the image to the other."""
    along, across = rotated_axes(side, rng.uniform(0, np.pi))
    turn = 2 * np.pi / (side * rng.uniform(0.6, 1.2))
    sway, phase, offset = rng.uniform(5, 15), rng.uniform(0, 6), rng.uniform(-0.4, 0.4) * side
    beside = across - offset - sway * np.sin(turn * along + phase)
    steep = sway * turn * np.cos(turn * along + phase)
    return np.asarray(np.abs(beside) / np.hypot(1, steep) < width / 2)


def islands(side: int, rng: Rng) -> Mask:
    """Hundreds of small ellipses that do not touch, of 2 to 8 pixels radius."""
    count = -(-side // _PITCH)
    shift = rng.uniform(-3, 3, (2, count, count)) + _PITCH / 2
    radius = rng.uniform(*_RADII, (count, count))
    stretch = rng.uniform(0.8, 1.25, (count, count))
    rows, cols = np.indices((side, side))
    cell = rows // _PITCH, cols // _PITCH
    down, right = rows % _PITCH - shift[0][cell], cols % _PITCH - shift[1][cell]
    return np.asarray(np.hypot(down * stretch[cell], right / stretch[cell]) < radius[cell])


def terraces(side: int, rng: Rng) -> Mask:
    """Winding strips between contour lines: concave, with few pixels far from a boundary."""
    return np.asarray((3 * smooth_noise(side, 60, rng)) % 1 < 0.5)


def holes(side: int, rng: Rng) -> Mask:
    """Large regions with small holes."""
    return (smooth_noise(side, 50, rng) > -0.2) & ~islands(side, rng)


def parcels(side: int, rng: Rng) -> Mask:
    """Voronoi cells, two out of five: fields with straight borders and sharp corners."""
    _, labels = nearest_seed(side, 64, rng)
    return np.asarray(rng.random(labels.max() + 1)[labels] < 0.4)


def coast(side: int, rng: Rng) -> Mask:
    """A shoreline that is rough at several scales."""
    heights = [weight * smooth_noise(side, 60 * weight, rng) for weight in (1, 0.4, 0.15, 0.05)]
    return np.asarray(np.sum(heights, axis=0) > 0.1)


def crop_rows(side: int, rng: Rng) -> Mask:
    """Straight rows in Voronoi cells: 3 to 8 pixels wide, with gaps of 2 to 12, at any angle."""
    _, fields = nearest_seed(side, 128, rng)
    mask = np.zeros((side, side), bool)
    for field in range(fields.max() + 1):
        along, _ = rotated_axes(side, rng.uniform(0, np.pi))
        width = rng.uniform(3, 8)
        mask |= (fields == field) & (along % (width + rng.uniform(2, 12)) < width)
    return mask


def grids(side: int, rng: Rng) -> Mask:
    """Squares of 4 to 10 pixels in rows and columns, as trees and solar panels stand."""
    mask = np.zeros((side, side), bool)
    rows, cols = np.indices((side, side))
    for part in np.indices((2, 2)).reshape(2, -1).T:
        width = int(rng.integers(4, 11))
        pitch = int(width * rng.uniform(2, 3))
        here = (rows * 2 // side == part[0]) & (cols * 2 // side == part[1])
        mask |= here & (rows % pitch < width) & (cols % pitch < width)
    return mask


def small(side: int, rng: Rng) -> Mask:
    """Rectangles of 3 to 7 pixels, one in each square of 32 pixels: cars and stones."""
    mask = np.zeros((side, side), bool)
    for row in range(0, side - 31, 32):
        for col in range(0, side - 31, 32):
            (top, left), (height, width) = rng.integers(0, 24, 2), rng.integers(3, 8, 2)
            mask[row + top : row + top + height, col + left : col + left + width] = True
    return mask


def country(side: int, rng: Rng) -> Mask:
    """Fields and roads."""
    return parcels(side, rng) & (smooth_noise(side, 80, rng) > 0) | roads(side, rng)


def without_specks(mask: Mask, min_pixels: int = MIN_PIXELS) -> Mask:
    """Remove components of fewer than `min_pixels` pixels, then holes of that size.

    Examples
    --------
    >>> without_specks(np.array([[1, 1, 0, 1]], bool), 2)
    array([[ True,  True, False, False]])
    """
    for value in (True, False):
        labels, _ = ndimage.label(mask == value)
        small = np.bincount(labels.ravel()) < min_pixels
        small[0] = False
        mask = np.where(small[labels], not value, mask)
    return mask
