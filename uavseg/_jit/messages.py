"""Callbacks for what a user should know: kernels that are being compiled, and notes about the fallback."""

import warnings
from collections.abc import Callable

on_compile: Callable[[str], None] | None = None
"""Receives the name of each kernel before it is compiled; the command line tells its user."""

on_note: Callable[[str], None] | None = None
"""Receives one line when kernels run through the fallback; by default it becomes a Python warning."""

_notes: set[str] = set()


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
