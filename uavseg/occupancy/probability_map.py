"""Opening of maps of probabilities, of any format, for the phases of segmentation."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from affine import Affine

from uavseg.dataclass import dataclass
from uavseg.errors import MapError
from uavseg.occupancy.mapping.grid_io import LOG_ODDS
from uavseg.occupancy.ros.ros_map import UNKNOWN_GREY, is_ros_map, read_picture, read_ros_map
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import TilePass
from uavseg.raster.intensity.grey import Grey
from uavseg.raster.intensity.stretch import Stretch, fit_stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.spectral.bands import Valid, Values
from uavseg.units import FREE, OCCUPIED, STATES


@dataclass(frozen=True, slots=True)
class ProbabilityStretch(Stretch):
    """Stretch of floats that are probabilities already: v is the value; values outside 0..1 are refused."""

    @property
    def clips(self) -> bool:
        """Return False: no value lies outside of its ends."""
        return False

    def apply(self, values: Values, valid: Valid | None = None) -> Grey:
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


def open_map(path: str | os.PathLike[str], nodata: float | str | None = None) -> tuple[Dataset, Stretch]:
    """Open a map of probabilities: a raster, or the YAML file of a ROS map.

    It is never stretched by its content: integers are divided by the largest number of their type, floats are
    taken as they are. Unknown cells of a ROS map are exactly 0.5. Of a raster, `nodata` is a value without
    data, beside that of the file; "only:V" replaces that.

    Dataset and stretch together make the `GreySource` that the phases read by window. The stretch of floats
    raises `MapError` for a number that is not a probability.
    """
    if is_ros_map(path):
        ros_map = read_ros_map(path)
        dataset = Dataset.of_values(ros_map.probabilities, ros_map.geobox, Path(path).name, local_metres=True)
        dataset = replace(dataset, warnings=ros_map.warnings)
    else:
        dataset = Dataset.open(path, nodata=nodata)
    return dataset, stretch_of(dataset)


def open_white_picture(path: str | os.PathLike[str]) -> tuple[Dataset, Stretch]:
    """Open a picture of a map in which free is white, without its YAML file: p = (255 - x) / 255.

    205, which the map savers of ROS write for unknown, becomes exactly 0.5, and so do transparent pixels.
    Coordinates are pixels.
    """
    grey, alpha = read_picture(path)
    values = (np.float32(255) - grey.astype(np.float32)) / np.float32(255)
    unknown = grey == UNKNOWN_GREY
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
