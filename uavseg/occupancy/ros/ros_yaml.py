"""The YAML file of a ROS map: how its picture becomes cells, and where they lie."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import MapError, RasterReadError

Cells = NDArray[np.int8]

UNKNOWN = -1
MODES = ("trinary", "scale", "raw")

_WANTED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


@dataclass(frozen=True, slots=True)
class Reading:
    """How a picture's grey becomes cells.

    Parameters
    ----------
    mode : {"trinary", "scale", "raw"}
    negate : bool
        White is occupied.
    occupied, free : float
        Thresholds of occupancy.

    Raises
    ------
    MapError
        If the mode is another, or the thresholds overlap or are not finite.
    """

    mode: str
    negate: bool
    occupied: float
    free: float

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise MapError(f"mode is trinary, scale or raw, not {self.mode!r}")
        if not (math.isfinite(self.occupied) and math.isfinite(self.free)):
            raise MapError(f"thresholds are finite, not {self.occupied:g} and {self.free:g}")
        if self.free >= self.occupied:
            raise MapError(
                f"free_thresh ({self.free:g}) lies below occupied_thresh ({self.occupied:g}), "
                "so that no cell is free and occupied at once"
            )

    def cells(self, grey: NDArray[np.uint8], opaque: NDArray[np.bool_] | None = None) -> Cells:
        """Cells of 8-bit grey; what is not quite opaque is unknown, except to the mode raw."""
        cells = self.table()[grey]
        if opaque is not None and self.mode != "raw":
            cells[~opaque] = UNKNOWN
        return cells

    def table(self) -> Cells:
        """The cell of every grey, a (256,) array."""
        grey = np.arange(256)
        if self.mode == "raw":
            return np.where(grey <= 100, grey, UNKNOWN).astype(np.int8)
        light = grey.astype(np.float32) / np.float32(255)
        occupancy = light if self.negate else np.float32(1) - light
        occupied, free = np.float32(self.occupied), np.float32(self.free)
        between = np.full(256, UNKNOWN)
        if self.mode == "scale":
            percent = (occupancy - free) / np.float32(self.occupied - self.free) * np.float32(100)
            between = np.floor(percent.astype(np.float64) + 0.5)  # halves up, exactly
        cells = np.where(occupancy <= free, 0, np.where(occupancy >= occupied, 100, between))
        return cells.astype(np.int8)


@dataclass(frozen=True, slots=True)
class Description:
    """What the YAML file of a ROS map says.

    Parameters
    ----------
    image : Path
        Of the picture; a relative one is seen from the YAML file.
    resolution : float
        Metres per cell.
    origin : (float, float, float)
        x and y of the lower left corner in metres, and the yaw in radians.
    reading : Reading
    """

    image: Path
    resolution: float
    origin: tuple[float, float, float]
    reading: Reading


def read_description(path: str | os.PathLike[str]) -> Description:
    """What a YAML file says, checked.

    Raises
    ------
    MapError
        If it is not as ROS wants it.
    RasterReadError
        If it cannot be read.
    """
    found = _read_yaml(path)
    try:
        reading = Reading(
            str(found.get("mode", "trinary")).lower(),
            _flag(found),
            _number("occupied_thresh", found["occupied_thresh"]),
            _number("free_thresh", found["free_thresh"]),
        )
        return Description(_image(path, found["image"]), _resolution(found), _origin(found), reading)
    except MapError as error:
        raise MapError(f"{os.fspath(path)}: {error}") from error


def description_text(described: Mapping[str, Any]) -> str:
    """The text of a YAML file, lists on one line."""
    import yaml

    text: str = yaml.safe_dump(dict(described), sort_keys=False, default_flow_style=None)
    return text


def _read_yaml(path: str | os.PathLike[str]) -> Mapping[str, Any]:
    import yaml

    name = os.fspath(path)
    try:
        with Path(path).open("rb") as file:
            found = yaml.safe_load(file)
    except FileNotFoundError as error:
        raise RasterReadError(f"there is no file {name}") from error
    except OSError as error:
        raise RasterReadError(f"{name} cannot be read ({error.strerror})") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise MapError(f"{name} is no YAML ({' '.join(str(error).split())})") from error
    if not isinstance(found, dict):
        raise MapError(f"{name} is not the YAML of a ROS map: it wants {', '.join(_WANTED)}")
    missing = [key for key in _WANTED if key not in found]
    if missing:
        raise MapError(f"{name}: a ROS map wants {', '.join(_WANTED)}; missing here: {', '.join(missing)}")
    return found


def _number(name: str, value: Any) -> float:
    """A number as YAML readers in C++ take it: quoted or not, 5e-2 without a point as well."""
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        return float(value)
    except ValueError as error:
        raise MapError(f"{name} is a number, not {value!r}") from error


def _flag(described: Mapping[str, Any]) -> bool:
    value = described["negate"]
    if isinstance(value, str) and value.strip().lstrip("+-").isdigit():
        value = int(value)
    if not isinstance(value, int):
        raise MapError(f"negate is 0 or 1, not {value!r}")
    return bool(value)


def _resolution(described: Mapping[str, Any]) -> float:
    resolution = _number("resolution", described["resolution"])
    if not (math.isfinite(resolution) and resolution > 0):
        raise MapError(f"resolution is metres per cell, a number above 0, not {resolution:g}")
    return resolution


def _origin(described: Mapping[str, Any]) -> tuple[float, float, float]:
    value = described["origin"]
    if not isinstance(value, list) or len(value) != 3:
        raise MapError(f"origin is a list of three numbers, x, y and yaw, not {value!r}")
    x, y, yaw = (_number("origin", part) for part in value)
    if not all(math.isfinite(part) for part in (x, y, yaw)):
        raise MapError(f"origin wants finite x, y and yaw, not {value!r}")
    return x, y, yaw


def _image(path: str | os.PathLike[str], named: Any) -> Path:
    if not isinstance(named, str) or not named:
        raise MapError(f"image is the name of a picture, not {named!r}")
    return Path(path).parent / named
