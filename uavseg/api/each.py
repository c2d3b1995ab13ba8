"""One job over each of many rasters, and one raster in a folder of files, from Python."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from uavseg.access import Folders, allowing
from uavseg.api._values import collecting, warn, work
from uavseg.api.questions import match
from uavseg.api.rasters import extract, levels
from uavseg.arguments import checked
from uavseg.errors import ParameterError
from uavseg.execution.cluster import dask
from uavseg.execution.executors import Progress
from uavseg.jobs.each.each import Outcome, OutputNames, grouped_warnings, plan_tasks, run_each
from uavseg.jobs.extract import Written, check_local, extract_partitions
from uavseg.jobs.requests import RegionJob
from uavseg.jobs.source.open_source import open_source
from uavseg.options.running import RunOptions
from uavseg.raster.formats.creation import creation_for

_JOBS: tuple[Callable[..., Any], ...] = (extract, levels, match)


@checked
def each(
    job: Callable[..., Any],
    sources: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    output: str,
    *,
    labels: str | None = None,
    creation_options: Mapping[str, Any] | None = None,
    report: str | None = None,
    overwrite: bool = False,
    skip_existing: bool = False,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
    **words: Any,
) -> list[Outcome]:
    """Extract regions of each of many rasters, in a file of its own; those that fail do not stop the others.

    Each file holds the same bytes as if its raster had been alone. Rasters of few tiles run side by side,
    larger ones one after another.

    Parameters
    ----------
    job : function
        `uavseg.extract`, `uavseg.levels` or `uavseg.match`.
    sources : path or sequence of paths
        Rasters, a folder of them, a pattern (``"tiles/*.tif"``) or the names in a text file
        (``"@list.txt"``).
    output : str
        The file of each raster, such as "out/{stem}.gpkg": {stem} is its name without folder and extension,
        {name} with its extension, {suffix} the extension, {parent} the name of its folder, {number} its place
        in the list.
    labels : str, optional
        The same for rasters of labels.
    creation_options : mapping of str to str or int, optional
        How rasters of labels are stored, such as {"COMPRESS": "ZSTD"}; see `CreationOptions`.
    report : str, optional
        A table (.csv) of what came out of each.
    overwrite : bool
        Whether files that are there may be replaced.
    skip_existing : bool
        Whether rasters are left out whose files are there.
    threads, progress, allow_path, allow_network
        As of `extract`.
    **words
        The other arguments of the job, such as ``range=(0.55, 1)``; not ``resume``.

    Returns
    -------
    outcomes : list of Outcome
        In the order of the rasters: source, output, regions, area_m2, warnings, and error, which says why
        there is no output. A warning lists them too.

    Raises
    ------
    UavsegError
        Before anything is computed: if an argument is wrong, no raster is found, two would be written to the
        same file, or a file is there.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.each(uavseg.extract, "tiles", "out/{stem}.gpkg", range=(0.55, 1))  # doctest: +SKIP
    """
    if job not in _JOBS:
        raise ParameterError("job is uavseg.extract, uavseg.levels or uavseg.match")
    regions, run = _requested(job, words)
    if words.get("ask") is not None:
        raise ParameterError("ask is for one source; leave it out")
    if run.resume is not None:
        raise ParameterError("resume is for one source; skip_existing=True leaves out what is done")
    creation = creation_for(creation_options, {labels: "uint32"})
    files = {"overwrite": overwrite, "skip_existing": skip_existing}
    names = OutputNames(output, labels=labels, report=report, creation=creation, **files)
    given = [sources] if isinstance(sources, str | os.PathLike) else sources
    with allowing(allow_path, allow_network):
        tasks, _ = plan_tasks(given, names)
        how = work(replace(run, threads=None), progress)
        result = run_each(tasks, regions, names, how, threads)
    warn([*grouped_warnings(result), *(one.failure for one in result if one.error is not None)])
    return result


@checked
def extract_to(
    output: str | os.PathLike[str],
    source: Any,
    *,
    overwrite: bool = False,
    scheduler: str | None = None,
    progress: Progress | bool | None = None,
    allow_path: Folders = (),
    allow_network: bool = False,
    **words: Any,
) -> Written:
    """Extract the regions of a range to a folder of GeoParquet files, for rasters of any size.

    Workers write the files, so the regions are never in one memory; they are those of `extract`. A region has
    the number of its first pixel as its id, counted from 1 row by row. geopandas, pyarrow and DuckDB read the
    folder as one table.

    Parameters
    ----------
    output : path
        The folder, such as "regions.parquet/"; workers of a cluster share it.
    source
        As of `extract`, but for block maps.
    overwrite : bool
        Whether a folder of such files may be replaced.
    scheduler : str, optional
        Address of a dask.distributed scheduler whose workers do the work; else threads of this process do.
    progress, allow_path, allow_network
        As of `extract`.
    **words
        The other arguments of `extract`, such as ``range=(0.55, 1)``; not those that need all regions at
        once: holes, classes, connectivity 8, the refinement "none", outlines that are smoothed or simplified.

    Returns
    -------
    written : Written
        How many regions are in how many files, their area, and the largest.

    Raises
    ------
    UavsegError
        If an argument is wrong, the folder is there, or the raster cannot be read.

    Examples
    --------
    >>> import uavseg
    >>> uavseg.extract_to("regions.parquet/", "tile.tif", range=(0.55, 1))  # doctest: +SKIP
    """
    regions, run = _requested(extract, words)
    if scheduler is not None and run.threads is not None:
        raise ParameterError("threads are this machine's, a scheduler has its own; give one of the two")
    with ExitStack() as stack, allowing(allow_path, allow_network):
        how = work(run, progress)
        request = check_local(regions.request)
        if scheduler is not None:
            cluster = dask(scheduler)
            stack.callback(cluster.close)
            how = replace(how, executor=cluster)
        opened = open_source(source, regions.read)
        found, written = extract_partitions(opened, request, output, how, overwrite)
    warn(found.warnings)
    return written


def _requested(job: Callable[..., Any], words: dict[str, Any]) -> tuple[RegionJob, RunOptions]:
    """Return what a function is asked for; refuse words that are no arguments of it, or lack one."""
    known = {name: one for name, one in inspect.signature(job).parameters.items() if name != "source"}
    for name in words:
        if name not in known:
            raise ParameterError(f"uavseg.{job.__name__} has no argument {name} here")
    for name, one in known.items():
        if one.default is inspect.Parameter.empty and name not in words:
            raise ParameterError(f"uavseg.{job.__name__} needs {name}; give it by name")
    with collecting() as requested:
        job(None, **words)
    assert requested.job is not None and requested.run is not None, "each of these functions asks for regions"
    return requested.job, requested.run
