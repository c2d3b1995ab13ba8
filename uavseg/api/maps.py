"""Maps of probabilities: from recorded bags, their states, and paths over them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import job_function, warn, work
from uavseg.arguments import checked
from uavseg.execution.executors import Progress
from uavseg.jobs.maps.build_map import build_map as run_build_map, merge_params, topics_of
from uavseg.jobs.maps.classify import Classification, classify as run_classify, classify_request
from uavseg.jobs.maps.compare import Comparison, compare as run_compare, compare_job, open_both
from uavseg.jobs.maps.mask import FilterMask, mask as run_mask
from uavseg.jobs.maps.merge_maps import MergedMap, merge_maps as run_merge_maps
from uavseg.jobs.maps.path import path as run_path, path_request
from uavseg.jobs.source.open_source import open_probability_map
from uavseg.occupancy.bags.merge_bag import BuiltMap
from uavseg.occupancy.paths.find_path import PlannedPath
from uavseg.options.maps import BuildMapOptions, ClassifyOptions, PathOptions
from uavseg.options.option import build
from uavseg.options.regions import CompareOptions
from uavseg.regions.edit.small import as_area


@job_function
def classify(
    source: Any,
    *,
    free_below: float = 0.498,
    occupied_above: float = 0.502,
    band: int | str | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str | None = None,
    free_is_white: bool | None = None,
    method: str = "adaptive",
    refine: str = "scan",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    min_area: float | str | None = None,
    simplify: float | None = None,
    allow_lost_obstacles: bool = False,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Classification:
    """Classify what is free, unknown and occupied in a map of probabilities.

    Parameters
    ----------
    source : path, array, DataArray, open raster of rasterio, OccupancyGrid or Dataset
        The path is of a raster or of the YAML file of a ROS map. Integers are divided by the largest of their
        type; floats lie in 0..1.
    free_is_white : bool, optional
        Of a picture (such as .pgm) without its YAML file, where it is required: whether white or black is
        free. Where it is white, 205 is unknown.
    free_below, occupied_above : float
        The limits of the probability of being occupied.
    stretch : str, optional
        For a map that holds no probabilities, such as "0,100" for one in per cent. Integers are divided by
        the largest of their type, floats are taken as they are, if left out. A ROS map is never stretched.
    method : {"adaptive", "paper"}
        With "adaptive" and refine "scan", thin obstacles (walls of one or two cells) are restored after the
        scans, where the noise of the map does not explain them. "paper" is the method of the paper alone.
    refine : {"scan", "none"}
        With "none", states end at block edges.
    min_area, simplify
        Of the objects: as of `extract`.
    allow_lost_obstacles : bool
        Whether obstacles of the map may have no occupied cell, with a warning, instead of an error.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    found : Classification
        `states`, a (rows, cols) uint8 array: 1 free, 2 unknown, 3 occupied, 0 no data. `frame()`, the
        occupied objects as a GeoDataFrame with the columns of `extract` and x_min, y_min, x_max and y_max.
        `occupied_in_free`, `unknown_in_free`: how many cells are called free though their own v is that of an
        occupied or an unknown one. `restored`: cells of thin obstacles; `lost_obstacles`: those without any.

    Raises
    ------
    LostObstaclesError
        If obstacles would be lost, and that is not allowed.
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
    options = build(ClassifyOptions, locals())
    opened = open_probability_map(source, options.read)
    return run_classify(opened, classify_request(options, True), work(options.run, progress))


