"""Files of maps: probabilities or states of cells, as a ROS map or a GeoTIFF; opened for segmentation."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from affine import Affine

from uavseg.arrays import Float32s, Path_, Uint8s, Uint16s
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, OutputError, ParameterError
from uavseg.occupancy.mapping.grid_io import LOG_ODDS
from uavseg.occupancy.ros import ros_map
from uavseg.output.atomic import check_target
from uavseg.raster.formats.creation import DEFAULT, CreationOptions, creation_for
from uavseg.raster.formats.geotiff import LabelBand, write_geotiff, write_label_geotiff
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.stretch import Stretch, fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import Valid, Values
from uavseg.units import FREE, OCCUPIED, STATES, UNKNOWN

if TYPE_CHECKING:
    from uavseg.segmentation.states.state_image import StateImage

FREE_UP_TO, OCCUPIED_FROM = 0.25, 0.65  # probabilities: the defaults of Nav2's map_saver


class _HasProbabilities(Protocol):
    @property
    def probabilities(self) -> Float32s: ...

    @property
    def geobox(self) -> GeoBox: ...


class WritableMap:
    """Base of results that hold the probabilities of a map."""

    __slots__ = ()

    def write(
        self: _HasProbabilities,
        path: Path_,
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


def check_map_path(path: Path_, overwrite: bool = False, mode: str | None = None) -> list[str]:
    """Check that a map may be written to a path, before the work; returns the files that it will have.

    `mode` is "trinary", "scale" or "raw", of a ROS map only.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".tif", ".tiff", ".yaml", ".yml"):
        raise OutputError(f"{os.fspath(path)}: a map is written to .yaml for a ROS map, or to .tif")
    if mode is not None and not ros_map.is_ros_map(path):
        raise ParameterError("mode is of a ROS map (.yaml); a .tif holds all levels, so leave mode out")
    images = [os.fspath(ros_map.image_path(path, mode or "trinary"))] if ros_map.is_ros_map(path) else []
    files = [os.fspath(path), *images]
    for file in files:
        check_target(file, overwrite)
    return files


def write_map(
    path: Path_,
    probabilities: Float32s,
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
    if not ros_map.is_ros_map(path):
        write_geotiff(path, [probabilities], geobox, ["occupancy"], tags, overwrite, creation)
        return
    if mode in (None, "trinary"):
        ros_map.write_ros_map(path, trinary_states(probabilities), geobox, overwrite)
    else:
        ros_map.write_ros_probabilities(path, probabilities, geobox, overwrite, mode)


def trinary_states(probabilities: Float32s) -> Uint8s:
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


def shares_of(probabilities: Float32s) -> str:
    """Describe the shares of a map that are free, unknown and occupied."""
    states = trinary_states(probabilities)
    names = {FREE: "free", UNKNOWN: "unknown", OCCUPIED: "occupied"}
    return ", ".join(f"{name} {100 * (states == state).mean():.1f} %" for state, name in names.items())


def write_states(
    path: Path_,
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
    if ros_map.is_ros_map(path):
        ros_map.write_ros_map(path, image.read(), geobox, overwrite, mode)
    else:
        band = LabelBand(np.uint8, STATES)
        write_label_geotiff(path, image.strips(), geobox, overwrite, band=band, creation=creation)


@dataclass(frozen=True, slots=True)
class ProbabilityStretch(Stretch):
    """Stretch of floats that are probabilities already: v is the value; values outside 0..1 are refused."""

    @property
    def clips(self) -> bool:
        """Return False: no value lies outside of its ends."""
        return False

    def apply(self, values: Values, valid: Valid | None = None) -> Uint16s:
        """Convert values to grey, 0 where invalid, as `Stretch.apply`; refuse a valid value outside 0..1."""
        outside = (values < 0) | (values > 1)
        if valid is not None:
            outside &= valid
        if outside.any():
            raise MapError(
                f"a map of probabilities lies in 0..1 and this one holds {values[outside][0]:g}; "
                "name a stretch (--stretch LOW,HIGH) or declare nodata (--nodata)"
            )
        return Stretch.apply(self, values, valid)


def open_map(path: Path_, nodata: float | str | None = None) -> tuple[Dataset, Stretch]:
    """Open a map of probabilities: a raster, or the YAML file of a ROS map.

    It is never stretched by its content: integers are divided by the largest number of their type, floats are
    taken as they are. Unknown cells of a ROS map are exactly 0.5. Of a raster, `nodata` is a value without
    data, beside that of the file; "only:V" replaces that.

    Dataset and stretch together make the `GreySource` that the phases read by window. The stretch of floats
    raises `MapError` for a number that is not a probability.
    """
    if ros_map.is_ros_map(path):
        found = ros_map.read_ros_map(path)
        dataset = Dataset.of_values(found.probabilities, found.geobox, Path(path).name, local_metres=True)
        dataset = replace(dataset, warnings=found.warnings)
    else:
        dataset = Dataset.open(path, nodata=nodata)
    return dataset, stretch_of(dataset)


def open_white_picture(path: Path_) -> tuple[Dataset, Stretch]:
    """Open a picture of a map in which free is white, without its YAML file: p = (255 - x) / 255.

    205, which the map savers of ROS write for unknown, becomes exactly 0.5, and so do transparent pixels.
    Coordinates are pixels.
    """
    grey, alpha = ros_map.read_picture(path)
    values = (np.float32(255) - grey.astype(np.float32)) / np.float32(255)
    unknown = grey == ros_map.UNKNOWN_GREY
    values[unknown if alpha is None else unknown | (alpha < 255)] = 0.5
    place = GeoBox(grey.shape, Affine.identity(), None)
    dataset = Dataset.of_values(values, place, Path(path).name)
    return dataset, stretch_of(dataset)


def stretch_of(dataset: Dataset) -> Stretch:
    """Choose the stretch of a map by its type, or by states where `classify` wrote it; refuse log-odds."""
    descriptions = dataset.mosaic.files[0].layout.descriptions
    if descriptions == (LOG_ODDS,):
        raise MapError(f"{dataset.source} holds log-odds, of which OccupancyGrid.load makes a map")
    if descriptions == (STATES,):
        return Stretch(float(FREE), float(OCCUPIED), "states -> 0..1")
    if np.dtype(dataset.dtype).kind == "f":
        return ProbabilityStretch(0.0, 1.0, "none -> 0..1")
    return fit_stretch(dataset, "dtype", TilePass([]))
