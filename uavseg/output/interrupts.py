"""Signals are held back for a moment, so that what must not stop half way is done first; or end the program.

Python hears a signal when the main thread runs Python, which it does not while a library works there. A
program that `ends_by_signals` ends all the same: see `cli._stop`.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from uavseg.output.staging import has_stages

_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]  # Windows has no SIGHUP
holding = threading.RLock()
"""Held while what must not stop half way is done."""
_ends_by_signals = False


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Context in which Ctrl-C, SIGTERM and SIGHUP wait; the first that came takes effect at its end.

    Only the main thread gets signals; in others only the end of the program waits.
    """
    with holding:
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        came: list[int] = []

        def hold(number: int, _: Any) -> None:
            came.append(number)

        before = _set_handlers(hold)
        try:
            yield
        finally:
            _put_back(before)
            if came:
                os.kill(os.getpid(), came[0])


@contextmanager
def ends_by_signals() -> Iterator[None]:
    """Context of a program, which a signal may end at once: see `deaf_call`."""
    global _ends_by_signals
    before, _ends_by_signals = _ends_by_signals, True
    try:
        yield
    finally:
        _ends_by_signals = before


@contextmanager
def deaf_call() -> Iterator[None]:
    """Context of a call that lets no other thread of Python run: a signal ends the program at once.

    Only in the main thread of a program (`ends_by_signals`), and not where an output is being made, which
    would be left.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not (_ends_by_signals and is_main) or has_stages():
        yield
        return
    before = _set_handlers(signal.SIG_DFL)
    try:
        yield
    finally:
        _put_back(before)


def _set_handlers(handler: Any) -> dict[int, Any]:
    """Handle signals otherwise; returns how they were handled. What is ignored stays so."""
    return {number: signal.signal(number, handler) for number in _SIGNALS if _is_handled(number)}


def _put_back(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _is_handled(number: signal.Signals) -> bool:
    """Whether a signal has an effect, and a handler that Python can put back."""
    return signal.getsignal(number) not in (signal.SIG_IGN, None)
