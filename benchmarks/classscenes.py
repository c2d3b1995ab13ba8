"""Synthetic scenes with known classes, for the evaluation of proposed ranges."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

SIDE = 512

Image = NDArray[np.float64]
Labels = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Scene:
    """An image and the class of each pixel; the darkest class is 0."""

    v: Image
    truth: Labels


def patches(seed: int, shares: tuple[float, ...], scale: float) -> Labels:
    """Class labels with these shares of the image, in blobs about `scale` pixels wide."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(SIDE, SIDE)), scale, mode="wrap")
    labels: Labels = np.searchsorted(np.quantile(field, np.cumsum(shares)[:-1]), field)
    return labels


def shuffled(seed: int, shares: tuple[float, ...], scale: float) -> Labels:
    """Class labels with these shares, where any two classes can be adjacent."""
    labels = np.zeros((SIDE, SIDE), np.int64)
    for k in range(1, len(shares)):
        share = shares[k] / sum(shares[: k + 1])
        labels[patches(seed + 1000 * k, (1 - share, share), scale) == 1] = k
    return labels


def roads(seed: int) -> Labels:
    """Labels of bright lines, 6 pixels wide."""
    rng = np.random.default_rng(seed)
    labels = np.zeros((SIDE, SIDE), np.int64)
    rows, cols = np.mgrid[:SIDE, :SIDE]
    for _ in range(6):
        angle, offset = rng.uniform(0, np.pi), rng.uniform(-SIDE / 3, SIDE / 3)
        bend = 12 * np.sin(rows / rng.uniform(30, 60))
        across = (rows - SIDE / 2) * np.sin(angle) + (cols - SIDE / 2) * np.cos(angle) - offset + bend
        labels[np.abs(across) < 3] = 1
    return labels


def drawn(seed: int, labels: Labels, levels: tuple[float, ...], noise: tuple[float, ...]) -> Scene:
    """A scene with one grey level and one noise level per class."""
    rng = np.random.default_rng(seed + 77)
    v = np.array(levels)[labels] + rng.normal(size=labels.shape) * np.array(noise)[labels]
    return Scene(np.clip(v, 0, 1), labels)


def lit(scene: Scene, amount: float) -> Scene:
    """Add an illumination gradient: darker on the left, brighter on the right."""
    return Scene(np.clip(scene.v + np.linspace(-amount / 2, amount / 2, SIDE), 0, 1), scene.truth)


def grained(seed: int, scene: Scene, amount: float) -> Scene:
    """Add the texture of tree crowns to the darkest class."""
    grain = ndimage.gaussian_filter(np.random.default_rng(seed + 5).normal(size=(SIDE, SIDE)), 2.5)
    return Scene(np.clip(scene.v + amount * grain / grain.std() * (scene.truth == 0), 0, 1), scene.truth)


def _two(seed: int, shares: tuple[float, ...], levels: tuple[float, ...], noise: tuple[float, ...]) -> Scene:
    return drawn(seed, patches(seed, shares, 16), levels, noise)


def _many(seed: int, shares: tuple[float, ...], levels: tuple[float, ...], noise: float) -> Scene:
    return drawn(seed, shuffled(seed, shares, 16), levels, (noise,) * len(levels))


HALVES, BRIGHT = (0.5, 0.5), (0.42, 0.68)
FAMILIES: dict[str, Callable[[int], Scene]] = {
    "two halves, noise 0.05": lambda s: _two(s, HALVES, BRIGHT, (0.05, 0.05)),
    "two halves, noise 0.15": lambda s: _two(s, HALVES, BRIGHT, (0.15, 0.15)),
    "two halves, noise 0.3": lambda s: _two(s, HALVES, BRIGHT, (0.3, 0.3)),
    "bright, a twentieth": lambda s: _two(s, (0.95, 0.05), BRIGHT, (0.08, 0.08)),
    "dark, a twentieth": lambda s: _two(s, (0.05, 0.95), BRIGHT, (0.08, 0.08)),
    "still water, rough land": lambda s: _two(s, (0.4, 0.6), (0.2, 0.5), (0.01, 0.15)),
    "forest and clearings": lambda s: grained(s, _two(s, (0.8, 0.2), (0.3, 0.65), (0.04, 0.06)), 0.07),
    "lit from one side": lambda s: lit(_two(s, (0.7, 0.3), (0.35, 0.65), (0.06, 0.06)), 0.2),
    "roads, 6 px": lambda s: drawn(s, roads(s), (0.35, 0.75), (0.06, 0.06)),
    "islands": lambda s: drawn(s, patches(s, (0.85, 0.15), 5), (0.2, 0.6), (0.05, 0.1)),
    "three even": lambda s: _many(s, (0.34, 0.33, 0.33), (0.2, 0.5, 0.8), 0.1),
    "three, 70:25:5": lambda s: _many(s, (0.7, 0.25, 0.05), (0.25, 0.5, 0.85), 0.08),
    "four even": lambda s: _many(s, (0.25,) * 4, (0.15, 0.38, 0.6, 0.85), 0.08),
    "five even": lambda s: _many(s, (0.2,) * 5, (0.1, 0.3, 0.5, 0.7, 0.9), 0.06),
}
"""Families used to select the smoothing and the depth of a valley."""

HELD_OUT: dict[str, Callable[[int], Scene]] = {
    "two, 70:30, near each other": lambda s: _two(s, (0.7, 0.3), (0.3, 0.55), (0.1, 0.1)),
    "two, 90:10, noise 0.2": lambda s: _two(s, (0.9, 0.1), (0.4, 0.75), (0.2, 0.2)),
    "bright, a fiftieth": lambda s: _two(s, (0.98, 0.02), (0.35, 0.75), (0.08, 0.08)),
    "two within 0.03": lambda s: _two(s, (0.6, 0.4), (0.5, 0.53), (0.01, 0.01)),
    "forest and meadow": lambda s: grained(s, _two(s, (0.6, 0.4), (0.3, 0.6), (0.08, 0.04)), 0.1),
    "small islands": lambda s: drawn(s, patches(s, (0.7, 0.3), 8), (0.25, 0.6), (0.1, 0.1)),
    "three, the middle one common": lambda s: _many(s, (0.2, 0.6, 0.2), (0.15, 0.45, 0.7), 0.1),
    "three near each other": lambda s: _many(s, (0.4, 0.3, 0.3), (0.3, 0.45, 0.6), 0.05),
    "three, lit from one side": lambda s: lit(_many(s, (0.4, 0.3, 0.3), (0.2, 0.5, 0.8), 0.06), 0.1),
    "four, 40:30:20:10": lambda s: _many(s, (0.4, 0.3, 0.2, 0.1), (0.1, 0.35, 0.6, 0.9), 0.08),
}
"""Held-out families, not used to select any parameter."""
