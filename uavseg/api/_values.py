"""Words of Python callers as values, and warnings of results as Python's."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

from uavseg.execution.executors import Progress
from uavseg.execution.executors import threads as thread_pool
from uavseg.jobs.work import Work


def work(
    threads: int | None,
    tile: int | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Work:
    """How the job is run: by threads, with finished tiles kept in a folder if one is given."""
    run = thread_pool(threads)
    return Work(tile, run, run, progress, resume)


def warn(messages: Iterable[str]) -> None:
    """Warn the caller of the public function that calls this."""
    for message in messages:
        warnings.warn(message, stacklevel=4)  # past its check of arguments


def listed_zones(avoid: Any) -> Sequence[Any]:
    """Keep-out zones as a sequence; two numbers are one range."""
    if not isinstance(avoid, list | tuple):
        return [avoid]
    numbers = len(avoid) == 2 and all(isinstance(end, int | float) for end in avoid)
    return [avoid] if numbers else avoid
