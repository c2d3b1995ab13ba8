"""Words of Python callers as values, and warnings of results as Python's."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from uavseg.execution.executors import Progress
from uavseg.execution.progress_bar import ProgressLine
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.source.work import Work

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

    from uavseg.jobs.each.each import RegionJob


def work(
    threads: int | None,
    tile: int | None = None,
    progress: Progress | bool | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Work:
    """How the job is run: by threads, with finished tiles kept in a folder if one is given."""
    return Work.by_threads(threads, tile, progress_of(progress), resume)


def progress_of(progress: Progress | bool | None) -> Progress | None:
    """What is called with the progress: a bar where it is True."""
    if progress is True:
        return ProgressLine()
    return None if progress is False else progress


def is_given(several: object) -> bool:
    """Whether an argument that holds several is not left empty."""
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
class Asked:
    """What a function is asked for, while `asking` collects it in place of an answer."""

    job: RegionJob | None = None
    work: Work | None = None


_asked: ContextVar[Asked | None] = ContextVar("asked", default=None)


@contextmanager
def asking() -> Iterator[Asked]:
    """Context in which functions that give regions check their arguments, and do no more."""
    asked = Asked()
    token = _asked.set(asked)
    try:
        yield asked
    finally:
        _asked.reset(token)


def regions_of(source: Any, job: RegionJob, how: Work) -> GeoDataFrame:
    """The regions of a source, for the public function that calls this; within `asking`, None."""
    asked = _asked.get()
    if asked is not None:
        asked.job, asked.work = job, how
        return None
    found = job.find(open_source(source, job.read), how)
    warn(found.warnings, 5)
    return found.regions.frame()
