"""Files of an occupancy grid as a map: a ROS map, or a GeoTIFF of probabilities."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.atomic import check_target
from uavseg.errors import OutputError
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.ros.ros_map import check_ros_map, image_path, is_ros_map, write_ros_map
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.units import FREE, OCCUPIED, UNKNOWN

FREE_UP_TO, OCCUPIED_FROM = 0.25, 0.65  # probabilities, by default those of Nav2's map_saver


def check_map_path(path: str | os.PathLike[str], overwrite: bool = False) -> list[str]:
    """Check that a map may be written to a path, before the work; returns the files that it will have.

    Raises
    ------
    OutputExistsError, OutputError
        If one exists, or the extension is none of a map.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{os.fspath(path)}: a map is written to .yaml for a ROS map, or to .tif")
    files = [os.fspath(path), *([os.fspath(image_path(path, "trinary"))] if is_ros_map(path) else [])]
    for file in files:
        check_target(file, overwrite)
    return files


def write_map(
    path: str | os.PathLike[str],
    grid: OccupancyGrid,
    overwrite: bool = False,
    tags: Mapping[str, str] | None = None,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write a grid as a ROS map (.yaml and its .pgm, trinary), or as a GeoTIFF of probabilities (.tif).

    In a ROS map, cells are free up to a probability of 0.25 and occupied from 0.65 on, as Nav2's map_saver
    writes them.

    Parameters
    ----------
    path : path
    grid : OccupancyGrid
    overwrite : bool
        Whether to replace existing files.
    tags : mapping of str to str, optional
        Metadata items of a GeoTIFF.
    creation : CreationOptions
        Of a GeoTIFF.

    Raises
    ------
    OutputExistsError, OutputError
        If a file exists, or cannot be written.
    """
    check_map_path(path, overwrite)
    if not is_ros_map(path):
        write_geotiff(path, [grid.probabilities], grid.geobox, ["occupancy"], tags, overwrite, creation)
        return
    check_ros_map(path, grid.geobox, overwrite)
    write_ros_map(path, trinary_states(grid.probabilities), grid.geobox, overwrite)


def trinary_states(probabilities: NDArray[np.float32]) -> NDArray[np.uint8]:
    """States of cells by their own probability: 1 free, 2 unknown, 3 occupied.

    Examples
    --------
    >>> trinary_states(np.array([[0.1, 0.5, 0.9]], np.float32)).tolist()
    [[1, 2, 3]]
    """
    states = np.full(probabilities.shape, UNKNOWN, np.uint8)
    states[probabilities <= FREE_UP_TO] = FREE
    states[probabilities >= OCCUPIED_FROM] = OCCUPIED
    return states
