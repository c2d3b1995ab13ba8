"""The main job on a map: free, unknown and occupied cells, and what is occupied as separate objects."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uavseg._memory import give_back
from uavseg.errors import MapError, ParameterError
from uavseg.execution.executors import Map, Progress, serial
from uavseg.jobs.extract import ExtractParams
from uavseg.jobs.result import About, Extraction, measured
from uavseg.occupancy.ros.ros_map import is_ros_map, write_ros_map
from uavseg.raster.formats.geotiff import write_labels
from uavseg.raster.geobox import GeoBox
from uavseg.raster.tile_pass import TilePass
from uavseg.regions.edit.small import drop_small_regions
from uavseg.regions.outline.rings import Rings
from uavseg.regions.tiles.kind_tiles import outline_state
from uavseg.segmentation.blocks.leaves import cell_states
from uavseg.segmentation.intervals import StateLimits
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.pipeline import measure_block_map_for
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.classify_strips import (
    ClassifiedStates,
    StateRefinement,
    classify_states,
    state_strips,
)
from uavseg.segmentation.states.state_image import StateImage
from uavseg.units import OCCUPIED

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

LIMITS = StateLimits()
PARAMS = ExtractParams(SegmentParams("paper"))
"""How maps are classified unless something else is said: with the paper's limits and its method."""

DESCRIPTION = "state: 1 free, 2 unknown, 3 occupied"


@dataclass(frozen=True)
class Classification:
    """The states of a map's cells.

    Parameters
    ----------
    image : StateImage
        Reads the states window by window.
    cells : dict of int to int
        How many cells have each state.
    occupied_in_free : int
        Cells that are called free and whose own v lies above the occupied limit: thin walls, perhaps. Who
        plans a path over what is free must look at v as well.
    occupied_by_value : int
        All cells whose own v lies above the occupied limit.
    objects : Extraction or None
        What is occupied, if it was asked for: connected cells, 1..n with the largest first.
    about : About
        The map.
    """

    image: StateImage
    cells: dict[int, int]
    occupied_in_free: int
    occupied_by_value: int
    objects: Extraction | None
    about: About

    @property
    def states(self) -> NDArray[np.uint8]:
        """The state of each cell: 1 free, 2 unknown, 3 occupied, 0 no data; (rows, cols) uint8."""
        return self.image.read()

    def frame(self) -> "GeoDataFrame":
        """The objects as a GeoDataFrame.

        Raises
        ------
        ParameterError
            If no objects were asked for.
        """
        if self.objects is None:
            raise ParameterError("no objects were asked for; classify with objects=True")
        return self.objects.regions.frame()

    @property
    def geobox(self) -> GeoBox:
        """Where the cells lie."""
        return self.about.geobox


def classify(
    source: GreySource,
    limits: StateLimits = LIMITS,
    params: ExtractParams = PARAMS,
    objects: bool = True,
    map: Map = serial,
    progress: Progress | None = None,
) -> Classification:
    """Free, unknown and occupied cells of a map of probabilities, refined to the cell.

    What is held for each cell, beyond the block map, is half a byte, and that lies in a temporary file where
    the map is large; see `segmentation.classification`.

    Parameters
    ----------
    source : GreySource
        A map as `maps.open_map` opens it.
    limits : StateLimits
    params : ExtractParams
        `segment.refine` is "scan" or "none"; `min_area` and `simplify_m` are of the objects, `stretch` and
        `fill_holes` are not looked at.
    objects : bool
        Whether occupied segments are wanted as objects.
    map : Map
        Who reads the tiles.
    progress : callable, optional

    Raises
    ------
    MapError
        If no cell of the map is valid, or it holds something else than probabilities.
    ParameterError
        If the refinement is another.
    """
    how = params.segment
    refine = _refinement(how)
    strips = state_strips(source.shape, source.dataset.file_block, params.tile)
    windows = [tile for strip in strips for tile in strip]
    first, second, *third = TilePass(windows, map, progress).stages(2 + objects)
    blocks = measure_block_map_for(source, limits, how, first)
    cells = cell_states(blocks, limits, how.division)
    del blocks
    give_back()
    if not cells.any():
        raise MapError(f"{source.dataset.source} has no valid cell: all of it is nodata or NaN")
    found = classify_states(source, cells, limits, refine, strips, map, second.progress)
    leaves = cells if refine == "none" else None
    made = _objects(source, found, leaves, limits, params, third[0]) if objects else None
    hazard = found.occupied_in_free, found.occupied_by_value
    return Classification(found.image, found.pixels, *hazard, made, About.source(source))


def write_states(
    path: str | os.PathLike[str], found: Classification, overwrite: bool = False, mode: str = "trinary"
) -> None:
    """Write the states of a map: a uint8 GeoTIFF with nodata 0, or for a .yaml a ROS map.

    A ROS map has no nodata, so such cells become unknown. It is held whole while it is written, a byte a
    cell; a GeoTIFF is written row by row.

    Parameters
    ----------
    path : path
        .tif, or .yaml.
    found : Classification
    overwrite : bool
        Whether files that are there may be replaced.
    mode : {"trinary", "scale", "raw"}
        Of the ROS map.

    Raises
    ------
    MapError
        If ROS has no way to say where the cells lie.
    OutputExistsError, OutputError
        If a file may not or cannot be written.
    """
    if is_ros_map(path):
        write_ros_map(path, found.image.read(), found.geobox, overwrite, mode)
    else:
        strips = found.image.strips()
        write_labels(path, strips, found.geobox, overwrite, dtype=np.uint8, description=DESCRIPTION)


def _refinement(how: SegmentParams) -> StateRefinement:
    if how.refine == "smooth" or how.refine == "tv":
        raise ParameterError(
            f"states are refined by scans or not at all: refine is scan or none, not {how.refine}"
        )
    return how.refine


def _objects(
    source: GreySource,
    found: ClassifiedStates,
    leaves: NDArray[np.uint8] | None,
    limits: StateLimits,
    params: ExtractParams,
    tile_pass: TilePass,
) -> Extraction:
    outlined = outline_state(source, found.image, OCCUPIED, tile_pass, leaves)
    if params.min_area is not None:
        outlined = drop_small_regions(outlined, source.dataset.geobox, params.min_area)
    bounds = _bounds(outlined.rings, source.dataset.geobox)
    about = About.source(source)
    return measured(outlined, about, limits.occupied_above, 1.0, params.drawing, bounds)


def _bounds(rings: Rings, geobox: GeoBox) -> dict[str, NDArray[np.float64]]:
    """The bounding box of each region, in the coordinates of the map."""
    xy = geobox.xy_from_pixel(rings.vertices[:, 0], rings.vertices[:, 1])
    first_rings = np.flatnonzero(np.diff(rings.labels, prepend=0))
    starts = rings.starts[first_rings]
    named = {}
    for name, coordinates in zip("xy", xy, strict=True):
        whole = np.asarray(coordinates, np.float64)
        named[f"{name}_min"] = np.minimum.reduceat(whole, starts) if len(starts) else np.empty(0)
        named[f"{name}_max"] = np.maximum.reduceat(whole, starts) if len(starts) else np.empty(0)
    return {name: named[name] for name in ("x_min", "y_min", "x_max", "y_max")}
