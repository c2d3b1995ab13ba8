"""Freed memory, given back to the system."""

import sys
from collections.abc import Callable
from functools import cache


def trim_heap() -> None:
    """Return what the C library keeps of freed memory for later, where it can be asked to (glibc).

    Called between phases: the arrays of one are of other sizes than those of the next, and what the first
    has freed would stay with the process.
    """
    trim = _trim()
    if trim is not None:
        trim(0)


@cache
def _trim() -> Callable[[int], int] | None:
    if sys.platform != "linux":
        return None
    import ctypes

    return getattr(ctypes.CDLL(None), "malloc_trim", None)
