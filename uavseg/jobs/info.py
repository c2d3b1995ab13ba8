"""Summary of a raster: what it is, what intensity it holds, and a command to try next."""

from uavseg.jobs.source import Pixels, Raster
from uavseg.jobs.work import SERIAL, Work
from uavseg.raster.summary import Summary, summarize


def info(source: Pixels, work: Work = SERIAL) -> Summary:
    """What a raster is, with the blocks of it that could not be read.

    Parameters
    ----------
    source : Raster or ProbabilityMap
    work : Work

    Raises
    ------
    UavsegError
        If the raster cannot be read.
    """
    work = work.begun()
    with work.reading_here():
        collar = source.options.collar if isinstance(source, Raster) else "keep"
        return work.finished(summarize(source.dataset, source.stretch, work.map, work.progress, collar))
