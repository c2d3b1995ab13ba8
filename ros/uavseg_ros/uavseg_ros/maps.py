"""Occupancy maps as messages: updates, states of cells, free space and objects.

Messages are objects with the fields of their type, of rclpy or rosbags; new ones are made by the classes that
a function is given. Row 0 of a message is the lowest, of an array of uavseg the highest.
"""

import warnings
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

import uavseg
from uavseg.errors import MapError
from uavseg.jobs.maps.classify import Classification
from uavseg.occupancy.mapping.grid_io import read_grid_message
from uavseg.units import FREE
from uavseg_ros.parameters import NodeParams

New = Callable[[], Any]  # a class of messages

FREE_CELL, UNKNOWN_CELL, OCCUPIED_CELL = 0, -1, 100  # of nav_msgs/OccupancyGrid
_CELL_OF_STATE = np.array([UNKNOWN_CELL, FREE_CELL, UNKNOWN_CELL, OCCUPIED_CELL], np.int8)
_RED = (0.8, 0.1, 0.1, 1.0)


def read_map(message: Any) -> uavseg.Dataset:
    """Read a nav_msgs/OccupancyGrid as probabilities, in the metres of its frame; the origin may have a yaw.

    Raises
    ------
    MapError
        If a field is missing, cells are not -1 or 0..100 or not as many as said, or the origin is tilted.
    """
    probabilities, geobox = read_grid_message(message)
    name = f"map in the frame {message.header.frame_id}"
    return uavseg.Dataset.of_values(probabilities, geobox, name)


def apply_update(message: Any, update: Any) -> None:
    """Write the cells of a map_msgs/OccupancyGridUpdate into a map, whose stamp becomes that of the update.

    Raises
    ------
    MapError
        If the update reaches outside of the map, is in another frame, holds another number of cells than it
        says, or cells that are not -1 or 0..100. The map does not change.
    """
    frame, own = update.header.frame_id, message.header.frame_id
    if frame not in ("", own):
        raise MapError(f"an update in the frame {frame} is not one of this map, which is in {own}")
    row, col, rows, cols = (int(getattr(update, name)) for name in ("y", "x", "height", "width"))
    height, width = int(message.info.height), int(message.info.width)
    if min(row, col) < 0 or min(rows, cols) < 1 or row + rows > height or col + cols > width:
        raise MapError(
            f"an update of {cols:,} x {rows:,} cells from column {col:,} and row {row:,} on does not lie in "
            f"the map, which has {width:,} x {height:,} cells"
        )
    changed = np.asarray(update.data)
    if changed.size != rows * cols:
        raise MapError(f"an update of {cols:,} x {rows:,} cells holds {changed.size:,} values")
    wrong = changed[(changed < -1) | (changed > 100)]
    if wrong.size:
        raise MapError(f"cells of an update are -1 or 0 to 100, not {wrong[0]}")
    cells = np.array(message.data, np.int8).reshape(height, width)
    cells[row : row + rows, col : col + cols] = changed.reshape(rows, cols)
    message.data = _data_like(message.data, cells)
    message.header.stamp = update.header.stamp


def classify_map(source: uavseg.Dataset, params: NodeParams) -> Classification:
    """Classify the cells of a map, with objects, as the command `classify` does.

    Warnings are those of the result. Raises UavsegError where the command ends with an error.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # they are in the result
        return uavseg.classify(
            source,
            free_below=params.free_below,
            occupied_above=params.occupied_above,
            min_area=f"{params.min_object_cells}px" if params.min_object_cells else None,
        )


def states_message(found: Classification, message: Any, new: New) -> Any:
    """Return the states as a nav_msgs/OccupancyGrid like a map: 0 free, -1 unknown, 100 occupied."""
    return _grid_like(message, _CELL_OF_STATE[found.states], new)


def free_space_message(found: Classification, params: NodeParams, message: Any, new: New) -> Any:
    """Return the free space as a nav_msgs/OccupancyGrid like a map: 0 free, 100 everything else.

    A cell is free if its state is and its own value too: the classification calls some cells free that are
    not by their value (`occupied_in_free` and `unknown_in_free`).
    """
    cells = np.array(message.data, np.int8).reshape(found.states.shape)[::-1]
    own = params.limits.of(np.where(cells < 0, 0.5, cells / 100))
    free = (found.states == FREE) & (own == FREE)
    return _grid_like(message, np.where(free, FREE_CELL, OCCUPIED_CELL).astype(np.int8), new)


def objects_message(found: Classification, message: Any, new: New, new_marker: New, new_point: New) -> Any:
    """Return outlines of the objects as a visualization_msgs/MarkerArray, of which the first deletes all.

    Each is a LINE_LIST in the map's frame, exterior and holes; `id` is that of the object (1 is the largest),
    `text` its area in m2.
    """
    clear = _marker(message, new_marker)
    clear.action = clear.DELETEALL
    markers = [clear]
    for row in found.frame().itertuples():
        marker = _marker(message, new_marker)
        marker.type, marker.action, marker.id = marker.LINE_LIST, marker.ADD, int(row.id)
        marker.text = f"{row.pixels * message.info.resolution**2:.4g}"
        marker.scale.x = float(message.info.resolution)
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = _RED
        marker.points = [_point(xy, new_point) for xy in _edges(row.geometry)]
        markers.append(marker)
    several = new()
    several.markers = markers
    return several


def _marker(message: Any, new_marker: New) -> Any:
    marker = new_marker()
    marker.header, marker.ns = message.header, "objects"
    marker.pose.orientation.w = 1.0
    return marker


def _edges(polygon: shapely.Geometry) -> NDArray[np.float64]:
    """Return the ends (2 n, 2) of the n edges of all rings of a polygon."""
    rings = shapely.get_rings(shapely.get_parts(polygon))
    corners = [shapely.get_coordinates(ring) for ring in rings]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1).reshape(-1, 2) for ring in corners])


def _point(xy: NDArray[np.float64], new_point: New) -> Any:
    point = new_point()
    point.x, point.y = map(float, xy)
    return point


def _grid_like(message: Any, cells: NDArray[np.int8], new: New) -> Any:
    """Return a grid of the frame, stamp and place of a map; the first row of the cells is the highest."""
    grid = new()
    grid.header, grid.info = message.header, message.info
    grid.data = _data_like(message.data, cells[::-1])
    return grid


def _data_like(data: Any, cells: NDArray[np.int8]) -> Any:
    """Return cells as other data are: a numpy array, as of rosbags, or an array.array, as of rclpy."""
    return np.ravel(cells).copy() if isinstance(data, np.ndarray) else array("b", cells.tobytes())
