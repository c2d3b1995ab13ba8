"""Signals that end the program: SIGTERM and SIGHUP unwind like Ctrl-C, and the last line is true.

Where a library keeps the main thread for longer than `DEAF_S`, another thread ends the program.
"""

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

_WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
DEAF_S, UNWINDING_S = 1.5, 5.0
"""Time in which the main thread hears a signal, and in which it then unwinds."""
_heard = threading.Event()


class Stopped(KeyboardInterrupt):
    """A signal that ends the program came; it passes wherever Ctrl-C passes."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def stopping_cleanly(written: object) -> Iterator[threading.Event]:
    """Enter a context in which Ctrl-C, SIGTERM and SIGHUP raise `Stopped`, unless ignored or handled already.

    Yields an event to set when the program has unwound; without it, it is ended, and its last line says what
    was `written`.
    """
    from uavseg.output.staging import ends_by_signals

    unwound = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield unwound
        return
    _heard.clear()
    wanted = [getattr(signal, name) for name in _WORDS if hasattr(signal, name)]
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in wanted if signal.getsignal(number) in usual}
    for number in before:
        signal.signal(number, _stop)
    try:
        with ends_by_signals(), _watched(unwound, written):
            yield unwound
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def exit_code(error: KeyboardInterrupt) -> int:
    """128 and the number of the signal, as a shell has it."""
    return 128 + (error.number if isinstance(error, Stopped) else int(signal.SIGINT))


def end_soon(code: int) -> None:
    """End the program in `DEAF_S` at the latest.

    Python waits at its end for the threads of pools, of which a library may keep one for long.
    """

    def end() -> None:
        time.sleep(DEAF_S)
        os._exit(code)

    threading.Thread(target=end, daemon=True).start()


def last_line(number: int, written: object) -> str:
    """Return what stopped the program, and what it had written."""
    return f"uavseg: {_WORDS[signal.Signals(number).name]}; {written}"


def _stop(number: int, _: Any) -> NoReturn:
    _heard.set()
    raise Stopped(number)


@contextmanager
def _watched(unwound: threading.Event, written: object) -> Iterator[None]:
    """Enter a context in which a thread waits for signals, whatever Python does."""
    if os.name == "nt":  # where pipes may block
        yield
        return
    from uavseg.execution.executors import OWN_THREAD

    heard, told = os.pipe()
    os.set_blocking(told, False)
    before = signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    given = heard, unwound, written
    watch = threading.Thread(target=_watch, args=given, name=f"{OWN_THREAD}watch", daemon=True)
    watch.start()
    try:
        yield
    finally:
        unwound.set()
        signal.set_wakeup_fd(before)
        os.close(told)
        watch.join()
        os.close(heard)


def _watch(heard: int, unwound: threading.Event, written: object) -> None:
    """Wait for a signal that ends the program, and end it where it has not unwound soon after."""
    number = 0
    while number not in {getattr(signal, name, None) for name in _WORDS}:
        byte = os.read(heard, 1)
        if not byte:
            return
        number = byte[0]
    if unwound.wait(DEAF_S) or (_heard.is_set() and unwound.wait(UNWINDING_S)):
        return
    from uavseg.cli.terminal.say import say
    from uavseg.output.staging import holding, remove_stages

    with holding:
        if unwound.is_set():
            return
        remove_stages()
        with suppress(Exception):
            say(last_line(number, written))
        os._exit(128 + number)
