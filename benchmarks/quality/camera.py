"""What a camera makes of a scene: light, noise, resolution, bits, JPEG, and where it saw nothing."""

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.quality.planes import Dice, Plane, turned

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Camera:
    """How a scene is seen.

    Parameters
    ----------
    noise : float
        Standard deviation of what is added to each pixel of the sensor, of the full range.
    white : int
        The value of v = 1: 255 is stored in 8 bits, more in 16.
    light : (float, float)
        What tones are multiplied with at the dark end and at the bright end of the picture.
    jpeg : int, optional
        Quality.
    collar : bool
        Whether the picture lies askew in its raster, with nothing around it and a strip missing.
    coarse : int
        The right half is seen with pixels so many times as wide, and resampled.
    """

    noise: float = 0.0
    white: int = 255
    light: tuple[float, float] = (1.0, 1.0)
    jpeg: int | None = None
    collar: bool = False
    coarse: int = 1


def seen(tones: Plane, camera: Camera, dice: Dice) -> tuple[NDArray[Any], Mask]:
    """The raster of a scene.

    Parameters
    ----------
    tones : (M, M) float64 array
        Brightness, 0 to 1, as it is.
    camera : Camera
    dice : numpy.random.Generator

    Returns
    -------
    values : (M, M) uint8 or uint16 array
        0 where nothing was seen.
    valid : (M, M) bool array
    """
    side = len(tones)
    along, across = turned(side, dice.uniform(0, 2 * np.pi))
    lit = tones * np.interp(along, [-side / 2, side / 2], camera.light)
    noisy = lit + camera.noise * dice.standard_normal(tones.shape)
    if camera.coarse > 1:
        noisy[:, side // 2 :] = _coarse(lit[:, side // 2 :], camera, dice)
    dtype = np.uint8 if camera.white <= 255 else np.uint16
    values = np.rint(np.clip(noisy, 0, 1) * camera.white).astype(dtype)
    if camera.jpeg is not None:
        values = _through_jpeg(values, camera.jpeg)
    valid = np.ones(tones.shape, bool)
    if camera.collar:
        valid = (np.maximum(abs(along), abs(across)) < 0.4 * side) & (abs(across + side / 5) > 6)
    return np.where(valid, values, np.zeros_like(values)), valid


def _coarse(lit: Plane, camera: Camera, dice: Dice) -> Plane:
    rows, cols = lit.shape
    fewer = cols // camera.coarse, rows // camera.coarse  # as Pillow has it: width first
    small = np.asarray(Image.fromarray(lit.astype(np.float32)).resize(fewer, Image.Resampling.BOX))
    noisy = small + np.float32(camera.noise) * dice.standard_normal(small.shape, np.float32)
    resampled = Image.fromarray(noisy).resize((cols, rows), Image.Resampling.BILINEAR)
    return np.asarray(resampled, np.float64)


def _through_jpeg(values: NDArray[Any], quality: int) -> NDArray[Any]:
    packed = io.BytesIO()
    Image.fromarray(values).save(packed, "JPEG", quality=quality)
    return np.asarray(Image.open(packed))
