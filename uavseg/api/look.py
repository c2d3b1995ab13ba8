"""What a raster, or a file of regions, is and holds."""

from __future__ import annotations

import os
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.arguments import checked
from uavseg.jobs.info import info as run_info
from uavseg.jobs.info import open_to_describe
from uavseg.jobs.info_regions import info_regions, names_regions
from uavseg.jobs.source.work import Work
from uavseg.options.option import build
from uavseg.options.regions import InfoOptions
from uavseg.raster.summary import Summary
from uavseg.regions.formats.about_file import RegionFile


@checked
def info(
    source: Any,
    *,
    band: int | str | None = None,
    rgb: tuple[int | str, int | str, int | str] | None = None,
    index: str | None = None,
    expr: str | None = None,
    band_names: str | None = None,
    nodata: float | str | None = None,
    stretch: str = "auto",
    threads: int | None = None,
    skip_bad_tiles: bool = False,
    collar: str = "auto",
    allow_path: Folders = (),
    allow_network: bool = False,
) -> Summary | RegionFile:
    """What a raster is and what its intensity looks like, or what a file of regions holds.

    Parameters
    ----------
    source
        As of `extract`; or the path of a file of regions.
    band, ..., allow_network
        As of `extract`.

    Returns
    -------
    found : Summary or RegionFile
        Of a raster: size, CRS, resolution, bands, stretch and histogram of v; `command`, a command to try
        next; `warnings`. Of a file of regions: its format, CRS, extent and columns, and `metadata`, what they
        were made from and how. `as_dict()` is what ``uavseg info --json`` writes.

    Raises
    ------
    UavsegError
        If it cannot be read, or a parameter is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> import uavseg
    >>> found = uavseg.info(np.full((64, 80), 51, np.uint8))
    >>> found.rows, found.cols, found.stretch, round(found.mean, 3)
    (64, 80, 'dtype -> 0..255', 0.2)
    """
    options = build(InfoOptions, locals())
    with allowing(allow_path, allow_network):
        if names_regions(source):
            return info_regions(source, options.read)
        return run_info(open_to_describe(source, options.read), Work.by_threads(threads), _names(source))


def _names(source: Any) -> list[str]:
    """The source as it was named; empty where it is no file."""
    parts = source if isinstance(source, list | tuple) else [source]
    return [os.fspath(part) for part in parts if isinstance(part, str | os.PathLike)]
