"""Freed memory, given back to the system."""

import sys


def give_back() -> None:
    """Return what the C library keeps of freed memory for later, where it can be asked to (glibc).

    Called between phases: the arrays of one are of other sizes than those of the next, and what the first
    has freed would stay with the process.
    """
    if sys.platform != "linux":
        return
    import ctypes

    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
