"""YAML metadata of a ROS map: thresholds that turn its image into cells, resolution and origin."""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import MapError
from uavseg.inputs import check_yaml_brackets, read_bytes
from uavseg.plain_text import cause_of, shown

RosCells = NDArray[np.int8]

MAX_BYTES = 1 << 16  # of a YAML file
UNKNOWN_CELL = -1
ROS_MODES = ("trinary", "scale", "raw")

_MAX_THRESHOLD = 1e6
_REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


@dataclass(frozen=True, slots=True)
class CellRules:
    """The rules that turn the grey of an image into cells."""

    mode: str
    negate: bool  # white is occupied
    occupied: float  # thresholds of occupancy
    free: float

    def __post_init__(self) -> None:
        if self.mode not in ROS_MODES:
            raise MapError(f"mode is trinary, scale or raw, not {shown(self.mode)}")
        if not (abs(self.occupied) <= _MAX_THRESHOLD and abs(self.free) <= _MAX_THRESHOLD):
            given = f"{self.occupied:g} and {self.free:g}"
            raise MapError(f"thresholds are finite and at most {_MAX_THRESHOLD:g}, not {given}")
        if self.mode != "raw" and max(self.occupied, self.free) > 1:
            given = f"occupied_thresh {self.occupied:g} and free_thresh {self.free:g}"
            raise MapError(f"thresholds are fractions of at most 1, not {given}{self._as_per_cent()}")
        if self.free >= self.occupied:
            raise MapError(
                f"free_thresh ({self.free:g}) lies below occupied_thresh ({self.occupied:g}), "
                "so that no cell is free and occupied at once"
            )

    def _as_per_cent(self) -> str:
        """Suggest thresholds as fractions, where they may be per cent."""
        if not (0 <= self.free <= 100 and self.occupied <= 100):
            return ""
        return f"; as per cent they are {self.occupied / 100:g} and {self.free / 100:g}"

    def cells(self, grey: NDArray[np.uint8], alpha: NDArray[np.uint8] | None = None) -> RosCells:
        """Convert 8-bit grey to cells; pixels that are not opaque are unknown, except in the mode raw."""
        cells = self.table()[grey]
        if alpha is not None and self.mode != "raw":
            cells[alpha < 255] = UNKNOWN_CELL
        return cells

    def cells_before_2025(self, grey: NDArray[np.uint8], alpha: NDArray[np.uint8]) -> RosCells:
        """Convert a trinary map with alpha as Nav2 up to Jazzy does, which averages alpha into the grey."""
        brightness = (3 * grey.astype(np.float64) + alpha) / (4 * 255)
        occupancy = brightness if self.negate else 1 - brightness
        cells = np.where(occupancy > self.occupied, 100, np.where(occupancy < self.free, 0, UNKNOWN_CELL))
        return cells.astype(np.int8)

    def table(self) -> RosCells:
        """Return the lookup table from grey to cell, a (256,) int8 array."""
        grey = np.arange(256)
        if self.mode == "raw":
            return np.where(grey <= 100, grey, UNKNOWN_CELL).astype(np.int8)
        brightness = grey.astype(np.float32) / np.float32(255)
        occupancy = brightness if self.negate else np.float32(1) - brightness
        occupied, free = np.float32(self.occupied), np.float32(self.free)
        between = np.full(256, UNKNOWN_CELL)
        if self.mode == "scale":
            percent = (occupancy - free) / np.float32(self.occupied - self.free) * np.float32(100)
            between = np.floor(percent.astype(np.float64) + 0.5)  # halves up, exactly
        cells = np.where(occupancy <= free, 0, np.where(occupancy >= occupied, 100, between))
        return cells.astype(np.int8)


@dataclass(frozen=True, slots=True)
class MapDescription:
    """The contents of the YAML file of a ROS map."""

    image: Path  # path of the image; a relative one is relative to the YAML file
    resolution: float  # metres per cell
    origin: tuple[float, float, float]  # x and y of the lower left corner in metres, and the yaw in radians
    rules: CellRules


