"""Words of Python callers as values, and warnings of results as Python's."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, TypeVar

from uavseg.access import allowing
from uavseg.arguments import checked
from uavseg.arrays import GeoDataFrame
from uavseg.dataclass import dataclass
from uavseg.execution.executors import Progress, decided, threads, usable_cores
from uavseg.execution.progress_bar import ProgressLine
from uavseg.jobs.requests import RegionJob, region_job
from uavseg.jobs.source.work import Work
from uavseg.options.regions import ExtractOptions, LevelsOptions, MatchOptions
from uavseg.options.running import RunOptions

F = TypeVar("F", bound=Callable[..., Any])


def job_function(function: F) -> F:
    """Make a public function of one that answers with a value that has warnings.

    Its arguments are checked, files may name what they allow, and its caller is warned.
    """

    @wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        with allowing(given.get("allow_path", ()), given.get("allow_network", False)):
            answer = function(*args, **given)
        warn(answer.warnings)
        return answer

    return checked(call)  # type: ignore[return-value]


def work(run: RunOptions, progress: Progress | bool | None = None) -> Work:
    """Return how a job is run: by threads, with finished tiles kept in a folder if one is given.

    ParameterError is raised if the number of threads is below 1.
    """
    pool = threads(run.threads)
    decided("%d threads", run.threads or usable_cores())
    return Work(run.tile, pool, pool, progress_of(progress), run.resume)


def progress_of(progress: Progress | bool | None) -> Progress | None:
    """Return what is called with the progress: a bar where it is True."""
    if progress is True:
        return ProgressLine()
    return None if progress is False else progress


def is_given(several: object) -> bool:
    """Return whether an argument of several values is given."""
    return not (isinstance(several, tuple | list) and len(several) == 0)


def warn(messages: Iterable[str], level: int = 4) -> None:
    """Warn the caller of the public function that calls this."""
    for message in messages:
        warnings.warn(message, stacklevel=level)  # past its check of arguments


def listed_zones(avoid: Any) -> Sequence[Any]:
    """Keep-out zones as a sequence; two numbers are one range."""
    if not isinstance(avoid, list | tuple):
        return [avoid]
    numbers = len(avoid) == 2 and all(isinstance(end, int | float) for end in avoid)
    return [avoid] if numbers else avoid


@dataclass(slots=True)
class Requested:
    """What a function is asked for, while `collecting` takes it in place of an answer."""

    job: RegionJob | None = None
    run: RunOptions | None = None


_requested: ContextVar[Requested | None] = ContextVar("requested", default=None)


@contextmanager
def collecting() -> Iterator[Requested]:
    """Enter a context in which functions that give regions check their arguments, and do no more."""
    requested = Requested()
    token = _requested.set(requested)
    try:
        yield requested
    finally:
        _requested.reset(token)


def regions_of(
    source: Any, options: ExtractOptions | LevelsOptions | MatchOptions, progress: Progress | bool | None
) -> GeoDataFrame:
    """Return the regions of a source, for the public function that calls this; within `collecting`, None."""
    job = region_job(options)
    with allowing(options.access.allow_path, options.access.allow_network):
        how = work(options.run, progress)
        requested = _requested.get()
        if requested is not None:
            requested.job, requested.run = job, options.run
            return None
        found = job.find(job.opened(source, job.read), how)
    warn(found.warnings, 5)
    return found.regions.frame()
