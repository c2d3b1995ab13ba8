"""Summary of a raster, with a command to try next, or of a file of regions."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from uavseg.access import is_address
from uavseg.errors import ParameterError, UnchosenBandsError
from uavseg.execution.executors import phase
from uavseg.jobs.source.command_line import extract_line
from uavseg.jobs.source.open_source import open_pixels
from uavseg.jobs.source.source import Pixels, ProbabilityMap, Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.options.reading import ReadOptions
from uavseg.raster.access.opening import file_exists
from uavseg.raster.summary import Summary, summarize
from uavseg.regions.formats.about_file import RegionFile, about_file, is_region_file


def open_to_describe(source: Any, options: ReadOptions = ReadOptions()) -> Raster | ProbabilityMap:
    """Open a source as `open_pixels`; where no band is chosen, its first one, with a note."""
    try:
        return open_pixels(source, options)
    except UnchosenBandsError:
        opened = open_pixels(source, replace(options, band=1))
    note = (
        "no band is chosen, so the intensity is that of band 1; other commands need --band, --rgb, --index "
        "or --expr"
    )
    dataset = opened.dataset
    return replace(opened, dataset=replace(dataset, warnings=(*dataset.warnings, note)))


def info(source: Pixels, work: Work = SERIAL, named: Sequence[str] = ()) -> Summary:
    """Return what a raster is, with the blocks of it that could not be read.

    `named` are the sources as they were named, for the command to try next; by default the files. Pixels in
    memory have no command.
    """
    work = work.begun()
    options = source.options if isinstance(source, Raster) else ReadOptions()
    collar = options.collar if isinstance(source, Raster) else "keep"
    with work.reading_here(), phase("count"):
        found = summarize(source.dataset, source.stretch, work.map, work.progress, collar)
    names = named or [path for path in found.paths if file_exists(path) or is_address(path)]
    line = extract_line(names, options, found.interval) if names and found.valid else ""
    return work.finished(replace(found, command=line))


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
