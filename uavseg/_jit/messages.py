"""Callbacks for what a user should know: kernels that are being compiled, and notes about the fallback."""

import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

on_compile: Callable[[str], None] | None = None
"""Receives the name of each kernel before it is compiled; the command line tells its user."""

on_note: Callable[[str], None] | None = None
"""Receives one line when kernels run through the fallback; by default it becomes a Python warning."""

_notes: set[str] = set()
_compiled_s = [0.0]


@contextmanager
def timing_compilation() -> Iterator[None]:
    """Enter a context in which a kernel is compiled; kernels are compiled one after the other."""
    begun = time.perf_counter()
    try:
        yield
    finally:
        _compiled_s[0] += time.perf_counter() - begun


def compiling_seconds() -> float:
    """Return how long this process has compiled kernels, loading of the compiler included."""
    return _compiled_s[0]


def announce(name: str) -> None:
    """Pass on that a kernel is about to be compiled."""
    if on_compile is not None:
        on_compile(name)


def note(text: str) -> None:
    """Pass on a note, once in a process."""
    if text in _notes:
        return
    _notes.add(text)
    if on_note is not None:
        on_note(text)
    else:
        warnings.warn(f"uavseg: {text}", stacklevel=2)
