"""Summary of a raster, with a command to try next, or of a file of regions; proposed command lines."""

import os
import shlex
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from uavseg.access import current_policy, is_address
from uavseg.errors import ParameterError, UnchosenBandsError
from uavseg.execution.executors import phase
from uavseg.jobs.source.open_source import open_pixels
from uavseg.jobs.source.source import Pixels, ProbabilityMap, Raster
from uavseg.jobs.source.work import SERIAL, Work
from uavseg.options.reading import ReadOptions
from uavseg.raster.access.opening import file_exists
from uavseg.raster.grid.geobox import Length
from uavseg.raster.intensity.stretch import Stretch, StretchSpec
from uavseg.raster.read.source_list import expand_sources, is_list
from uavseg.raster.summary import Summary, summarize
from uavseg.regions.formats.metadata import RegionFile, about_file, is_region_file

_FEW = 8  # names that are spelled out where a pattern stands for them


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
    path = parts[0] if len(parts) == 1 else None
    return isinstance(path, str | os.PathLike) and is_region_file(path) and not is_list(path)


def info_regions(source: Any, options: ReadOptions = ReadOptions()) -> RegionFile:
    """Return what a file of regions holds, see `about_file`; refuse options of reading rasters."""
    path = os.fspath(source[0] if isinstance(source, list | tuple) else source)
    is_part = options.bounds is not None or options.aoi is not None or options.warp
    if options.chooses_pixels or options.stretches("auto") or options.skip_bad_tiles or is_part:
        raise ParameterError(
            f"{path} is a file of regions; bands, nodata, stretch, bounds, aoi, warp and skip_bad_tiles "
            "are for rasters"
        )
    return about_file(path)


def extract_line(sources: Sequence[str], options: ReadOptions, interval: str, kind: str = "--range") -> str:
    """Return the line that extracts a range from the same sources, read in the same way.

    Sources are as the user named them. The interval is as --range takes it, or another option, the `kind`.

    Examples
    --------
    >>> extract_line(["my tile.tif"], ReadOptions(band=2, stretch="0,2047"), "0.5,1")
    "uavseg extract 'my tile.tif' --band 2 --stretch 0,2047 --range 0.5,1"
    """
    policy = current_policy()
    access = [word for folder in policy.allow_paths for word in ("--allow-path", folder)]
    access += ["--allow-network"] if policy.allow_network else []
    words = [*source_words(sources), *option_words(options), *access, kind, interval]
    return shlex.join(["uavseg", "extract", *words])


def source_words(sources: Sequence[str]) -> list[str]:
    """Return names of sources as arguments; more than eight become a pattern where one fits."""
    words = [f"./{name}" if name.startswith("-") else name for name in sources]
    if len(words) <= _FEW:
        return words
    folders, suffixes = {os.path.dirname(name) for name in words}, {Path(name).suffix for name in words}  # noqa: PTH120
    if len(folders) > 1 or len(suffixes) > 1:
        return words
    pattern = os.path.join(folders.pop(), f"*{suffixes.pop()}")  # noqa: PTH118 - keeps ./
    return [pattern] if is_list(pattern) and expand_sources([pattern]) == words else words


_ORDER = (
    *("index", "expr", "band_names", "band", "rgb", "nodata", "stretch"),
    *("skip_bad_tiles", "free_is_white", "collar", "flatten", "bounds", "aoi", "warp"),
)


def option_words(options: ReadOptions) -> list[str]:
    """Return the options of the command line for `ReadOptions`; none where they are the defaults."""
    words: list[str] = []
    for name in _ORDER:
        value = getattr(options, name)
        is_default = (name, value) in (("collar", "auto"), ("stretch", StretchSpec("auto")))
        if value is None or value is False or is_default:
            continue
        option = f"--{name.replace('_', '-')}"
        words += [option] if value is True else [option, _text(value)]
    return words


def _text(value: Any) -> str:
    if isinstance(value, Length):
        return value.word
    if isinstance(value, Stretch):
        return _text((value.low, value.high))
    if isinstance(value, StretchSpec):
        if value.bounds is None:
            return value.form
        return f"percentile:{_text(value.bounds)}" if value.form == "percentile" else _text(value.bounds)
    if isinstance(value, tuple | list):
        return ",".join(map(_text, value))
    return repr(float(value)).removesuffix(".0") if isinstance(value, float | Fraction) else str(value)
