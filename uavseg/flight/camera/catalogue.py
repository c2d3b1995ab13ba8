"""Catalogue of cameras: those that operators own, by name, and cameras in JSON files."""

import csv
import difflib
import os
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path

from uavseg.errors import ParameterError
from uavseg.flight.camera.camera import Camera
from uavseg.json_object import number_in, read_object, word_in

_KEYS = ("sensor_width_mm", "sensor_height_mm", "image_width_px", "image_height_px", "focal_mm")


@cache
def cameras() -> tuple[Camera, ...]:
    """All cameras of the catalogue, sorted by name."""
    text = resources.files("uavseg.flight.camera").joinpath("cameras.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return tuple(
        _camera({key: float(row[key]) for key in (*_KEYS, "min_interval_s")}, row["name"]) for row in rows
    )


def find_cameras(words: str) -> list[Camera]:
    """Cameras whose name has all of some words, in any case and order; all of them for no words.

    Examples
    --------
    >>> [camera.name for camera in find_cameras("mavic thermal")]
    ['DJI Mavic 3 Thermal', 'DJI Mavic 3 Thermal wide']
    """
    wanted = _plain(words).split()
    return [camera for camera in cameras() if all(word in _plain(camera.name) for word in wanted)]


def camera_named(name: str | os.PathLike[str]) -> Camera:
    """A camera by its name in the catalogue, or from a JSON file.

    Parameters
    ----------
    name : str or path
        A name, in any case; part of one, if only one camera has it; or a file that ends in .json.

    Raises
    ------
    ParameterError
        If there is no such camera (the nearest names are given), several have the words, or the file is not
        that of a camera.
    """
    if str(name).lower().endswith(".json"):
        return read_camera(name)
    wanted = _plain(str(name))
    exact = [camera for camera in cameras() if _plain(camera.name) == wanted]
    found = exact or (find_cameras(wanted) if wanted else [])
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(camera.name for camera in found[:6])
        raise ParameterError(f"several cameras are called {name}: {names}; give the whole name")
    near = difflib.get_close_matches(wanted, [_plain(camera.name) for camera in cameras()], 3, 0.4)
    names = ", ".join(camera.name for word in near for camera in cameras() if _plain(camera.name) == word)
    hint = f"the nearest names are {names}" if names else "uavseg cameras lists those that are known"
    raise ParameterError(f"there is no camera called {name}; {hint}")


def read_camera(path: str | os.PathLike[str]) -> Camera:
    """A camera from a JSON file.

    An object with ``sensor_width_mm, sensor_height_mm, image_width_px, image_height_px, focal_mm`` and, if
    they are known, ``name`` and ``min_interval_s``.

    Raises
    ------
    ParameterError
        If the file cannot be read, a key is missing or unknown, or a number is not one.
    """
    expected = f"{', '.join(_KEYS)} and, if they are known, name and min_interval_s"
    given = read_object(path, "camera", expected)
    if not set(_KEYS) <= set(given) <= {*_KEYS, "name", "min_interval_s"}:
        raise ParameterError(f"{path} is not a camera; expected a JSON object with {expected}")
    numbers = {key: number_in(given, key, path, "camera") for key in given if key != "name"}
    return _camera(numbers, word_in(given, "name", Path(path).stem, path, "camera"))


def _camera(numbers: Mapping[str, float], name: str) -> Camera:
    width, height, cols, rows, focal = (numbers[key] for key in _KEYS)
    for side in (cols, rows):
        if not side.is_integer():
            raise ParameterError(f"an image of the camera {name} has a whole number of pixels, not {side:g}")
    interval_s = numbers.get("min_interval_s", 0.0)
    return Camera(name, (width, height), (int(cols), int(rows)), focal, interval_s)


def _plain(name: str) -> str:
    """A name in lower case with single spaces, without punctuation."""
    return " ".join("".join(c if c.isalnum() else " " for c in name.lower()).split())
