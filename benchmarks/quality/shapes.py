"""What a person would draw: masks of bright things, each a function of a side and of dice."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.quality.planes import Dice, nearest, turned, waves

Mask = NDArray[np.bool_]
Shape = Callable[[int, Dice], Mask]

SPECK = 9  # pixels: smaller pieces, and smaller holes, are drawn by nobody
_PITCH = 28  # pixels from disc to disc
_RADII = (2.0, 8.0)


def blobs(side: int, dice: Dice) -> Mask:
    """Round shores of several sizes."""
    return (waves(side, 30, dice) > 0.6) | (waves(side, 10, dice) > 1.7)


def roads(side: int, dice: Dice) -> Mask:
    """Ten bent roads, 3 to 12 pixels wide, which cross."""
    return np.asarray(np.logical_or.reduce([road(side, width, dice) for width in range(3, 13)]))


def road(side: int, width: float, dice: Dice) -> Mask:
    """A road that sways from one end of the picture to the other."""
    along, across = turned(side, dice.uniform(0, np.pi))
    turn = 2 * np.pi / (side * dice.uniform(0.6, 1.2))
    sway, phase, offset = dice.uniform(5, 15), dice.uniform(0, 6), dice.uniform(-0.4, 0.4) * side
    beside = across - offset - sway * np.sin(turn * along + phase)
    steep = sway * turn * np.cos(turn * along + phase)
    return np.asarray(np.abs(beside) / np.hypot(1, steep) < width / 2)


def islands(side: int, dice: Dice) -> Mask:
    """Hundreds of small ellipses that do not touch, of 2 to 8 pixels radius."""
    count = -(-side // _PITCH)
    shift = dice.uniform(-3, 3, (2, count, count)) + _PITCH / 2
    radius = dice.uniform(*_RADII, (count, count))
    stretch = dice.uniform(0.8, 1.25, (count, count))
    rows, cols = np.indices((side, side))
    cell = rows // _PITCH, cols // _PITCH
    down, right = rows % _PITCH - shift[0][cell], cols % _PITCH - shift[1][cell]
    return np.asarray(np.hypot(down * stretch[cell], right / stretch[cell]) < radius[cell])


def terraces(side: int, dice: Dice) -> Mask:
    """Winding strips between the contours of hills: concave, seldom far from a boundary."""
    return np.asarray((3 * waves(side, 60, dice)) % 1 < 0.5)


def holes(side: int, dice: Dice) -> Mask:
    """Large regions with small holes in them."""
    return (waves(side, 50, dice) > -0.2) & ~islands(side, dice)


def parcels(side: int, dice: Dice) -> Mask:
    """Fields with straight borders and sharp corners, two of five of them."""
    _, names = nearest(side, 64, dice)
    return np.asarray(dice.random(names.max() + 1)[names] < 0.4)


def coast(side: int, dice: Dice) -> Mask:
    """A shore that is rough at every scale."""
    heights = [weight * waves(side, 60 * weight, dice) for weight in (1, 0.4, 0.15, 0.05)]
    return np.asarray(np.sum(heights, axis=0) > 0.1)


def country(side: int, dice: Dice) -> Mask:
    """Fields, roads between them and small bare patches."""
    return parcels(side, dice) & (waves(side, 80, dice) > 0) | roads(side, dice)


def without_specks(mask: Mask, least: int = SPECK) -> Mask:
    """A mask without pieces of fewer than `least` pixels, and then without such holes.

    Examples
    --------
    >>> without_specks(np.array([[1, 1, 0, 1]], bool), 2)
    array([[ True,  True, False, False]])
    """
    for wanted in (True, False):
        names, _ = ndimage.label(mask == wanted)
        small = np.bincount(names.ravel()) < least
        small[0] = False
        mask = np.where(small[names], not wanted, mask)
    return mask
