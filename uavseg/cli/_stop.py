"""Signals that end the program: SIGTERM and SIGHUP unwind like Ctrl-C, and the last line is true."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

_WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}


class Stopped(KeyboardInterrupt):
    """A signal that ends the program came; it passes wherever Ctrl-C passes."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def stopping_cleanly() -> Iterator[None]:
    """Context in which SIGTERM and SIGHUP raise `Stopped`, unless they are ignored or handled already."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    wanted = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    ours = [number for number in wanted if signal.getsignal(number) is signal.SIG_DFL]
    for number in ours:
        signal.signal(number, _stop)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


def exit_code(error: KeyboardInterrupt) -> int:
    """128 and the number of the signal, as a shell has it."""
    return 128 + _number(error)


def last_line(error: KeyboardInterrupt, written: object) -> str:
    """What stopped the program, and what it had written."""
    return f"uavseg: {_WORDS[signal.Signals(_number(error)).name]}; {written}"


def _number(error: KeyboardInterrupt) -> int:
    return error.number if isinstance(error, Stopped) else int(signal.SIGINT)


def _stop(number: int, _: Any) -> NoReturn:
    raise Stopped(number)
