"""Maps of ROS: a YAML file and a picture, read and written by the rules of Nav2's map server.

The rules are those of ``nav2_map_server/src/map_io.cpp`` in ros-navigation/navigation2, in its present form:
the picture becomes 8-bit grey x; occupancy is 1 - x/255, or x/255 where ``negate`` is set, in single
precision; both thresholds are inclusive, and where both hold, free wins.
"""

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.atomic import atomic_file, check_target
from uavseg.errors import MapError, RasterReadError
from uavseg.occupancy.ros.pgm import is_pgm, pgm_bytes, read_pgm
from uavseg.occupancy.ros.ros_yaml import MODES, description_text, read_description
from uavseg.raster.formats.png import read_grey, to_8_bits, write_png
from uavseg.raster.geobox import GeoBox, check_metres

Cells = NDArray[np.int8]

WRITTEN = {"occupied_thresh": 0.65, "free_thresh": 0.196}  # as Nav2 writes trinary maps
GREY_OF_STATE = {  # nothing, free, unknown, occupied: as Nav2's map saver writes them in each mode
    "trinary": np.array([205, 254, 205, 0], np.uint8),
    "scale": np.array([205, 255, 205, 0], np.uint8),  # what is unknown is transparent as well
    "raw": np.array([255, 0, 255, 100], np.uint8),
}


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
    described = read_description(path)
    grey, opaque = _read_image(described.image, os.fspath(path))
    transform = _turned(described.origin, described.resolution, grey.shape[0])
    return RosMap(described.reading.cells(grey, opaque), GeoBox(grey.shape, transform, None))


def check_ros_map(
    path: str | os.PathLike[str], geobox: GeoBox, overwrite: bool = False, mode: str = "trinary"
) -> None:
    """See that a map may be written there; call it before the work.

    Raises
    ------
    MapError, OutputExistsError, OutputError
        As `write_ros_map`.
    """
    for target in (Path(path), _picture(path, mode)):
        check_target(target, overwrite)
    _placed(geobox)


def write_ros_map(
    path: str | os.PathLike[str],
    states: NDArray[np.integer[Any]],
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str = "trinary",
) -> None:
    """Write states as a map, NAME.yaml and its picture, which Nav2 reads back to the same states.

    Parameters
    ----------
    path : path
        Of the YAML file.
    states : (rows, cols) integer array
        1 free, 2 unknown, 3 occupied; 0, no data, becomes unknown.
    geobox : GeoBox
        Square cells in metres.
    overwrite : bool
        Whether files that are there may be replaced.
    mode : {"trinary", "scale", "raw"}
        How the picture is to be read. It is NAME.pgm, and for "scale" NAME.png, where what is unknown is
        transparent.

    Raises
    ------
    MapError
        If ROS has no way to say where the cells lie.
    OutputExistsError, OutputError
        If a file may not or cannot be written.
    """
    picture = _picture(path, mode)
    check_target(picture, overwrite)
    resolution, origin, mirrored = _placed(geobox)
    shown = np.asarray(states)[::-1] if mirrored else np.asarray(states)
    grey = GREY_OF_STATE[mode][shown]
    place = {"resolution": resolution, "origin": origin}
    described = {"image": picture.name, "mode": mode, **place, "negate": 0, **WRITTEN}
    with atomic_file(path, overwrite) as target:
        if mode == "scale":
            write_png(target.with_name(picture.name), grey, opaque=shown % 2 == 1)
        else:
            target.with_name(picture.name).write_bytes(pgm_bytes(grey))
        target.write_text(description_text(described), encoding="utf-8")


def _picture(path: str | os.PathLike[str], mode: str) -> Path:
    if mode not in MODES:
        raise MapError(f"mode is trinary, scale or raw, not {mode!r}")
    return Path(path).with_suffix(".png" if mode == "scale" else ".pgm")


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
