"""Reading and writing of occupancy grids: GeoTIFFs of log-odds, and `nav_msgs/OccupancyGrid` messages.

A message has int8 cells in per cent, -1 unknown, row 0 at the bottom. It is any object with its fields: of
rclpy, rospy, rosbags or none of them.
"""

import math
import os
from array import array
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from uavseg.arrays import Float32s, Path_
from uavseg.errors import MapError, RasterError, SceneError, caused_errors, named_errors
from uavseg.inputs import as_number
from uavseg.occupancy.mapping.log_odds import MAX_LOG_ODDS, Fading
from uavseg.occupancy.mapping.sensor_messages import as_quaternion, heading_of, matrix_of_quaternion, tilt_deg
from uavseg.occupancy.ros.ros_map import RosMap, placement, transform_of
from uavseg.plain_text import shown
from uavseg.raster.formats.geotiff import check_geotiff_name, read_geotiff, write_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset

MAX_CELLS = 100_000_000  # of a grid in a file: 5 km x 5 km of cells of half a metre, about 1 GB in memory

LOG_ODDS = "log-odds of occupancy"  # description of the band

_TAG, _CONTENT, _FADING = "UAVSEG_OCCUPANCY_GRID", "log-odds", "UAVSEG_FADING"
_STAYING = Fading()
_LEVEL_DEG = 0.1  # an origin that is tilted by less lies in the plane


def check_cells(shape: tuple[int, int], what: str) -> None:
    """Refuse a grid, named `what` in the message, of more cells than are kept in a file or made from one."""
    rows, cols = shape
    if rows * cols > MAX_CELLS:
        raise MapError(f"{what} has {cols:,} x {rows:,} cells; at most {MAX_CELLS:,} are possible")


def write_grid_file(
    path: Path_, log_odds: Float32s, geobox: GeoBox, overwrite: bool = False, fading: Fading = _STAYING
) -> None:
    """Write the log-odds (rows, cols) of a grid to a .tif or .tiff."""
    check_geotiff_name(path, "a grid")
    check_cells(log_odds.shape, "this grid")
    tags = {_TAG: _CONTENT}
    if fading != _STAYING:
        tags[_FADING] = f"{fading.clamp!r} {fading.half_life!r} {fading.forget_after!r}"
    write_geotiff(path, [log_odds], geobox, [LOG_ODDS], tags, overwrite)


def read_grid_file(path: Path_) -> tuple[Float32s, GeoBox, Fading]:
    """Read the log-odds of a grid, the position of its cells, and how its evidence fades."""
    name = os.fspath(path)
    dataset = Dataset.open(name)
    other = f"{name} is not a grid that OccupancyGrid.save saved, but another raster"
    if dataset.dtype != np.float32:
        raise MapError(other)
    check_cells(dataset.geobox.shape, name)
    values, geobox, _, tags = read_geotiff(name, shape=dataset.geobox.shape)
    if tags.get(_TAG) != _CONTENT or len(values) != 1:
        raise MapError(other)
    log_odds: Float32s = values[0]
    if not (np.abs(log_odds) <= MAX_LOG_ODDS).all():
        raise MapError(f"{name} is damaged: log-odds of a grid lie in -{MAX_LOG_ODDS:g}..{MAX_LOG_ODDS:g}")
    unread = f"{name} is damaged: how its evidence fades cannot be read"
    with caused_errors(unread, MapError, ValueError, TypeError, form="{}"):
        words = tags.get(_FADING, f"{MAX_LOG_ODDS} None None").split()
        clamp, half_life, after = (None if word == "None" else float(word) for word in words)
        return log_odds, geobox, Fading(clamp or 0.0, half_life, after)


