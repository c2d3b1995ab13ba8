"""What covers the ground: planes of mean 0 and deviation 1, each a function of a side and of dice."""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from benchmarks.quality.planes import Dice, Plane, nearest, standard, turned, waves

Texture = Callable[[int, Dice], Plane]


def smooth(side: int, dice: Dice) -> Plane:
    """Mown grass: slow changes of tone."""
    return waves(side, 40, dice)


def sand(side: int, dice: Dice) -> Plane:
    """Grain of a pixel or two, and faint ripples."""
    return standard(waves(side, 0.7, dice) + 0.5 * waves(side, 6, dice))


def forest(side: int, dice: Dice) -> Plane:
    """Crowns of about nine pixels: bright tops, dark gaps, each tree of its own tone."""
    far, names = nearest(side, 9, dice)
    return standard(-far + 2 * dice.standard_normal(names.max() + 1)[names])


def rows(side: int, dice: Dice) -> Plane:
    """Ploughed or planted rows, 5 to 9 pixels apart, a little bent."""
    _, across = turned(side, dice.uniform(0, np.pi))
    bent = across + 4 * waves(side, 50, dice)
    return standard(np.sin(2 * np.pi * bent / dice.uniform(5, 9)) + 0.3 * waves(side, 1, dice))


def glint(side: int, dice: Dice) -> Plane:
    """Water: calm, with sparse bright streaks a few pixels long."""
    sparks = (dice.random((side, side)) < 0.006).astype(float)
    return standard(np.minimum(ndimage.uniform_filter1d(sparks, 5, axis=1, mode="wrap") * 5, 1))
