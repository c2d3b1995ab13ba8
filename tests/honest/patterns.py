"""Patterns: what honest rasters show, as numbers from 0 to 1."""

from random import Random

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float64]
Shape = tuple[int, int]


def rows(rng: Random, shape: Shape) -> Field:
    """Bars at any angle, of a period of 2 to 40 pixels."""
    angle, period = rng.uniform(0, np.pi), rng.choice([2, 3, 4, 5, 8, 10, 13, 20, 40])
    row, col = np.indices(shape)
    across = np.floor((row * np.cos(angle) + col * np.sin(angle)) * 1e6 + 0.5) / 1e6
    return np.where(across % period < period / 2, 0.8, 0.2)


def grid(rng: Random, shape: Shape) -> Field:
    """Squares at equal distances."""
    side = rng.choice([3, 4, 6, 8, 16])
    row, col = (line % (2 * side) < side for line in np.indices(shape))
    return np.where(row & col, 0.9, 0.3)


def checkers(rng: Random, shape: Shape) -> Field:
    """Squares of two tones."""
    side = rng.choice([1, 2, 3, 8, 16, 37])
    row, col = np.indices(shape) // side
    return np.where((row + col) % 2, 0.75, 0.25)


def things(rng: Random, shape: Shape) -> Field:
    """Rectangles on a plain ground."""
    field = np.full(shape, rng.choice([0.0, 0.2, 0.5]))
    for _ in range(rng.randint(1, 8)):
        row, col = rng.randrange(shape[0]), rng.randrange(shape[1])
        field[row : row + rng.randint(1, 70), col : col + rng.randint(1, 70)] = rng.choice([0.7, 0.9, 1.0])
    return field


def noise(rng: Random, shape: Shape) -> Field:
    """Independent pixels."""
    return drawn(rng).random(shape)


def texture(rng: Random, shape: Shape) -> Field:
    """Two textures side by side, with grain."""
    random = drawn(rng)
    fine = random.normal(0.5, 0.15, shape)
    coarse = random.normal(0.5, 0.15, (shape[0] // 4 + 1, shape[1] // 4 + 1)).repeat(4, 0).repeat(4, 1)
    side = np.indices(shape)[rng.randrange(2)] < max(shape) * rng.random()
    return np.clip(np.where(side, fine, coarse[: shape[0], : shape[1]]), 0, 1)


def gradient(rng: Random, shape: Shape) -> Field:
    """A plane that rises to one side."""
    down, right = rng.random(), rng.random()
    row, col = np.indices(shape)
    return np.asarray((down * row / shape[0] + right * col / shape[1]) / (down + right))


def constant(rng: Random, shape: Shape) -> Field:
    """One value, often exactly a bound of a range."""
    return np.full(shape, rng.choice([0.0, 0.2, 0.25, 0.5, 0.75, 1.0]))


PATTERNS = (rows, grid, checkers, things, things, noise, texture, gradient, constant)


def any_pattern(rng: Random, shape: Shape) -> Field:
    """One of the patterns."""
    return rng.choice(PATTERNS)(rng, shape)


def drawn(rng: Random) -> np.random.Generator:
    """Random arrays that follow from the same seed."""
    return np.random.default_rng(rng.getrandbits(32))


def holes(rng: Random, shape: Shape) -> NDArray[np.bool_]:
    """Valid pixels of a raster with a frame, a corner, a patch, speckle, or all but one pixel missing."""
    valid = np.ones(shape, bool)
    kind = rng.randrange(6)
    if kind == 0:
        width = rng.randint(1, 1 + min(shape) // 3)
        valid[:width], valid[:, :width] = False, False
    elif kind == 1:
        row, col = np.indices(shape)
        valid = row + col > rng.randrange(1 + sum(shape) // 2)
    elif kind == 2:
        row, col = rng.randrange(shape[0]), rng.randrange(shape[1])
        valid[row : row + 50, col : col + 40] = False
    elif kind == 3:
        valid = drawn(rng).random(shape) > rng.choice([0.01, 0.3, 0.9])
    elif kind == 4:
        valid[:] = False
        valid[rng.randrange(shape[0]), rng.randrange(shape[1])] = True
    else:
        valid[::64, ::64] = False
    return valid
