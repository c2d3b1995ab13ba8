"""States of a map as a file: a uint8 GeoTIFF, or a ROS map."""

import os

import numpy as np

from uavseg.occupancy.ros.ros_map import is_ros_map, write_ros_map
from uavseg.raster.formats.creation import DEFAULT, CreationOptions
from uavseg.raster.formats.geotiff import LabelBand, write_label_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.segmentation.states.state_image import StateImage
from uavseg.units import STATES


def write_states(
    path: str | os.PathLike[str],
    image: StateImage,
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str = "trinary",
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write the states of a map: a uint8 GeoTIFF with nodata 0, or for a .yaml a ROS map.

    A ROS map has no nodata, so such cells become unknown. It is held whole while it is written, a byte a
    cell; a GeoTIFF is written row by row.

    Parameters
    ----------
    path : path
        .tif, or .yaml.
    image : StateImage
    geobox : GeoBox
    overwrite : bool
        Whether files that are there may be replaced.
    mode : {"trinary", "scale", "raw"}
        Of the ROS map.
    creation : CreationOptions
        Of the GeoTIFF.

    Raises
    ------
    MapError
        If a ROS map cannot say where the cells lie.
    OutputExistsError, OutputError
        If a file may not or cannot be written.
    """
    if is_ros_map(path):
        write_ros_map(path, image.read(), geobox, overwrite, mode)
    else:
        band = LabelBand(np.uint8, STATES)
        write_label_geotiff(path, image.strips(), geobox, overwrite, band=band, creation=creation)
