"""Families of scenes with truth: what is drawn, what covers it, how it is seen."""

import zlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.quality import shapes, textures
from benchmarks.quality.camera import Camera, Mask, seen
from benchmarks.quality.planes import Dice, Plane
from benchmarks.quality.shapes import Shape, without_specks
from benchmarks.quality.textures import Texture

BRIGHT, DARK, EVEN = 0.68, 0.42, 0.55
RANGE = (0.55, 1.0)  # of v: what everybody is asked for
SIDES = (512, 560, 640)  # of seeds 0, 1, 2, 0, ...


@dataclass(frozen=True, slots=True)
class Cover:
    """A texture, and the standard deviation it has in the scene."""

    texture: Texture = textures.smooth
    strength: float = 0.01


_PLAIN, _IDEAL = Cover(), Camera()


@dataclass(frozen=True, slots=True)
class Family:
    """Scenes that differ by their seed alone.

    Parameters
    ----------
    name : str
    shape : callable
        What is bright.
    things, ground : Cover
    camera : Camera
    tones : (float, float)
        Means of the things and of the ground.
    """

    name: str
    shape: Shape
    things: Cover = _PLAIN
    ground: Cover = _PLAIN
    camera: Camera = _IDEAL
    tones: tuple[float, float] = (BRIGHT, DARK)

    @property
    def by_texture(self) -> bool:
        """Whether things differ from the ground by texture alone, so that no range finds them."""
        return self.tones[0] == self.tones[1]


_SAND, _FOREST, _ROWS = Cover(textures.sand, 0.06), Cover(textures.forest, 0.07), Cover(textures.rows, 0.08)
_GLINT = Cover(textures.glint, 0.07)
_TEXTURE = 0.06  # standard deviation of both sides where texture alone differs
FAMILIES = {
    family.name: family
    for family in (
        Family("blobs, no noise", shapes.blobs),
        Family("blobs, noise 0.05", shapes.blobs, camera=Camera(0.05)),
        Family("blobs, noise 0.15", shapes.blobs, camera=Camera(0.15)),
        Family("blobs, noise 0.3", shapes.blobs, camera=Camera(0.3)),
        Family("roads, noise 0.05", shapes.roads, camera=Camera(0.05)),
        Family("roads, noise 0.15", shapes.roads, camera=Camera(0.15)),
        Family("islands, noise 0.05", shapes.islands, camera=Camera(0.05)),
        Family("islands, noise 0.15", shapes.islands, camera=Camera(0.15)),
        Family("terraces", shapes.terraces, camera=Camera(0.1)),
        Family("holes", shapes.holes, camera=Camera(0.1)),
        Family("sand", shapes.coast, _SAND, camera=Camera(0.03)),
        Family("forest", shapes.blobs, ground=_FOREST, camera=Camera(0.03)),
        Family("rows", shapes.parcels, _ROWS, Cover(textures.sand, 0.04), Camera(0.04)),
        Family("glint", shapes.coast, Cover(textures.sand, 0.03), _GLINT, Camera(0.03)),
        Family("gradient", shapes.blobs, camera=Camera(0.08, light=(0.88, 1.18))),
        Family("jpeg", shapes.parcels, camera=Camera(0.05, jpeg=15)),
        Family("16 bit", shapes.coast, _SAND, camera=Camera(0.1, white=4095)),
        Family("collar", shapes.blobs, camera=Camera(0.1, collar=True)),
        Family("resolution", shapes.parcels, _SAND, camera=Camera(0.1, coarse=3)),
        Family("country", shapes.country, _ROWS, _FOREST, Camera(0.06, light=(0.92, 1.08), jpeg=60)),
        Family(
            "equal means: rows in sand",
            shapes.parcels,
            Cover(textures.rows, _TEXTURE),
            Cover(textures.sand, _TEXTURE),
            Camera(0.02),
            (EVEN, EVEN),
        ),
        Family(
            "equal means: forest in meadow",
            shapes.coast,
            Cover(textures.forest, _TEXTURE),
            Cover(textures.smooth, 0.01),
            Camera(0.06),
            (EVEN, EVEN),
        ),
    )
}


@dataclass(frozen=True, eq=False)
class Scene:
    """A raster in memory, and what a person would draw on it.

    Parameters
    ----------
    family : Family
    seed : int
    values : (M, N) uint8 or uint16 array
    valid : (M, N) bool array
    truth : (M, N) bool array
        False where invalid.
    """

    family: Family
    seed: int
    values: NDArray[Any] = field(repr=False)
    valid: Mask = field(repr=False)
    truth: Mask = field(repr=False)

    @cached_property
    def v(self) -> Plane:
        """(M, N) float64 array, 0 to 1; NaN where invalid."""
        return np.where(self.valid, self.values / self.family.camera.white, np.nan)

    def middle(self, side: int) -> "Scene":
        """The square of this side in the middle of the scene, or all of it where it is smaller."""
        place = tuple(slice(max(have - side, 0) // 2, (have + side) // 2) for have in self.truth.shape)
        return replace(self, values=self.values[place], valid=self.valid[place], truth=self.truth[place])


def draw(family: Family, seed: int, side: int | None = None) -> Scene:
    """A scene, the same every time.

    Parameters
    ----------
    family : Family
    seed : int
    side : int, optional
        Rows, and columns; what `SIDES` says, if left out.
    """
    side = SIDES[seed % len(SIDES)] if side is None else side
    dice = np.random.default_rng((zlib.crc32(family.name.encode()), seed))
    truth = without_specks(family.shape(side, dice))
    tones = np.zeros((side, side))
    for mask, cover, tone in zip((truth, ~truth), (family.things, family.ground), family.tones, strict=True):
        tones[mask] = tone + _covering(cover, mask, dice)
    values, valid = seen(tones, family.camera, dice)
    return Scene(family, seed, values, valid, truth & valid)


def _covering(cover: Cover, mask: Mask, dice: Dice) -> Plane:
    """What a texture adds to the pixels of a mask: nothing on average, however small the mask is."""
    plane = cover.strength * cover.texture(len(mask), dice)[mask]
    return np.asarray(plane - plane.mean()) if plane.size else plane
