"""Summary of a raster: what it is, what intensity it holds, and a command to try next."""

from collections.abc import Sequence
from dataclasses import replace

from uavseg.access import is_address
from uavseg.execution.phases import phase
from uavseg.jobs.command_line import extract_line
from uavseg.jobs.source import Pixels, Raster, ReadOptions
from uavseg.jobs.work import SERIAL, Work
from uavseg.raster.opening import file_exists
from uavseg.raster.summary import Summary, summarize


def info(source: Pixels, work: Work = SERIAL, named: Sequence[str] = ()) -> Summary:
    """What a raster is, with the blocks of it that could not be read.

    Parameters
    ----------
    source : Raster or ProbabilityMap
    work : Work
    named : sequence of str
        The sources as they were named, for the command to try next; by default the files. Pixels in memory
        have no command.

    Raises
    ------
    UavsegError
        If the raster cannot be read.
    """
    work = work.begun()
    with work.reading_here(), phase("count"):
        found = summarize(source.dataset, source.stretch, work.map, work.progress)
    options = source.options if isinstance(source, Raster) else ReadOptions()
    names = named or [path for path in found.paths if file_exists(path) or is_address(path)]
    line = extract_line(names, options, found.interval) if names else ""
    return work.finished(replace(found, command=line))
