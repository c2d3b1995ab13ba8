"""Log of what a job decides and how long its phases take: the logger "uavseg" and its children, at INFO."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

logger = logging.getLogger("uavseg.jobs")


def decided(text: str, *values: object) -> None:
    """Log what a job decided."""
    logger.info(text, *values)


@contextmanager
def phase(name: str) -> Iterator[None]:
    """Context that logs how long a phase took, without the time in which kernels were compiled."""
    begun = working_seconds()
    yield
    logger.info("phase %s: %.2f s", name, working_seconds() - begun)


def working_seconds() -> float:
    """Seconds of a clock that stands still while kernels are compiled."""
    from uavseg._jit import messages

    return time.perf_counter() - messages.compiling_seconds()
