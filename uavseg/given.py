"""What Python callers give, made into values: paths and arrays into datasets, words into areas and maps."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from affine import Affine

from uavseg.errors import ParameterError
from uavseg.occupancy.grid import OccupancyGrid
from uavseg.occupancy.maps import open_map, stretch_of
from uavseg.occupancy.rosmap import is_ros_map
from uavseg.parallel import Map
from uavseg.parallel import threads as workers
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.raster.skipping import BadBlock
from uavseg.raster.stretch import Stretch, StretchSpec, parse_stretch
from uavseg.regions.cleaning import Area, parse_area
from uavseg.resuming import kept


def dataset_of(
    source: Any,
    band: int | None = None,
    rgb: tuple[int, int, int] | None = None,
    nodata: float | None = None,
    skip_bad_tiles: bool = False,
) -> Dataset:
    """A dataset of paths, of an array or of what is one already.

    Raises
    ------
    UavsegError
        If a file cannot be opened, an array is not of numbers in rows and columns, or an option means nothing
        to it.
    """
    if isinstance(source, Dataset):
        return replace(source, skip_bad_tiles=source.skip_bad_tiles or skip_bad_tiles)
    if isinstance(source, np.ndarray):
        if source.ndim != 2 or source.dtype.kind not in "iuf" or source.size == 0:
            raise ParameterError(
                f"an array wants numbers in rows and columns, not {source.dtype} of shape {source.shape}"
            )
        if (band, rgb, nodata) != (None, None, None):
            raise ParameterError("an array has one band and no nodata; what is missing in it is NaN")
        return Dataset.of_values(source, GeoBox(source.shape, Affine.identity(), None), "array")
    return Dataset.open(source, band, rgb, nodata, skip_bad_tiles)


def map_of(
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


def workers_of(threads: int | None, resume: str | os.PathLike[str] | None) -> Map:
    """Threads, which keep finished tiles in a folder if one is given."""
    run = workers(threads)
    return run if resume is None else kept(run, resume)


def warn_of(bad: set[BadBlock]) -> None:
    """Warn whoever called the public function of blocks that could not be read."""
    for block in sorted(bad):
        warnings.warn(str(block), stacklevel=3)


def warn_that(told: Iterable[str]) -> None:
    """Warn whoever called the public function of what it should know."""
    for text in told:
        warnings.warn(text, stacklevel=3)


def area_of(given: float | str | None) -> Area | None:
    """Square metres, or an area as text."""
    if given is None:
        return None
    return parse_area(given) if isinstance(given, str) else Area(float(given))
