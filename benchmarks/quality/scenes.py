"""Families of synthetic scenes with ground truth: shape, texture and image formation of each."""

import zlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.quality import shapes, textures
from benchmarks.quality.camera import Camera, Mask, capture
from benchmarks.quality.planes import Plane, Rng
from benchmarks.quality.shapes import Shape, without_specks
from benchmarks.quality.textures import Texture

BRIGHT, DARK, EVEN = 0.68, 0.42, 0.55
RANGE = (0.55, 1.0)  # of v: the range that every method has to find
SIDES = (512, 560, 640)  # of seeds 0, 1, 2; seed 3 has that of seed 0 again


@dataclass(frozen=True, slots=True)
class Cover:
    """A texture, and its standard deviation in the scene."""

    texture: Texture = textures.smooth
    strength: float = 0.01


_SMOOTH, _IDEAL = Cover(), Camera()


@dataclass(frozen=True, slots=True)
class Family:
    """Scenes that differ in their seed alone.

    Parameters
    ----------
    name : str
    shape : callable
        Shape of the bright objects.
    objects, background : Cover
    camera : Camera
    means : (float, float)
        Mean intensities of the objects and of the background.
    """

    name: str
    shape: Shape
    objects: Cover = _SMOOTH
    background: Cover = _SMOOTH
    camera: Camera = _IDEAL
    means: tuple[float, float] = (BRIGHT, DARK)

    @property
    def equal_means(self) -> bool:
        """Whether objects differ from the background by texture alone, so that no range separates them."""
        return self.means[0] == self.means[1]


_SAND, _FOREST, _ROWS = Cover(textures.sand, 0.06), Cover(textures.forest, 0.07), Cover(textures.rows, 0.08)
_GLINT = Cover(textures.glint, 0.07)
_TEXTURE = 0.06  # standard deviation of both classes in the equal-mean families
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
        Family("forest", shapes.blobs, background=_FOREST, camera=Camera(0.03)),
        Family("rows", shapes.parcels, _ROWS, Cover(textures.sand, 0.04), Camera(0.04)),
        Family("glint", shapes.coast, Cover(textures.sand, 0.03), _GLINT, Camera(0.03)),
        Family("gradient", shapes.blobs, camera=Camera(0.08, light=(0.88, 1.18))),
        Family("jpeg", shapes.parcels, camera=Camera(0.05, jpeg=15)),
        Family("16 bit", shapes.coast, _SAND, camera=Camera(0.1, white=4095)),
        Family("collar", shapes.blobs, camera=Camera(0.1, collar=True)),
        Family("resolution", shapes.parcels, _SAND, camera=Camera(0.1, coarse=3)),
        Family("crop rows", shapes.crop_rows, camera=Camera(0.04)),
        Family("grids", shapes.grids, camera=Camera(0.04)),
        Family("small", shapes.small, camera=Camera(0.04)),
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
    """A raster in memory with its ground truth.

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

    def central_crop(self, side: int) -> "Scene":
        """The central square of the scene with this side, or the whole scene if it is smaller."""
        window = tuple(slice(max(length - side, 0) // 2, (length + side) // 2) for length in self.truth.shape)
        return replace(self, values=self.values[window], valid=self.valid[window], truth=self.truth[window])


def draw(family: Family, seed: int, side: int | None = None) -> Scene:
    """Draw a scene, reproducibly.

    Parameters
    ----------
    family : Family
    seed : int
    side : int, optional
        Number of rows, and of columns; by default from `SIDES`.
    """
    side = SIDES[seed % len(SIDES)] if side is None else side
    rng = np.random.default_rng((zlib.crc32(family.name.encode()), seed))
    truth = without_specks(family.shape(side, rng))
    brightness = np.zeros((side, side))
    covers = (family.objects, family.background)
    for mask, cover, mean in zip((truth, ~truth), covers, family.means, strict=True):
        brightness[mask] = mean + _textured(cover, mask, rng)
    values, valid = capture(brightness, family.camera, rng)
    return Scene(family, seed, values, valid, truth & valid)


def _textured(cover: Cover, mask: Mask, rng: Rng) -> Plane:
    """Texture at the pixels of a mask, with mean 0 over the mask."""
    plane = cover.strength * cover.texture(len(mask), rng)[mask]
    return np.asarray(plane - plane.mean()) if plane.size else plane