def read_grid_message(message: Any) -> tuple[Float32s, GeoBox]:
    """Read the probabilities of a message, and the position of its cells.

    They are (rows, cols) in 0..1, exactly 0.5 where unknown; the first row is the highest.
    """
    resolution = _number_of(message, "info.resolution")
    shape = (_count(message, "info.height"), _count(message, "info.width"))
    check_cells(shape, "this OccupancyGrid message")
    if not (math.isfinite(resolution) and resolution > 0):
        raise MapError(f"info.resolution is metres per cell, a number above 0, not {resolution:g}")
    value = _field(message, "data")
    try:
        cells = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise MapError(f"data of an OccupancyGrid message are whole numbers, not {shown(value)}") from error
    if cells.ndim != 1 or (cells.dtype.kind not in "iu" and cells.size):
        raise MapError(f"data of an OccupancyGrid message are one row of whole numbers, not {shown(value)}")
    if cells.size != shape[0] * shape[1]:
        raise MapError(
            f"an OccupancyGrid message of {shape[1]:,} x {shape[0]:,} cells holds as many values; this one "
            f"holds {cells.size:,}"
        )
    if cells.min() < -1 or cells.max() > 100:
        wrong = cells[(cells < -1) | (cells > 100)][0]
        raise MapError(f"cells of an OccupancyGrid message are -1 or 0 to 100, not {wrong}")
    cells = np.ascontiguousarray(cells.reshape(shape)[::-1].astype(np.int8))
    with named_errors("the place of this OccupancyGrid message", RasterError, MapError):
        geobox = GeoBox(shape, transform_of(_origin(message), resolution, shape[0]), None)
    return RosMap(cells, geobox).probabilities, geobox


def fill_grid_message(probabilities: Float32s, geobox: GeoBox, message: Any = None) -> Any:
    """Fill `info` and `data` of a message, or of a new plain object, and return it.

    Cells are square, in metres. Where `data` of the message is a numpy array, it becomes one, as rosbags has
    it; else an array.array.
    """
    resolution, (x, y, yaw), mirrored = placement(geobox)
    cells = np.floor(100 * probabilities.astype(np.float64) + 0.5).astype(np.int8)
    cells[probabilities == 0.5] = -1
    upwards = np.ascontiguousarray(cells if mirrored else cells[::-1])  # row 0 of a message is the lowest
    filled = _plain_message() if message is None else message
    _field(filled, "info.origin.orientation.w")
    info = filled.info
    info.resolution, info.height, info.width = resolution, *geobox.shape
    place, turn = info.origin.position, info.origin.orientation
    place.x, place.y, place.z = x, y, 0.0
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)
    is_numpy = isinstance(getattr(filled, "data", None), np.ndarray)
    filled.data = upwards.reshape(-1) if is_numpy else array("b", upwards.tobytes())
    return filled


def _plain_message() -> SimpleNamespace:
    new = SimpleNamespace
    origin = new(position=new(x=0.0, y=0.0, z=0.0), orientation=new(x=0.0, y=0.0, z=0.0, w=1.0))
    load_time = new(sec=0, nanosec=0)
    info = new(map_load_time=load_time, resolution=0.0, width=0, height=0, origin=origin)
    header = new(stamp=new(sec=0, nanosec=0), frame_id="map")
    return new(header=header, info=info, data=array("b"))


def _field(message: Any, path: str) -> Any:
    value = message
    for name in path.split("."):
        if not hasattr(value, name):
            held = shown(type(message).__name__)
            raise MapError(f"message is a nav_msgs/OccupancyGrid; this one, {held}, has no {path}")
        value = getattr(value, name)
    return value


def _number_of(message: Any, path: str, convert: Callable[[Any], Any] = float) -> Any:
    return as_number(_field(message, path), f"{path} of an OccupancyGrid message", MapError, convert)


def _count(message: Any, path: str) -> int:
    count: int = _number_of(message, path, int)
    if count < 1:
        raise MapError(f"{path} of an OccupancyGrid message is a number of cells above 0, not {count}")
    return count


def _origin(message: Any) -> tuple[float, float, float]:
    x, y = (_number_of(message, f"info.origin.position.{name}") for name in "xy")
    with named_errors("info.origin.orientation of an OccupancyGrid message", SceneError, MapError):
        matrix = matrix_of_quaternion(as_quaternion(_field(message, "info.origin.orientation")))
    if tilt_deg(matrix) > _LEVEL_DEG:
        raise MapError(
            f"info.origin.orientation tilts the map by {tilt_deg(matrix):.1f} degrees out of the plane; "
            "expected a rotation around z"
        )
    return x, y, heading_of(matrix)
