"""Textures: planes of mean 0 and standard deviation 1, each a function of a side and a random generator."""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from benchmarks.quality.planes import Plane, Rng, nearest_seed, rotated_axes, smooth_noise, standard

Texture = Callable[[int, Rng], Plane]


def smooth(side: int, rng: Rng) -> Plane:
    """Mown grass: slow variation of brightness."""
    return smooth_noise(side, 40, rng)


def sand(side: int, rng: Rng) -> Plane:
    """Grain of one or two pixels, and faint ripples."""
    return standard(smooth_noise(side, 0.7, rng) + 0.5 * smooth_noise(side, 6, rng))


def forest(side: int, rng: Rng) -> Plane:
    """Tree crowns of about nine pixels: bright tops, dark gaps, different brightness for each tree."""
    distance, labels = nearest_seed(side, 9, rng)
    return standard(-distance + 2 * rng.standard_normal(labels.max() + 1)[labels])


def rows(side: int, rng: Rng) -> Plane:
    """Ploughed or planted rows, 5 to 9 pixels apart, slightly curved."""
    _, across = rotated_axes(side, rng.uniform(0, np.pi))
    bent = across + 4 * smooth_noise(side, 50, rng)
    return standard(np.sin(2 * np.pi * bent / rng.uniform(5, 9)) + 0.3 * smooth_noise(side, 1, rng))


def glint(side: int, rng: Rng) -> Plane:
    """Calm water with sparse bright streaks, a few pixels long."""
    sparks = (rng.random((side, side)) < 0.006).astype(float)
    return standard(np.minimum(ndimage.uniform_filter1d(sparks, 5, axis=1, mode="wrap") * 5, 1))
