"""Summary of a file of regions: what it holds, and how its regions were made."""

import os
from typing import Any

from uavseg.errors import ParameterError
from uavseg.options.reading import ReadOptions
from uavseg.regions.formats.about_file import RegionFile, about_file, is_region_file


def names_regions(source: Any) -> bool:
    """Return whether a source of `info` is a file of regions, rather than rasters."""
    parts = source if isinstance(source, list | tuple) else [source]
    return len(parts) == 1 and isinstance(parts[0], str | os.PathLike) and is_region_file(parts[0])


def info_regions(source: Any, options: ReadOptions = ReadOptions()) -> RegionFile:
    """Return what a file of regions holds, see `about_file`; refuse options of reading rasters."""
    path = os.fspath(source[0] if isinstance(source, list | tuple) else source)
    if options.chooses_pixels or options.stretches("auto") or options.skip_bad_tiles:
        raise ParameterError(
            f"{path} is a file of regions; band, rgb, nodata, stretch and skip_bad_tiles are for rasters"
        )
    return about_file(path)
