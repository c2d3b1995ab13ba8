"""Masks of Nav2's costmap filters: regions of a map that a robot keeps out of, or in which it is slower."""

import os
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from uavseg.arrays import Path_
from uavseg.dataclass import dataclass
from uavseg.errors import MapError, ParameterError
from uavseg.jobs.source.open_source import map_of, open_probability_map
from uavseg.occupancy.mapping.grid_io import check_cells
from uavseg.occupancy.ros.ros_map import check_ros_map, image_path, is_ros_map, write_ros_percent
from uavseg.output.atomic import atomic_file, check_target
from uavseg.raster.grid.geobox import GeoBox, pixels_inside
from uavseg.raster.grid.tiling import Window
from uavseg.regions.sample.place import polygons_on


@dataclass(frozen=True, eq=False)
class FilterMask:
    """Mask of a costmap filter of Nav2."""

    values: NDArray[
        np.uint8
    ]  # (rows, cols): 0 outside of regions; inside 100, less the speed if there is one
    geobox: GeoBox
    speed: int | None  # per cent of the robot's largest speed; None: it keeps out
    regions: int
    warnings: tuple[str, ...]

    def write(self, path: Path_, overwrite: bool = False) -> None:
        """Write NAME.yaml and NAME.pgm for Nav2's map server, and NAME.params.yaml for its filter.

        An OutputExistsError says that a file is there and `overwrite` is false, an OutputError that one
        cannot be written, a MapError that the map has no square cells in metres.
        """
        check_mask_path(path, self.geobox, overwrite)
        kind, number, base, multiplier, plugin = "keepout", 0, 0.0, 1.0, "KeepoutFilter"
        if self.speed is not None:
            kind, number, base, multiplier, plugin = "speed", 1, 100.0, -1.0, "SpeedFilter"
        template = resources.files("uavseg.jobs.maps").joinpath("nav2_filter.yaml")
        text = template.read_text(encoding="utf-8").format(
            kind=kind, file=Path(path).name, number=number, base=base, multiplier=multiplier, plugin=plugin
        )
        write_ros_percent(path, self.values, self.geobox, overwrite)
        with atomic_file(_params_path(path), overwrite) as part:
            part.write_text(text, encoding="utf-8")


def check_mask_path(path: Path_, geobox: GeoBox, overwrite: bool) -> list[str]:
    """Check that a mask may be written, before the work; returns its files. Errors are those of `write`."""
    if not is_ros_map(path):
        raise ParameterError(f"{os.fspath(path)}: a mask is a ROS map; name a .yaml")
    check_ros_map(path, geobox, overwrite, "raw")
    check_target(_params_path(path), overwrite)
    return [os.fspath(one) for one in (path, image_path(path, "raw"), _params_path(path))]


def mask(regions: Any, map_: Any, speed: int | None = None, layer: str | None = None) -> FilterMask:
    """Return the mask of regions on the cells of a map: every cell that one touches is in it.

    `regions` is a file of polygons (a layer of it) or a GeoDataFrame, `map_` a source of
    `open_probability_map`, of which only the grid counts. A ParameterError says that `speed` is no per cent,
    a MapError that the regions do not touch the map; other errors are those of `polygons_on`.
    """
    if speed is not None and not (isinstance(speed, int) and 0 < speed < 100):
        raise ParameterError(f"speed is a whole number of per cent from 1 to 99, not {speed}")
    source = map_of(open_probability_map(map_), "name the map that it was made from")
    geobox, name = source.geobox, source.name
    check_cells(geobox.shape, name)
    polygons, notes = polygons_on(geobox, regions, layer)
    rows, cols = geobox.shape
    touching = shapely.intersects(polygons, shapely.box(0, 0, cols, rows))
    if not touching.any():
        raise MapError(f"no region touches {name}; give regions in the map's coordinates")
    beyond = np.count_nonzero(~shapely.contains(shapely.box(0, 0, cols, rows), polygons))
    if beyond:
        notes.append(f"{beyond:,} of {len(polygons):,} regions reach beyond {name}, where the mask ends")
    inside = pixels_inside(polygons[touching], Window(0, 0, rows, cols), touched=True)
    values = np.where(inside, 100 if speed is None else 100 - speed, 0).astype(np.uint8)
    return FilterMask(values, geobox, speed, len(polygons), tuple(notes))


def _params_path(path: Path_) -> Path:
    return Path(path).with_suffix(".params.yaml")
