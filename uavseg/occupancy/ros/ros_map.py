"""ROS maps (a YAML file and an image), read and written by the rules of Nav2's map server.

The rules are those of ``nav2_map_server/src/map_io.cpp`` in ros-navigation/navigation2: the image becomes
8-bit grey x; occupancy is 1 - x/255, or x/255 if ``negate`` is set, in single precision; both thresholds are
inclusive, and where both hold, free wins.
"""

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.access import current_policy
from uavseg.errors import MapError, RasterError
from uavseg.occupancy.ros.pgm import is_pgm, pgm_bytes, read_pgm
from uavseg.occupancy.ros.ros_yaml import (
    ROS_MODES,
    MapDescription,
    RosCells,
    read_ros_yaml,
    ros_yaml_text,
)
from uavseg.output.atomic import atomic_file, check_target
from uavseg.raster.formats.png import read_grey, to_8_bits, write_png
from uavseg.raster.grid.geobox import GeoBox, check_metres

_WRITTEN_THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}  # as Nav2 writes trinary maps
UNKNOWN_GREY = 205
GREY_OF_STATE = {  # no data, free, unknown, occupied: as Nav2's map saver writes them in each mode
    "trinary": np.array([205, 254, 205, 0], np.uint8),
    "scale": np.array([205, 255, 205, 0], np.uint8),  # unknown is also transparent
    "raw": np.array([255, 0, 255, 100], np.uint8),
}


@dataclass(frozen=True, slots=True)
class RosMap:
    """A map of the ROS navigation stack.

    Parameters
    ----------
    cells : (rows, cols) int8 array
        Occupancy in percent, 0 free to 100 occupied; -1 unknown. The first row is the top of the image.
    geobox : GeoBox
        In the metres of the map's frame, rotated if the origin has a yaw.
    warnings : tuple of str
        Where the map is probably not meant as it is read, or not read so by all of Nav2's releases.
    """

    cells: RosCells
    geobox: GeoBox
    warnings: tuple[str, ...] = ()

    @property
    def probabilities(self) -> NDArray[np.float32]:
        """Cells as 0..1, exactly 0.5 where unknown: (rows, cols) float32."""
        table = np.full(256, 0.5, np.float32)
        table[:101] = np.arange(101).astype(np.float32) / np.float32(100)
        return table[self.cells.view(np.uint8)]


