"""Files of a map of probabilities: a ROS map, or a GeoTIFF of probabilities."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import OutputError, ParameterError
from uavseg.occupancy.ros.ros_map import (
    check_ros_map,
    image_path,
    is_ros_map,
    write_ros_map,
    write_ros_probabilities,
)
from uavseg.output.atomic import check_target
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import write_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, UNKNOWN

FREE_UP_TO, OCCUPIED_FROM = 0.25, 0.65  # probabilities, by default those of Nav2's map_saver


def check_map_path(
    path: str | os.PathLike[str], overwrite: bool = False, mode: str | None = None
) -> list[str]:
    """Check that a map may be written to a path, before the work; returns the files that it will have.

    Raises
    ------
    OutputExistsError, OutputError
        If one exists, or the extension is none of a map.
    ParameterError
        If a mode is given, which a GeoTIFF has not.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{os.fspath(path)}: a map is written to .yaml for a ROS map, or to .tif")
    if mode is not None and not is_ros_map(path):
        raise ParameterError("mode is of a ROS map (.yaml); a .tif holds all levels, so leave mode out")
    images = [os.fspath(image_path(path, mode or "trinary"))] if is_ros_map(path) else []
    files = [os.fspath(path), *images]
    for file in files:
        check_target(file, overwrite)
    return files


def write_map(
    path: str | os.PathLike[str],
    probabilities: NDArray[np.float32],
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str | None = None,
    tags: Mapping[str, str] | None = None,
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write a ROS map (.yaml and its image), or a GeoTIFF of probabilities (.tif).

    In a trinary ROS map, cells are free up to a probability of 0.25 and occupied from 0.65 on, as Nav2's
    map_saver writes them.

    Parameters
    ----------
    path : path
    probabilities : (rows, cols) float32 array
        Unknown where exactly 0.5.
    geobox : GeoBox
    overwrite : bool
        Whether to replace existing files.
    mode : {"trinary", "scale", "raw"}, optional
        Of a ROS map, by default "trinary"; the others keep all levels.
    tags : mapping of str to str, optional
        Metadata items of a GeoTIFF.
    creation : CreationOptions
        Of a GeoTIFF.

    Raises
    ------
    OutputExistsError, OutputError
        If a file exists, or cannot be written.
    MapError
        If a ROS map cannot say where the cells lie.
    ParameterError
        If a mode is given for a GeoTIFF.
    """
    check_map_path(path, overwrite, mode)
    if not is_ros_map(path):
        write_geotiff(path, [probabilities], geobox, ["occupancy"], tags, overwrite, creation)
        return
    mode = mode or "trinary"
    check_ros_map(path, geobox, overwrite, mode)
    if mode == "trinary":
        write_ros_map(path, trinary_states(probabilities), geobox, overwrite)
    else:
        write_ros_probabilities(path, probabilities, geobox, overwrite, mode)


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


def shares_of(probabilities: NDArray[np.float32]) -> str:
    """How much of a map is free, unknown and occupied, for people."""
    states = trinary_states(probabilities)
    names = {FREE: "free", UNKNOWN: "unknown", OCCUPIED: "occupied"}
    return ", ".join(f"{name} {100 * (states == state).mean():.1f} %" for state, name in names.items())