def read_ros_yaml(path: str | os.PathLike[str]) -> MapDescription:
    """Read and check the YAML file of a ROS map."""
    content = _read_yaml(path)
    try:
        rules = CellRules(
            mode=str(content.get("mode", "trinary")).lower(),
            negate=_flag(content["negate"]),
            occupied=_number("occupied_thresh", content["occupied_thresh"]),
            free=_number("free_thresh", content["free_thresh"]),
        )
        image = _image(path, content["image"])
        resolution = _number("resolution", content["resolution"])
        if not (math.isfinite(resolution) and resolution > 0):
            raise MapError(f"resolution is metres per cell, a number above 0, not {resolution:g}")
        origin = _origin(content["origin"])
        return MapDescription(image=image, resolution=resolution, origin=origin, rules=rules)
    except MapError as error:
        raise MapError(f"{os.fspath(path)}: {error}") from error


def ros_yaml_text(content: Mapping[str, Any]) -> str:
    """Write the text of a YAML file, with lists on one line."""
    import yaml

    text: str = yaml.safe_dump(dict(content), sort_keys=False, default_flow_style=None)
    return text


def _read_yaml(path: str | os.PathLike[str]) -> Mapping[str, Any]:
    import yaml

    name = os.fspath(path)
    content = read_bytes(path, limit=MAX_BYTES)
    try:
        check_yaml_brackets(content)
        tokens = yaml.scan(content, Loader=yaml.SafeLoader)
        if any(isinstance(token, yaml.AliasToken) for token in tokens):
            raise MapError(f"{name} holds YAML aliases (*name), which the file of a ROS map does not need")
        node = yaml.compose(content, Loader=yaml.SafeLoader)
        _check_unique_keys(node, name)
        described = yaml.safe_load(content)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        if isinstance(error, MapError):
            raise
        raise MapError(f"{name} is not valid YAML ({cause_of(error)})") from error
    if not isinstance(described, dict):
        raise MapError(f"{name} is not the YAML of a ROS map: it needs {', '.join(_REQUIRED)}")
    missing = [key for key in _REQUIRED if key not in described]
    if missing:
        raise MapError(f"{name}: a ROS map needs {', '.join(_REQUIRED)}; missing here: {', '.join(missing)}")
    return described


def _check_unique_keys(node: Any, name: str) -> None:
    """Refuse duplicate keys: readers differ in which one counts."""
    if node is None or node.id != "mapping":
        return
    keys = [key.value for key, _ in node.value if key.id == "scalar"]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise MapError(f"{name} gives {shown(twice)} {keys.count(twice)} times; leave one of them")


def _number(name: str, value: Any) -> float:
    """Convert a number as yaml-cpp does: quoted or not, and 5e-2 without a decimal point too."""
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        return float(value)
    except (ValueError, OverflowError) as error:
        raise MapError(f"{name} is a number, not {shown(value)}") from error


def _flag(value: Any) -> bool:
    if isinstance(value, str) and value.strip().lstrip("+-").isdigit():
        value = int(value)
    if not isinstance(value, int):
        raise MapError(f"negate is 0 or 1, not {shown(value)}")
    return bool(value)


def _origin(value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise MapError(f"origin is a list of three numbers, x, y and yaw, not {shown(value)}")
    x, y, yaw = (_number("origin", part) for part in value)
    if not all(math.isfinite(part) for part in (x, y, yaw)):
        raise MapError(f"origin is finite x, y and yaw, not {shown(value)}")
    return x, y, yaw


def _image(path: str | os.PathLike[str], name: Any) -> Path:
    if not isinstance(name, str) or not name or not name.isprintable():
        raise MapError(f"image is the file name of an image, not {shown(name)}")
    return Path(path).parent / name
