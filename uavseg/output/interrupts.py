"""Signals: held back while renames must not stop half way, or handled by default during long library calls.

Python handles a signal when the main thread runs Python, which it does not while a library works there. A
program that `ends_by_signals` ends all the same: see `cli.terminal.stop`.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from uavseg.output.staging import has_stages

# Windows has no SIGHUP.
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
holding = threading.RLock()
"""Held during what must not stop half way."""
_ends_by_signals = False


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C, SIGTERM and SIGHUP; the first that came takes effect at the end.

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
    """Mark a program that a signal may end at once, see `default_signals`."""
    global _ends_by_signals
    before, _ends_by_signals = _ends_by_signals, True
    try:
        yield
    finally:
        _ends_by_signals = before


@contextmanager
def default_signals() -> Iterator[None]:
    """Let signals end the program at once during a call that blocks the interpreter.

    Only in the main thread of a program (`ends_by_signals`), and not while an output is being made, which
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
    """Set a handler, and return those before it; ignored signals stay ignored."""
    return {number: signal.signal(number, handler) for number in _SIGNALS if _is_handled(number)}


def _put_back(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _is_handled(number: signal.Signals) -> bool:
    """Return whether a signal has an effect, and a handler that Python can put back."""
    return signal.getsignal(number) not in (signal.SIG_IGN, None)