def is_ros_map(path: str | os.PathLike[str]) -> bool:
    """Whether a path has the extension of a ROS map's YAML file: .yaml or .yml."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def read_ros_map(path: str | os.PathLike[str]) -> RosMap:
    """Read a map from its YAML file and the image that it names.

    Raises
    ------
    MapError
        If the YAML file does not describe a ROS map.
    RasterReadError
        If a file is missing or damaged.
    AccessError
        If the access policy does not allow to open the image.
    """
    described = read_ros_yaml(path)
    current_policy().check_file(path, described.image)
    grey, alpha = read_picture(described.image)
    transform = transform_of(described.origin, described.resolution, grey.shape[0])
    try:
        geobox = GeoBox(grey.shape, transform, None)
    except RasterError as error:
        raise MapError(f"{os.fspath(path)}: {error}") from error
    cells = described.rules.cells(grey, alpha)
    return RosMap(cells, geobox, tuple(_map_warnings(described, grey, alpha, cells)))


def _map_warnings(
    described: MapDescription, grey: NDArray[np.uint8], alpha: NDArray[np.uint8] | None, cells: RosCells
) -> Iterator[str]:
    rules, picture = described.rules, described.image.name
    scaled = rules.mode == "scale"
    is_free = rules.table()[UNKNOWN_GREY] == 0
    free = int(((grey == UNKNOWN_GREY) & (cells == 0)).sum()) if is_free else 0
    if free and (alpha is None or not scaled):
        kept = f"{_WRITTEN_THRESHOLDS['free_thresh']} keeps them unknown"
        yield (
            f"{_cells(free)} of grey {UNKNOWN_GREY}, which map savers write for unknown, count as free by "
            f"free_thresh: {rules.free:g}; {'in this mode unknown is transparent' if scaled else kept}"
        )
    if alpha is not None and rules.mode == "trinary":
        other = int((rules.cells_before_2025(grey, alpha) != cells).sum())
        if other:
            yield (
                f"{picture} has an alpha channel, which Nav2 up to Jazzy averages into the grey: it reads "
                f"{_cells(other)} otherwise; save the picture without alpha"
            )


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count:,} cells"


def check_ros_map(
    path: str | os.PathLike[str], geobox: GeoBox, overwrite: bool = False, mode: str = "trinary"
) -> None:
    """Check that a map may be written to a path; call it before the work.

    Raises
    ------
    MapError, OutputExistsError, OutputError
        As for `write_ros_map`.
    """
    for target in (Path(path), image_path(path, mode)):
        check_target(target, overwrite)
    placement(geobox)


def write_ros_map(
    path: str | os.PathLike[str],
    states: NDArray[np.integer[Any]],
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str = "trinary",
) -> None:
    """Write states as a map, NAME.yaml and its image, which Nav2 reads back as the same states.

    Parameters
    ----------
    path : path
        Of the YAML file.
    states : (rows, cols) integer array
        1 free, 2 unknown, 3 occupied; 0, no data, becomes unknown.
    geobox : GeoBox
        Square cells in metres.
    overwrite : bool
        Whether existing files may be replaced.
    mode : {"trinary", "scale", "raw"}
        Mode in which Nav2 reads the image. It is NAME.pgm, and for "scale" NAME.png, where unknown cells are
        transparent.

    Raises
    ------
    MapError
        If ROS cannot express the position of the cells.
    OutputExistsError, OutputError
        If a file may not or cannot be written.
    """
    check_target(image_path(path, mode), overwrite)
    grey = GREY_OF_STATE[mode][np.asarray(states)]
    opaque = np.asarray(states) % 2 == 1 if mode == "scale" else None
    _write(path, grey, opaque, geobox, overwrite, mode, _WRITTEN_THRESHOLDS)


def write_ros_probabilities(
    path: str | os.PathLike[str],
    probabilities: NDArray[np.float32],
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str = "scale",
) -> None:
    """Write probabilities as a map that Nav2 reads back to the per cent.

    Parameters
    ----------
    path : path
        Of the YAML file.
    probabilities : (rows, cols) float32 array
        Unknown where exactly 0.5.
    geobox : GeoBox
        Square cells in metres.
    overwrite : bool
        Whether existing files may be replaced.
    mode : {"scale", "raw"}
        "scale": a PNG of 256 greys, between thresholds of 0 and 1; "raw": a PGM of per cent.

    Raises
    ------
    UavsegError
        As of `write_ros_map`.
    """
    check_target(image_path(path, mode), overwrite)
    unknown = probabilities == 0.5
    if mode == "raw":
        grey = np.where(unknown, 255, np.floor(100 * probabilities.astype(np.float64) + 0.5)).astype(np.uint8)
        _write(path, grey, None, geobox, overwrite, mode, _WRITTEN_THRESHOLDS)
        return
    grey = (255 - np.floor(255 * probabilities.astype(np.float64) + 0.5)).astype(np.uint8)
    _write(path, grey, ~unknown, geobox, overwrite, mode, {"occupied_thresh": 1.0, "free_thresh": 0.0})


def _write(
    path: str | os.PathLike[str],
    grey: NDArray[np.uint8],
    opaque: NDArray[np.bool_] | None,
    geobox: GeoBox,
    overwrite: bool,
    mode: str,
    thresholds: Mapping[str, float],
) -> None:
    image = image_path(path, mode)
    resolution, origin, mirrored = placement(geobox)
    down = slice(None, None, -1 if mirrored else 1)
    position = {"resolution": resolution, "origin": origin}
    described = {"image": image.name, "mode": mode, **position, "negate": 0, **thresholds}
    with atomic_file(path, overwrite) as target:
        picture = target.with_name(image.name)
        if mode == "scale":
            write_png(picture, grey[down], opaque=None if opaque is None else opaque[down])
        else:
            picture.write_bytes(pgm_bytes(grey[down]))
        target.write_text(ros_yaml_text(described), encoding="utf-8")


def image_path(path: str | os.PathLike[str], mode: str) -> Path:
    """Path of the image that is written beside a YAML file.

    Raises
    ------
    MapError
        If the mode is unknown.
    """
    if mode not in ROS_MODES:
        raise MapError(f"mode is trinary, scale or raw, not {mode!r}")
    return Path(path).with_suffix(".png" if mode == "scale" else ".pgm")


def read_picture(
    image: str | os.PathLike[str],
) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    """8-bit grey of the picture of a map, and its alpha; None where it has none.

    Raises
    ------
    RasterReadError
        If it cannot be read.
    """
    if is_pgm(image):
        samples, maximum = read_pgm(image)
        return to_8_bits(samples, maximum), None
    return read_grey(image)


def transform_of(origin: tuple[float, float, float], resolution: float, rows: int) -> Affine:
    """The transform of a map whose lower left corner lies at `origin` (x, y, yaw), rotated around it."""
    x, y, yaw = origin
    along, up = resolution * math.cos(yaw), resolution * math.sin(yaw)
    return Affine(along, up, x - rows * up, up, -along, y + rows * along)


def placement(geobox: GeoBox) -> tuple[float, list[float], bool]:
    """Resolution, origin (x, y, yaw), and whether the rows run upwards, so that they are written in reverse.

    Raises
    ------
    MapError
        If cells are not square, or not in metres.
    """
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
