"""Log of what a job decides and how long its phases take: the logger "uavseg" and its children, at INFO."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

logger = logging.getLogger("uavseg.jobs")

Watcher = Callable[[str | None, int, int], object]
"""Called with a phase that begins, None where it ends or "" between; and its steps: those done, and all."""
_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


def decided(text: str, *values: object) -> None:
    """Log a decision of a job."""
    logger.info(text, *values)


@contextmanager
def phase(name: str) -> Iterator[None]:
    """Log how long a phase takes, without the time in which kernels are compiled."""
    begun = working_seconds()
    watcher = _watcher.get()
    if watcher is not None:
        watcher(name, 0, 0)
    yield
    if watcher is not None:
        watcher(None, 0, 0)
    logger.info("phase %s: %.2f s", name, working_seconds() - begun)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Call a function as phases begin, end and go on."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def steps_done(done: int, total: int) -> None:
    """Report to the watcher that so many steps of a phase are done."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher("", done, total)


def working_seconds() -> float:
    """Return the seconds of a clock that stands still while kernels are compiled."""
    from uavseg._jit import messages

    return time.perf_counter() - messages.compiling_seconds()
