"""Families of drawn color scenes, each with one disc within what is wanted and three on other ground.

Colors, noise and shapes differ with the seed. The disc lies in the widest place of what is wanted, the others
at random places; all have one radius.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, gaussian_filter

from benchmarks.likeness import query
from benchmarks.samples import Samples, places
from benchmarks.textures import texture

SIDE = 320
SEEDS = 6
GROUND_DISCS = 3
SMALL = (4, 5, 6, 7, 8, 6)  # radii of small samples in pixels
RADIUS = 16  # pixels, at most

Mask = NDArray[np.bool_]
Planes = NDArray[np.float64]


@dataclass(frozen=True)
class Drawn:
    """A scene: red, green and blue, what is wanted, and the largest radius of a disc in it."""

    planes: Planes
    truth: Mask
    radius: int = RADIUS


def scene(family: str, seed: int, folder: Path, side: int = SIDE) -> Samples:
    """A reproducible scene of a family, written to a folder, with its discs.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    seed : int
    folder : Path
        Where its picture is written.
    side : int
    """
    rng = np.random.default_rng([seed, list(FAMILIES).index(family), 3])
    drawn = FAMILIES[family](rng, seed, side)
    requested = query(folder / f"{family} {seed}.tif", drawn.planes, drawn.truth, drawn.radius)
    against = places(~drawn.truth, int(requested.disc[2]), rng, GROUND_DISCS)
    return Samples(requested.path, requested.image, requested.truth, [requested.disc], against)


def small_sample(rng: np.random.Generator, seed: int, side: int) -> Drawn:
    """Patches of four kinds, and a disc with a radius of 4 to 8 pixels."""
    kind = _patches(rng, side, 4)
    return Drawn(_painted(rng, kind, _colors(rng, 4)), kind == 0, SMALL[seed % len(SMALL)])


def rare(rng: np.random.Generator, seed: int, side: int) -> Drawn:
    """Blobs of 1 to 3 % of the picture on three kinds of ground."""
    kind = 1 + _patches(rng, side, 3)
    field = gaussian_filter(rng.normal(size=(side, side)), side / 24)
    kind[field > np.quantile(field, 1 - 0.01 * (1 + 2 * seed / (SEEDS - 1)))] = 0
    return Drawn(_painted(rng, kind, _colors(rng, 4)), kind == 0)


def frequent(rng: np.random.Generator, _: int, side: int) -> Drawn:
    """Half of the picture, beside two kinds of ground."""
    kind = 1 + _patches(rng, side, 2)
    field = gaussian_filter(rng.normal(size=(side, side)), side / 14)
    kind[field > np.median(field)] = 0
    return Drawn(_painted(rng, kind, _colors(rng, 3)), kind == 0)


def thin_lines(rng: np.random.Generator, seed: int, side: int) -> Drawn:
    """Tracks 2 to 4 pixels wide and one yard, in which the disc lies, on three kinds of ground."""
    kind = 1 + _patches(rng, side, 3)
    truth = np.zeros((side, side), bool)
    for _ in range(6):
        place, heading = rng.uniform(0, side, 2), rng.uniform(0, 2 * np.pi)
        for _ in range(2 * side):
            heading += rng.normal(0, 0.05)
            place += np.sin(heading), np.cos(heading)
            if (place >= 0).all() and (place < side).all():
                truth[tuple(place.astype(int))] = True
    truth = binary_dilation(truth, np.ones((2 + seed % 3,) * 2))
    row, col = np.indices(truth.shape)
    yard = rng.uniform(side / 4, side * 3 / 4, 2)
    truth |= (abs(row - yard[0]) < 11) & (abs(col - yard[1]) < 14)
    kind[truth] = 0
    return Drawn(_painted(rng, kind, _colors(rng, 4)), truth)


def slow_light(rng: np.random.Generator, _: int, side: int) -> Drawn:
    """Patches of four kinds under light that grows from 0.6 to 1.5."""
    kind = _patches(rng, side, 4)
    slow = gaussian_filter(rng.normal(size=(side, side)), side / 7)
    light = np.interp(slow, [slow.min(), slow.max()], [0.6, 1.5])
    return Drawn(light * _painted(rng, kind, 0.8 * _colors(rng, 4)), kind == 0)


def color_with_texture(rng: np.random.Generator, seed: int, side: int) -> Drawn:
    """A neighbour of another texture and the same color, and one of another color and the same texture."""
    return _textured(rng, seed, _patches(rng, side, 3, side / 9))


def narrow_textures(rng: np.random.Generator, seed: int, side: int) -> Drawn:
    """The same in narrower patches, few of which hold windows of 32 pixels."""
    return _textured(rng, seed, _patches(rng, side, 3))


def rows_of_two_colors(rng: np.random.Generator, _: int, side: int) -> Drawn:
    """Rows of two colors, 8 pixels apart, beside a field of each of the two and one of another."""
    kind = _patches(rng, side, 4)
    colors = _colors(rng, 4)
    row, col = np.indices(kind.shape)
    angle = rng.uniform(0, np.pi)
    odd = np.sin((row * np.sin(angle) + col * np.cos(angle)) * 2 * np.pi / 8) > 0
    painted = np.where(kind == 0, np.where(odd, 1, 2), kind)
    return Drawn(_painted(rng, painted, colors), kind == 0, 24)


def many_kinds(rng: np.random.Generator, _: int, side: int) -> Drawn:
    """Patches of eight kinds with more noise."""
    kind = _patches(rng, side, 8)
    return Drawn(_painted(rng, kind, _colors(rng, 8), 0.06), kind == 0)


TEXTURE_PAIRS = (
    ("rows", "meadow"),
    ("forest", "sand"),
    ("meadow", "rows"),
    ("glint", "meadow"),
    ("sand", "meadow"),
    ("forest", "meadow"),
)
FAMILIES: dict[str, Callable[[np.random.Generator, int, int], Drawn]] = {
    "small sample, radius 4 to 8": small_sample,
    "rare, 1 to 3 %": rare,
    "frequent, half": frequent,
    "thin lines and a yard": thin_lines,
    "slow light": slow_light,
    "color with texture": color_with_texture,
    "rows of two colors": rows_of_two_colors,
    "one of eight kinds": many_kinds,
    "color with texture, narrow": narrow_textures,
}


def _patches(
    rng: np.random.Generator, side: int, classes: int, sigma: float | None = None
) -> NDArray[np.int64]:
    sigma = side / 14 if sigma is None else sigma
    return np.asarray(gaussian_filter(rng.normal(size=(classes, side, side)), (0, sigma, sigma)).argmax(0))


def _textured(rng: np.random.Generator, seed: int, kind: NDArray[np.int64]) -> Drawn:
    side = len(kind)
    wanted, other = TEXTURE_PAIRS[seed % len(TEXTURE_PAIRS)]
    grey = np.where(kind == 1, texture(rng, other, side), texture(rng, wanted, side))
    shift = _direction(rng) * 0.16
    planes = grey + (kind == 2) * shift[:, None, None] + rng.normal(0, 0.02, (3, side, side))
    return Drawn(planes, kind == 0, 44)


def _direction(rng: np.random.Generator) -> NDArray[np.float64]:
    drawn = rng.normal(size=3)
    return np.asarray(drawn / np.linalg.norm(drawn))


def _colors(rng: np.random.Generator, classes: int) -> NDArray[np.float64]:
    """Colors of kinds of ground, at least 0.1 apart; the nearest to the first is 0.1 to 0.16 from it."""
    colors = [rng.uniform(0.35, 0.65, 3)]
    colors.append(colors[0] + _direction(rng) * rng.uniform(0.1, 0.16))
    while len(colors) < classes:
        other = rng.uniform(0.2, 0.8, 3)
        if min(np.linalg.norm(other - color) for color in colors) > 0.1:
            colors.append(other)
    return np.array(colors)


def _painted(
    rng: np.random.Generator, kind: NDArray[np.int64], colors: NDArray[np.float64], noise: float = 0.035
) -> Planes:
    """Each kind in its color, with noise in each band and a grain of luminance."""
    grain = gaussian_filter(rng.normal(size=kind.shape), 1.5)
    planes = np.moveaxis(colors[kind], -1, 0) + noise * grain / grain.std()
    return np.asarray(planes + rng.normal(0, noise, planes.shape))
