"""Description of regions and of the objects of maps, and their recognition by examples."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from uavseg.access import Folders
from uavseg.api._values import job_function, work
from uavseg.execution.executors import Progress
from uavseg.jobs.maps.recognition import Description, described as run_describe, recognised as run_recognise
from uavseg.options.maps import DescribeOptions, RecogniseOptions
from uavseg.options.option import build


@job_function
def describe(
    source: Any,
    *,
    raster: Any = None,
    layer: str | None = None,
    gap: float = 0.0,
    min_area: float | str | None = None,
    band: int | str | None = None,
    nodata: float | str | None = None,
    stretch: str | None = None,
    free_is_white: bool | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Description:
    """Measure the shape, texture and bands of regions, or of the occupied objects of a map.

    Parameters
    ----------
    source : path, GeoDataFrame, array, OccupancyGrid, ...
        A file of regions or their frame; or a map of probabilities in metres, as of `classify`.
    raster, layer : path, array or Dataset; str, optional
        Of regions: the raster of which texture and bands are measured too; the layer of their file.
    gap, min_area : float; float or str, optional
        Of a map: objects nearer to each other than these metres are one; smaller ones (m2, "20px") are none.
    free_is_white, band, ..., allow_network
        Of the raster or the map, as of `classify`.

    Returns
    -------
    found : Description
        `frame()` has the columns of the regions and their measures: of shape, texture and bands; angles in
        degrees clockwise from true north. Objects of a map have `seen_outline`, the share of their outline
        that borders on free space rather than on unknown.

    Raises
    ------
    UavsegError
        If regions, raster or map cannot be read or do not fit together, or a parameter is wrong.
    """
    options = build(DescribeOptions, locals())
    return run_describe(options, work(options.run, progress))


@job_function
def recognise(
    source: Any,
    library: str | os.PathLike[str],
    *,
    learn: str | None = None,
    ids: Sequence[int] | None = None,
    min_probability: float = 0.5,
    raster: Any = None,
    layer: str | None = None,
    gap: float = 0.0,
    min_area: float | str | None = None,
    band: int | str | None = None,
    nodata: float | str | None = None,
    stretch: str | None = None,
    free_is_white: bool | None = None,
    tile: int | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Description:
    """Name regions, or the objects of a map, by the described examples that fit them best.

    Parameters
    ----------
    source, raster, layer, gap, min_area, free_is_white, band, ..., allow_network
        As of `describe`.
    library : path
        A file of described regions with a column `name`.
    learn, ids : str and sequence of int, optional
        Add the regions of these ids to the library, or to a new one, as examples of this name instead.
    min_probability : float
        Below it, the name is "cannot tell".

    Returns
    -------
    named : Description
        `frame()` has the columns of `describe`, and `name`, `probability`, `nearest` (the most probable name
        in any case) and `misfit` (mean squared residual of the best fit, in variances). With `learn`, the
        library.

    Raises
    ------
    UavsegError
        As of `describe`; if the library cannot be read, holds no name, or there is no region of an id.
    """
    options = build(RecogniseOptions, locals())
    return run_recognise(options, work(options.run, progress))
