"""Heap trimming: return freed memory to the operating system between phases."""

import sys
from collections.abc import Callable
from functools import cache


def trim_heap() -> None:
    """Return freed heap memory to the operating system, where the C library can (glibc).

    Called between phases: the arrays of one phase differ in size from those of the next, so the memory freed
    by the first would otherwise stay with the process.
    """
    malloc_trim = _malloc_trim()
    if malloc_trim is not None:
        malloc_trim(0)


@cache
def _malloc_trim() -> Callable[[int], int] | None:
    if sys.platform != "linux":
        return None
    import ctypes

    return getattr(ctypes.CDLL(None), "malloc_trim", None)
