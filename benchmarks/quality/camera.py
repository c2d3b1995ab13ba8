"""Image formation: illumination, sensor noise, resolution, bit depth, JPEG compression, and invalid areas."""

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.quality.planes import Plane, Rng, rotated_axes

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Camera:
    """Parameters of the image formation.

    Parameters
    ----------
    noise : float
        Standard deviation of the noise of a sensor pixel, as a fraction of the full range.
    white : int
        The value of v = 1: up to 255 is stored in 8 bits, more in 16.
    light : (float, float)
        Illumination factors at the dark end and at the bright end of the image.
    jpeg : int, optional
        Quality of the compression; none if left out.
    collar : bool
        Whether the image is rotated in its raster, with an invalid collar and one invalid strip.
    coarse : int
        Pixels of the right half are this many times as wide, and resampled.
    """

    noise: float = 0.0
    white: int = 255
    light: tuple[float, float] = (1.0, 1.0)
    jpeg: int | None = None
    collar: bool = False
    coarse: int = 1


def capture(brightness: Plane, camera: Camera, rng: Rng) -> tuple[NDArray[Any], Mask]:
    """The image of a scene.

    Parameters
    ----------
    brightness : (M, M) float64 array
        Radiance of the scene, 0 to 1.
    camera : Camera
    rng : numpy.random.Generator

    Returns
    -------
    values : (M, M) uint8 or uint16 array
        0 where invalid.
    valid : (M, M) bool array
    """
    side = len(brightness)
    along, across = rotated_axes(side, rng.uniform(0, 2 * np.pi))
    lit = brightness * np.interp(along, [-side / 2, side / 2], camera.light)
    noisy = lit + camera.noise * rng.standard_normal(brightness.shape)
    if camera.coarse > 1:
        noisy[:, side // 2 :] = _coarse(lit[:, side // 2 :], camera, rng)
    dtype = np.uint8 if camera.white <= 255 else np.uint16
    values = np.rint(np.clip(noisy, 0, 1) * camera.white).astype(dtype)
    if camera.jpeg is not None:
        values = _jpeg_round_trip(values, camera.jpeg)
    valid = np.ones(brightness.shape, bool)
    if camera.collar:
        valid = (np.maximum(abs(along), abs(across)) < 0.4 * side) & (abs(across + side / 5) > 6)
    return np.where(valid, values, np.zeros_like(values)), valid


def _coarse(lit: Plane, camera: Camera, rng: Rng) -> Plane:
    rows, cols = lit.shape
    size = cols // camera.coarse, rows // camera.coarse  # Pillow's order: width first
    small = np.asarray(Image.fromarray(lit.astype(np.float32)).resize(size, Image.Resampling.BOX))
    noisy = small + np.float32(camera.noise) * rng.standard_normal(small.shape, np.float32)
    resampled = Image.fromarray(noisy).resize((cols, rows), Image.Resampling.BILINEAR)
    return np.asarray(resampled, np.float64)


def _jpeg_round_trip(values: NDArray[Any], quality: int) -> NDArray[Any]:
    buffer = io.BytesIO()
    Image.fromarray(values).save(buffer, "JPEG", quality=quality)
    return np.asarray(Image.open(buffer))