@checked
def path(
    source: Any,
    range: tuple[float, float] | str | None,
    start: tuple[float, float],
    goal: tuple[float, float],
    *,
    values: Sequence[float | None] | str | None = None,
    percentile: Sequence[float | None] | str | None = None,
    clearance: float = 0.0,
    smooth: bool = False,
    band: int | str | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str | None = None,
    free_is_white: bool | None = None,
    method: str = "adaptive",
    threshold: float = 1.2,
    intensity_step: float = 0.05,
    refine: str | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> PlannedPath:
    """Find the shortest path between two places of one region of a map.

    It leads from cell to cell in eight directions, cuts no corner, and never enters a cell whose own value is
    out of the range.

    Parameters
    ----------
    source : path, array, DataArray, open raster of rasterio, OccupancyGrid or Dataset
        A map of probabilities, as of `classify`.
    range : (float, float) or None
        Of v in [0, 1], both ends in it: what is passable, such as (0, 0.45). None where `values` or
        `percentile` is given.
    values, percentile : (float or None, float or None), optional
        As of `extract`.
    start, goal : (float, float)
        x and y in the map's coordinates.
    clearance : float
        Metres from the centres of the path's cells to everything that is not passable.
    smooth : bool
        Whether the path is pulled tight, at any angle.
    band, index, expr, band_names
        As of `extract`.
    nodata : float or str, optional
        As of `extract`.
    stretch : str, optional
        For a map that holds no probabilities. Integers are divided by the largest of their type, floats are
        taken as they are, if left out. A ROS map is never stretched.
    free_is_white : bool, optional
        As of `classify`.
    method, threshold, intensity_step
        As of `extract`.
    refine : {"pixels", "scan"}, optional
        What makes a region: cells by their own value, or as in the paper by the mean of their block too. The
        default is "pixels", and "scan" with the paper's method.
    tile, threads : int, optional
        Change no result.
    progress : callable or bool, optional
        Called with (done, total); True draws a bar on stderr, in notebooks too.
    resume, allow_path, allow_network
        As of `extract`.

    Returns
    -------
    way : PlannedPath
        Its corners are `way.xy` on the map; its length is `way.length_m`, in units of the map where that has
        no CRS; `way.warnings` are warnings too.

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
    >>> from uavseg.occupancy.simulation.scenes import lens
    >>> way = uavseg.path(lens().run(), range=(0, 0.45), start=(1.605, 2.805), goal=(2.305, 0.705))
    >>> [round(float(number), 3) for number in way.xy[-1]]
    [2.305, 0.705]
    """
    options = build(PathOptions, locals())
    request = path_request(options)
    with allowing(allow_path, allow_network):
        found = run_path(open_probability_map(source, options.read), request, work(options.run, progress))
    warn(found.warnings)
    return found.path


@job_function
def build_map(
    bag: str | os.PathLike[str],
    *,
    scan: str = "/scan",
    odom: str | None = None,
    tf: bool = False,
    resolution: float = 0.05,
    sigma: float = 0.03,
    max_range: float | None = None,
    heights: tuple[float, float] | None = None,
    no_return: str = "inf",
    beam_order: str | None = None,
) -> BuiltMap:
    """Merge the scans of a recorded bag of ROS 1 or ROS 2 into a map; ROS itself is not needed.

    Each scan is merged at the pose that the sensor had at its time, interpolated between two messages
    (linear, rotations by slerp). No pose is extrapolated, or interpolated over more than a second. Where a
    scan says its `time_increment`, each of its beams is merged at a pose of its own.

    Parameters
    ----------
    bag : path
        A .bag of ROS 1; a folder, .mcap or .db3 of ROS 2. Needs rosbags: ``pip install "uavseg[ros]"``.
    scan : str
        Topic of sensor_msgs/LaserScan, MultiEchoLaserScan or PointCloud2.
    odom : str, optional
        Topic of nav_msgs/Odometry, by default /odom. Where /tf_static places the sensor on the robot, that
        counts.
    tf : bool
        Whether poses come from the tree of /tf and /tf_static instead; the map is in the frame at its root.
    resolution : float
        Side of a cell in metres. The map grows to what the scans observe.
    sigma : float
        Standard deviation of ranges in metres.
    max_range : float, optional
        Metres up to which beams are used; by default the `range_max` of each scan.
    heights : (float, float), optional
        For point clouds: the lowest and the highest in metres above the origin of the map's frame. The
        nearest point between them in each direction is an obstacle.
    no_return : {"inf", "range_max"}
        What a range is where nothing returned: +inf by REP 117, or also `range_max`.
    beam_order : {"angles", "increment"}, optional
        What counts where the sign of `angle_increment` contradicts the angles; such scans are left out if
        this is.

    Returns
    -------
    built : BuiltMap
        `built.grid` is the OccupancyGrid, `built.write("map.yaml")` writes it; `built.scans` says how many
        scans were merged and left out, `built.warnings` are warnings too.

    Raises
    ------
    BagError
        If the bag cannot be read, lacks a topic or has another type there, or no scan has a pose; if the map
        would have more than 100 million cells.
    """
    return run_build_map(bag, topics_of(scan, odom, tf), merge_params(build(BuildMapOptions, locals())))


@job_function
def compare(
    before: Any,
    after: Any,
    range: Any = None,
    *,
    values: Sequence[float | None] | str | None = None,
    percentile: Sequence[float | None] | str | None = None,
    classes: Mapping[str, Any] | str | os.PathLike[str] | None = None,
    min_area: float | str | None = None,
    refine: str | None = None,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str | None = None,
    collar: str = "auto",
    bounds: tuple[float, float, float, float] | None = None,
    aoi: str | os.PathLike[str] | None = None,
    warp: bool = False,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Comparison:
    """Find what changed between two rasters of one place, or between two maps of probabilities.

    Parameters
    ----------
    before, after
        As `source` of `extract`; only ground that is valid in both counts, on the grid of the finer one.
        Without a range and classes as of `classify`: maps, registered first within 5 cells and 2 degrees.
    range, values, percentile, classes, refine, band, ..., allow_network
        As of `extract`.
    min_area : float or str, optional
        Square metres, or pixels as "64px": smaller changes are left out of the regions, not of the sums.

    Returns
    -------
    found : Comparison
        `found.frame()`, the changes as a GeoDataFrame, with the column `class`: "gained" and "lost", or for
        maps "new", "gone", "first seen" and "not seen again"; `found.changes`, pixels and area of each.

    Raises
    ------
    UavsegError
        If a source cannot be read, maps do not register, there is no common ground, or a parameter is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> compare(np.eye(64), np.ones((64, 64)), (0.5, 1), stretch="none", refine="pixels").changes
    {'gained': (4032, 4032.0), 'lost': (0, 0.0)}
    """
    options = build(CompareOptions, locals())
    job, least = compare_job(options), as_area(min_area)
    sources = open_both(before, after, job, options.read)
    return run_compare(*sources, job, least, work(options.run, progress))


@job_function
def merge_maps(
    maps: Any,
    *,
    crop: bool = False,
    unrotate: bool = False,
    resolution: float | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> MergedMap:
    """Merge maps that lie in one frame into one; a single map may be cropped and turned.

    Where maps differ, the value farthest from 0.5 counts; what is occupied in one of them is occupied.
    Turning and other resolutions lose no obstacle.

    Parameters
    ----------
    maps : path, OccupancyGrid, or sequence of these
        YAML files of ROS maps, rasters of probabilities in metres. The cells are those of the first, as far
        as all of them reach.
    crop : bool
        Whether the map ends where nothing beyond is known.
    unrotate : bool
        Whether its rows run along the x axis, a yaw of 0.
    resolution : float, optional
        Side of a cell in metres, by default that of the first map.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    merged : MergedMap
        `merged.probabilities` and `merged.geobox`; `merged.write("map.yaml")` writes it; `merged.warnings`
        are warnings too.

    Raises
    ------
    MapError
        If a map cannot be placed, or lies in another coordinate system than the first; if the merged map
        would have more than 100 million cells, or nothing of it is known and it is to be cropped.
    UavsegError
        If a map cannot be read, or a parameter is wrong.
    """
    several = maps if isinstance(maps, list | tuple) else [maps]
    return run_merge_maps(several, crop, unrotate, resolution)


@job_function
def mask(
    regions: Any,
    map: Any,
    *,
    speed: int | None = None,
    layer: str | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> FilterMask:
    """Make a mask of regions for a costmap filter of Nav2: a robot keeps out of them, or is slower in them.

    Parameters
    ----------
    regions : path or GeoDataFrame
        Polygons in the coordinates of the map.
    map : path or OccupancyGrid
        The map whose cells the mask has. Every cell that a region touches is in it.
    speed : int, optional
        At most so many per cent of the robot's largest speed, 1 to 99; by default it keeps out.
    layer : str, optional
        The layer of a file of regions that has several.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    mask : FilterMask
        `mask.values` and `mask.geobox`; `mask.write("keepout.yaml")` writes it, with a .pgm and the
        parameters of Nav2 in a .params.yaml.

    Raises
    ------
    UavsegError
        If the regions or the map cannot be read, they do not touch it, or the speed is no per cent.
    """
    return run_mask(regions, map, speed, layer)
