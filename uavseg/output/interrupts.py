"""Signals are held back for a moment, so that what must not stop half way is done first."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]  # Windows has no SIGHUP


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Context in which Ctrl-C, SIGTERM and SIGHUP wait; the first that came takes effect at its end.

    Only the main thread gets signals, and only there is anything done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def hold(number: int, _: Any) -> None:
        came.append(number)

    before = {number: signal.signal(number, hold) for number in _SIGNALS if _is_handled(number)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            os.kill(os.getpid(), came[0])


def _is_handled(number: signal.Signals) -> bool:
    """Whether a signal has an effect, and a handler that Python can put back."""
    return signal.getsignal(number) not in (signal.SIG_IGN, None)
