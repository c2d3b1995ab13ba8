"""What users say about a camera and its photographs, as `Photos`."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Camera, Overlap
from uavseg.flight.camera.catalogue import camera_named
from uavseg.flight.camera.photos import SHUTTER_S, Photos


@dataclass(frozen=True, slots=True)
class PhotoWords:
    """How to photograph; all of it is optional.

    Parameters
    ----------
    camera : str, path or Camera, optional
        A name of the catalogue, or a JSON file; see `uavseg.flight.camera.catalogue`.
    sensor, image : (float, float), optional
        In place of a camera: width and height of its sensor in millimetres and of its image in pixels.
    focal : float, optional
        With them: the focal length in millimetres.
    min_interval : float, optional
        With them: the shortest time between two photographs in seconds.
    overlap : (float, float)
        Along the lines and between them, in per cent.
    gimbal_pitch : float
        Degrees; -90 is straight down.
    trigger : {"distance", "interval", "hover", "none"}, optional
        By default by distance, and in hover on a visit.
    shutter : float, optional
        Exposure time in seconds.
    """

    camera: str | os.PathLike[str] | Camera | None = None
    sensor: Sequence[float] | None = None
    image: Sequence[float] | None = None
    focal: float | None = None
    min_interval: float | None = None
    overlap: Sequence[float] = (75.0, 70.0)
    gimbal_pitch: float = -90.0
    trigger: str | None = None
    shutter: float | None = None


def photos_of(words: PhotoWords, pattern: str | None = None) -> Photos | None:
    """How to photograph with a camera that is named or described; None without one.

    Raises
    ------
    ParameterError
        If the camera is not known, a number is out of bounds, or words do not go together.
    """
    camera = _camera(words)
    if camera is None:
        unsaid = PhotoWords()
        for word in ("trigger", "shutter", "gimbal_pitch", "overlap"):
            if not np.array_equal(getattr(words, word), getattr(unsaid, word)):
                option = word.replace("_", "-")
                raise ParameterError(
                    f"--{option} needs a camera (--camera, or --sensor, --image and --focal)"
                )
        return None
    overlap = words.overlap
    if len(overlap) != 2:
        raise ParameterError(f"an overlap is two numbers, along the lines and between them, not {overlap!r}")
    trigger = words.trigger or ("hover" if pattern == "visit" else "distance")
    shutter = SHUTTER_S if words.shutter is None else float(words.shutter)
    both = Overlap(float(overlap[0]), float(overlap[1]))
    return Photos(camera, both, float(words.gimbal_pitch), trigger, shutter)


def _camera(words: PhotoWords) -> Camera | None:
    described = {name: getattr(words, name) for name in ("sensor", "image", "focal", "min_interval")}
    given = [name for name, value in described.items() if value is not None]
    if words.camera is not None:
        if given:
            raise ParameterError(
                f"--camera knows its sensor, image and focal length; leave --{given[0].replace('_', '-')} out"
            )
        return words.camera if isinstance(words.camera, Camera) else camera_named(words.camera)
    if not given:
        return None
    sensor, image, focal = words.sensor, words.image, words.focal
    if sensor is None or image is None or focal is None:
        raise ParameterError("a camera of your own needs all of --sensor WxH, --image WxH and --focal MM")
    if len(sensor) != 2 or len(image) != 2:
        raise ParameterError(f"sensor and image are width and height, not {sensor!r} and {image!r}")
    cols, rows = (_whole(side) for side in image)
    name = f"camera of {sensor[0]:g} x {sensor[1]:g} mm"
    size = (float(sensor[0]), float(sensor[1]))
    return Camera(name, size, (cols, rows), float(focal), float(words.min_interval or 0.0))


def _whole(side: float) -> int:
    if not float(side).is_integer():
        raise ParameterError(f"an image is whole numbers of pixels, such as 5472x3648, not {side}")
    return int(side)
