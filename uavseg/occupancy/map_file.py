"""Files of maps: probabilities or states of cells, as a ROS map or a GeoTIFF."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

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
from uavseg.raster.formats.creation import DEFAULT, CreationOptions, creation_for
from uavseg.raster.formats.geotiff import LabelBand, write_geotiff, write_label_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.units import FREE, OCCUPIED, STATES, UNKNOWN

if TYPE_CHECKING:
    from uavseg.segmentation.states.state_image import StateImage

FREE_UP_TO, OCCUPIED_FROM = 0.25, 0.65  # probabilities: the defaults of Nav2's map_saver


class _HasProbabilities(Protocol):
    @property
    def probabilities(self) -> NDArray[np.float32]: ...

    @property
    def geobox(self) -> GeoBox: ...


class WritableMap:
    """Base of results that hold the probabilities of a map."""

    __slots__ = ()

    def write(
        self: _HasProbabilities,
        path: str | os.PathLike[str],
        overwrite: bool = False,
        creation_options: Mapping[str, Any] | Sequence[str] | None = None,
        mode: str | None = None,
    ) -> None:
        """Write the map: .yaml with its image, as Nav2's map server reads them, or .tif of probabilities.

        Parameters
        ----------
        overwrite : bool
            Whether to replace existing files.
        creation_options : mapping or sequence of str, optional
            Of a .tif, such as {"COMPRESS": "ZSTD", "PREDICTOR": 3}; see `CreationOptions`.
        mode : {"trinary", "scale", "raw"}, optional
            Of a .yaml, by default "trinary"; the others keep all levels.

        Raises
        ------
        OutputExistsError, OutputError
            If a file exists, or cannot be written.
        ParameterError
            If a creation option is not allowed, or given for a .yaml; if a mode is given for a .tif.
        """
        creation = creation_for(creation_options, {os.fspath(path): "float32"})
        write_map(path, self.probabilities, self.geobox, overwrite, mode, creation=creation)


def check_map_path(
    path: str | os.PathLike[str], overwrite: bool = False, mode: str | None = None
) -> list[str]:
    """Check that a map may be written to a path, before the work; returns the files that it will have.

    `mode` is "trinary", "scale" or "raw", of a ROS map only.
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

    `probabilities` (rows, cols) are unknown where exactly 0.5. In a trinary ROS map, the default, cells are
    free up to a probability of 0.25 and occupied from 0.65 on; the modes "scale" and "raw" keep all levels.
    `tags` (metadata items) and `creation` are for a GeoTIFF.
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
    """Threshold probabilities to states: 1 free, 2 unknown, 3 occupied.

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
    """Describe the shares of a map that are free, unknown and occupied."""
    states = trinary_states(probabilities)
    names = {FREE: "free", UNKNOWN: "unknown", OCCUPIED: "occupied"}
    return ", ".join(f"{name} {100 * (states == state).mean():.1f} %" for state, name in names.items())


def write_states(
    path: str | os.PathLike[str],
    image: "StateImage",
    geobox: GeoBox,
    overwrite: bool = False,
    mode: str = "trinary",
    creation: CreationOptions = DEFAULT,
) -> None:
    """Write the states of a map: a uint8 GeoTIFF with nodata 0, or for a .yaml a ROS map.

    A ROS map has no nodata, so such cells become unknown. It is held whole while it is written, a byte a
    cell; a GeoTIFF is written row by row. `mode` ("trinary", "scale" or "raw") is for the ROS map, `creation`
    for the GeoTIFF.
    """
    if is_ros_map(path):
        write_ros_map(path, image.read(), geobox, overwrite, mode)
    else:
        band = LabelBand(np.uint8, STATES)
        write_label_geotiff(path, image.strips(), geobox, overwrite, band=band, creation=creation)
