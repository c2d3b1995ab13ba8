"""Where a robot looks next in a map of probabilities, and drives until all is known."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from uavseg.access import Folders
from uavseg.api._values import job_function, work
from uavseg.execution.executors import Progress
from uavseg.jobs.maps.explore import Explored, NextViews, explore as run_explore, next_views as run_next_views
from uavseg.jobs.source.open_source import open_probability_map
from uavseg.options.maps import ExploreOptions, NextViewOptions
from uavseg.options.option import build


@job_function
def next_views(
    source: Any,
    pose: Sequence[float],
    range: float,
    *,
    fov: float = 360.0,
    count: int = 5,
    clearance: float = 0.0,
    free_below: float = 0.498,
    occupied_above: float = 0.502,
    band: int | str | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str | None = None,
    free_is_white: bool | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> NextViews:
    """Find the poses from which a robot would see what is unknown in a map, the best first.

    Views stand on free cells and see the frontiers, where free cells border unknown ones. The best begins the
    shortest tour through all of them that ends where unknown space goes on farthest.

    Parameters
    ----------
    source : path, array, DataArray, open raster of rasterio, OccupancyGrid or Dataset
        A map of probabilities in metres with square cells, as of `classify`.
    pose : (float, float) or (float, float, float)
        Where the robot is: x and y on the map, and its heading in degrees, counterclockwise from the x axis.
    range, fov : float
        How far the sensor sees, in metres, and its field of view in degrees.
    count : int
        At most so many views are returned.
    clearance : float
        Metres from the robot's centre to everything that is not free.
    free_below, occupied_above, free_is_white
        As of `classify`.
    band, ..., allow_network
        As of `classify`.

    Returns
    -------
    found : NextViews
        `views`, the best first: each with its `pose`, the safe `way` to it (a PlannedPath), `bits` (the
        entropy of the cells that a scan there is expected to reach), `frontier_m` (length of the frontiers
        that it sees) and `score` (1 for the best). Empty where nothing that can be reached is unknown, with a
        warning. `to_geojson()`.

    Raises
    ------
    MapError
        If the pose lies outside of the map or not on a free cell, or cells are not square metres.
    UavsegError
        If the map cannot be read, or a parameter is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> room = np.full((64, 64), 0.5)
    >>> room[20:40, 10:30] = 0.1
    >>> room[19:41, 9] = room[19, 9:31] = room[40, 9:31] = 0.9
    >>> best = next_views(room, pose=(12.5, 34.5), range=10.0).views[0]
    >>> best.pose.x > 12.5, best.score
    (True, 1.0)
    """
    options = build(NextViewOptions, locals())
    opened = open_probability_map(source, options.read)
    return run_next_views(opened, options, work(options.run, progress))


@job_function
def explore(
    scene: str | os.PathLike[str],
    *,
    start: Sequence[float] | None = None,
    range: float | None = None,
    fov: float | None = None,
    sigma: float | None = None,
    step: float | None = None,
    clearance: float = 0.0,
    seed: int = 0,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Explored:
    """Let a simulated robot explore a scene until nothing that it can see is unknown.

    Parameters
    ----------
    scene : str or path
        "lens" or "circles", the JSON file of a scene, or a robot's map (YAML or raster), whose free cells the
        robot may enter and whose others are solid.
    start : (float, float) or (float, float, float), optional
        x, y and the heading in degrees; the first pose of the scene by default.
    range, fov, sigma, step : float, optional
        Of the sensor: reach in metres, field of view in degrees, standard deviation of ranges in metres, and
        degrees between beams. Those of the scene by default; a map has none, and `range` is required.
    clearance : float
        Metres from the robot's centre to everything that is not free.
    seed : int
        Of the noise; the same seed gives the same drive.
    allow_path, allow_network
        As of `extract`.

    Returns
    -------
    found : Explored
        `drive`, with its `poses`, `metres` and the `grid` that the robot made; `share` of what can be known
        that is known; `to_geojson()` and `table()`.

    Raises
    ------
    UavsegError
        If the scene cannot be read, the start lies in something solid, or a parameter is wrong.
    """
    return run_explore(build(ExploreOptions, locals() | {"scene": os.fspath(scene)}))
