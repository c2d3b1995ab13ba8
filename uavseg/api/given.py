"""What Python callers give, made into values: paths and arrays into datasets, words into areas and maps."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from affine import Affine

from uavseg.errors import ParameterError
from uavseg.execution.checkpoint import with_checkpoint
from uavseg.execution.executors import Map
from uavseg.execution.executors import threads as workers
from uavseg.raster.bad_blocks import BadBlock, with_bad_blocks
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox
from uavseg.regions.edit.small import Area, parse_area


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


@contextmanager
def working(threads: int | None, resume: str | os.PathLike[str] | None) -> Iterator[Map]:
    """Who runs the work of a public function: threads, which keep finished tiles in a folder if one is given.

    When the work is done, whoever called the function is warned of blocks that could not be read.
    """
    run = workers(threads)
    bad: set[BadBlock] = set()
    yield with_bad_blocks(run if resume is None else with_checkpoint(run, resume), bad)
    for block in sorted(bad):
        warnings.warn(str(block), stacklevel=4)  # over this, contextlib and the public function


def warn_that(told: Iterable[str]) -> None:
    """Warn whoever called the public function of what it should know."""
    for text in told:
        warnings.warn(text, stacklevel=3)


def area_of(given: float | str | None) -> Area | None:
    """Square metres, or an area as text."""
    if given is None:
        return None
    return parse_area(given) if isinstance(given, str) else Area(float(given))
