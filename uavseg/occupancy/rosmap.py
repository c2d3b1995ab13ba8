"""Maps of ROS: a YAML file and a picture, read and written by the rules of Nav2's map server.

The rules are those of ``nav2_map_server/src/map_io.cpp`` in ros-navigation/navigation2 as it is since 2025:
the picture becomes 8-bit grey x; occupancy is 1 - x/255, or x/255 where ``negate`` is set, in single
precision; both thresholds are inclusive, and where both hold, free wins.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.atomic import check_target, whole_file
from uavseg.errors import MapError, RasterReadError
from uavseg.occupancy.grid import check_metres
from uavseg.occupancy.pgm import is_pgm, pgm_bytes, read_pgm
from uavseg.raster.geobox import GeoBox
from uavseg.raster.pictures import read_grey, to_8_bits

Cells = NDArray[np.int8]

UNKNOWN = -1
MODES = ("trinary", "scale", "raw")
WRITTEN = {"occupied_thresh": 0.65, "free_thresh": 0.196}  # as Nav2 writes trinary maps
GREY_OF_STATE = np.array([205, 254, 205, 0], np.uint8)  # nothing, free, unknown, occupied

_WANTED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


@dataclass(frozen=True, slots=True)
class RosMap:
    """A map as a robot has it.

    Parameters
    ----------
    cells : (rows, cols) int8 array
        Occupancy in percent, 0 free to 100 occupied; -1 unknown. The first row is the top of the picture.
    geobox : GeoBox
        In the metres of the map's frame, turned where the origin has a yaw.
    """

    cells: Cells
    geobox: GeoBox

    @property
    def probabilities(self) -> NDArray[np.float32]:
        """Cells as 0..1, exactly 0.5 where unknown: (rows, cols) float32."""
        table = np.arange(-1, 101).astype(np.float32) / np.float32(100)
        table[0] = 0.5
        return table[self.cells.astype(np.int64) + 1]


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


def is_ros_map(path: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a ROS map's YAML file."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def read_ros_map(path: str | os.PathLike[str]) -> RosMap:
    """The map that a YAML file and the picture it names make.

    Raises
    ------
    MapError
        If the YAML file is not as ROS wants it.
    RasterReadError
        If a file is missing, or is not what it should be.
    """
    name = os.fspath(path)
    described = _read_yaml(path)
    try:
        reading = Reading(
            str(described.get("mode", "trinary")).lower(),
            _flag(described),
            _number("occupied_thresh", described["occupied_thresh"]),
            _number("free_thresh", described["free_thresh"]),
        )
        resolution, origin = _resolution(described), _origin(described)
        image = _image(path, described["image"])
    except MapError as error:
        raise MapError(f"{name}: {error}") from error
    grey, opaque = _read_image(image, name)
    transform = _turned(origin, resolution, grey.shape[0])
    return RosMap(reading.cells(grey, opaque), GeoBox(grey.shape, transform, None))


def write_ros_map(
    path: str | os.PathLike[str], states: NDArray[np.integer[Any]], geobox: GeoBox, overwrite: bool = False
) -> None:
    """Write states as a trinary map, NAME.yaml and NAME.pgm, which Nav2 reads back to the same states.

    Parameters
    ----------
    path : path
        Of the YAML file.
    states : (rows, cols) integer array
        1 free, 2 unknown, 3 occupied; 0, no data, becomes unknown.
    geobox : GeoBox
        Square cells in metres.

    Raises
    ------
    MapError
        If ROS has no way to say where the cells lie.
    OutputExistsError, OutputError
        If a file may not or cannot be written.
    """
    picture = Path(path).with_suffix(".pgm")
    check_target(picture, overwrite)
    resolution, origin, mirrored = _placed(geobox)
    grey = GREY_OF_STATE[np.asarray(states)[::-1] if mirrored else np.asarray(states)]
    place = {"resolution": resolution, "origin": origin}
    described = {"image": picture.name, "mode": "trinary", **place, "negate": 0, **WRITTEN}
    with whole_file(path, overwrite) as target:
        target.with_suffix(".pgm").write_bytes(pgm_bytes(grey))
        target.write_text(_yaml_text(described), encoding="utf-8")


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


def _yaml_text(described: Mapping[str, Any]) -> str:
    import yaml

    text: str = yaml.safe_dump(dict(described), sort_keys=False, default_flow_style=None)
    return text


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


def _read_image(image: Path, name: str) -> tuple[NDArray[np.uint8], NDArray[np.bool_] | None]:
    if not image.is_file():
        raise RasterReadError(f"{name} names the picture {image}, and there is no such file")
    if is_pgm(image):
        samples, maximum = read_pgm(image)
        return to_8_bits(samples, maximum), None
    return read_grey(image)


def _turned(origin: tuple[float, float, float], resolution: float, rows: int) -> Affine:
    """The transform of a map whose lower left corner lies at `origin`, turned around it by the yaw."""
    x, y, yaw = origin
    along, up = resolution * math.cos(yaw), resolution * math.sin(yaw)
    return Affine(along, up, x - rows * up, up, -along, y + rows * along)


def _placed(geobox: GeoBox) -> tuple[float, list[float], bool]:
    """Resolution, origin, and whether the rows run upwards: then they are written the other way round."""
    check_metres(geobox)
    a, b, c, d, e, f = tuple(geobox.transform)[:6]
    mirrored = a * e - b * d > 0
    side = math.hypot(a, d)
    turn = -1.0 if mirrored else 1.0
    if math.hypot(b - turn * d, e + turn * a) > 1e-6 * side:
        raise MapError("a ROS map has square cells and these are not; warp it first (gdalwarp -tr)")
    rows = 0 if mirrored else geobox.shape[0]
    x, y = b * rows + c, e * rows + f
    return side, [x, y, math.atan2(d, a)], mirrored
