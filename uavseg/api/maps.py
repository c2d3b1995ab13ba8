"""Maps of probabilities: their states, and paths over them."""

from __future__ import annotations

import os
from typing import Any

from uavseg.api.given import area_of, dataset_of, working
from uavseg.errors import ParameterError
from uavseg.execution.executors import Progress
from uavseg.execution.executors import threads as workers
from uavseg.jobs.classify import Classification
from uavseg.jobs.classify import classify as _classify
from uavseg.jobs.extract import ExtractParams
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.paths.find_path import Way, WayParams, find_way
from uavseg.occupancy.paths.free_cells import FreeCells
from uavseg.occupancy.probability_map import open_map, stretch_of
from uavseg.occupancy.ros.ros_map import is_ros_map
from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import Stretch, StretchSpec, fit, parse_stretch
from uavseg.raster.tile_pass import TilePass
from uavseg.segmentation.intervals import IntensityRange, StateLimits
from uavseg.segmentation.params import SegmentParams
from uavseg.segmentation.source import GreySource


def classify(
    source: Any,
    *,
    free_below: float = 0.498,
    occupied_above: float = 0.502,
    band: int | None = None,
    nodata: float | None = None,
    stretch: str | None = None,
    method: str = "paper",
    refine: str = "scan",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    min_area: float | str | None = None,
    simplify: float | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Classification:
    """What is free, unknown and occupied in a map of probabilities.

    Parameters
    ----------
    source : path, DataArray, (rows, cols) array, OccupancyGrid or Dataset
        The path is of a raster or of the YAML file of a ROS map. Integers are divided by the largest of their
        type; floats lie in 0..1.
    free_below, occupied_above : float
        The limits of the probability of being occupied.
    stretch : str, optional
        For a map that holds no probabilities, such as "0,100" for one in per cent. Integers are divided by
        the largest of their type, floats are taken as they are, if left out. A ROS map is never stretched.
    min_area, simplify
        Of the objects: as of `extract`.
    band, ..., resume
        As of `extract`.

    Returns
    -------
    found : Classification
        `states`, a (rows, cols) uint8 array: 1 free, 2 unknown, 3 occupied, 0 no data. `frame()`, the
        occupied objects as a GeoDataFrame with the columns of `extract` and x_min, y_min, x_max and y_max.
        `occupied_in_free`: how many cells are called free though their own v is that of an occupied one.

    Raises
    ------
    UavsegError
        If the map cannot be read, has no valid cell or holds numbers that are no probabilities, or a
        parameter is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> walls = np.zeros((64, 64))
    >>> walls[16:32, 16:48] = 1.0
    >>> found = classify(walls)
    >>> found.cells[3], found.frame()["pixels"].tolist()
    (512, [512])
    """
    segment = SegmentParams(method, threshold, intensity_step, refine)  # type: ignore[arg-type]
    params = ExtractParams(segment, min_area=area_of(min_area), simplify_m=simplify, tile=tile)
    limits = StateLimits(free_below, occupied_above)
    dataset, wanted = _map_of(source, band, nodata, stretch)
    with working(threads, resume) as run:
        grey = GreySource(dataset, fit(dataset, wanted, TilePass.over(dataset, tile, run)))
        return _classify(grey, limits, params, True, run, progress)


def path(
    source: Any,
    range: tuple[float, float],
    start: tuple[float, float],
    goal: tuple[float, float],
    *,
    clearance: float = 0.0,
    smooth: bool = False,
    band: int | None = None,
    nodata: float | None = None,
    stretch: str | None = None,
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Way:
    """The shortest path between two places of one region of a map.

    It leads from cell to cell in eight directions, cuts no corner, and never enters a cell whose own value is
    out of the range.

    Parameters
    ----------
    source : path, DataArray, (rows, cols) array, OccupancyGrid or Dataset
        A map of probabilities, as of `classify`.
    range : (float, float)
        Of v in [0, 1], both ends in it: what is passable, such as (0, 0.45).
    start, goal : (float, float)
        x and y in the map's coordinates.
    clearance : float
        Metres from the centres of the path's cells to everything that is not passable.
    smooth : bool
        Whether the path is pulled tight, at any angle.
    band : int, optional
    nodata : float, optional
    stretch : str, optional
        For a map that holds no probabilities. Integers are divided by the largest of their type, floats are
        taken as they are, if left out. A ROS map is never stretched.
    method, threshold, intensity_step
        As of `extract`.
    tile, threads : int, optional
        Change no result.
    progress : callable, optional
        Called with (done, total).
    resume : path, optional
        As of `extract`.

    Returns
    -------
    way : Way
        Its corners are `way.xy` on the map; its length is `way.length_m`, in units of the map where that has
        no CRS; what is to be told is in `way.warnings`.

    Raises
    ------
    PathError
        If a place lies outside of the map or in no region, the two lie in different regions, or no path leads
        from one to the other.
    UavsegError
        If the map cannot be read or answered rightly, or a parameter is wrong.

    Examples
    --------
    >>> import uavseg
    >>> from uavseg.occupancy.simulation.paper_scenes import lens
    >>> way = uavseg.path(lens().run(), range=(0, 0.45), start=(1.605, 2.805), goal=(2.305, 0.705))
    >>> [round(float(number), 3) for number in way.xy[-1]]
    [2.305, 0.705]
    """
    how = WayParams(clearance, smooth)
    dataset, wanted = _map_of(source, band, nodata, stretch)
    segment = SegmentParams(method, threshold, intensity_step, "scan")  # type: ignore[arg-type]
    params = ExtractParams(segment, wanted, tile=tile)
    with working(threads, resume) as run:
        free = FreeCells.of(dataset, IntensityRange(*range), params, run, progress)
    return find_way(free, start, goal, how, workers(threads))


def _map_of(
    source: Any, band: int | None, nodata: float | None, stretch: str | None
) -> tuple[Dataset, Stretch | StretchSpec]:
    """A map, and the stretch that was named; that of probabilities if none was.

    Raises
    ------
    UavsegError
        As of `dataset_of`, and if a ROS map is to be stretched.
    """
    if isinstance(source, str | os.PathLike):
        dataset, own = open_map(source, band, nodata)
    else:
        dataset = (
            source.dataset() if isinstance(source, OccupancyGrid) else dataset_of(source, band, None, nodata)
        )
        own = stretch_of(dataset)
    if stretch is None:
        return dataset, own
    wanted = parse_stretch(stretch)
    if not (isinstance(source, str | os.PathLike) and is_ros_map(source)):
        return dataset, wanted
    if wanted.form not in ("auto", "none"):
        raise ParameterError("a ROS map holds probabilities, which are not stretched; leave stretch out")
    return dataset, own
