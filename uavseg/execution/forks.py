"""Copies of this process (fork) that share its work, where threads would wait for the interpreter's lock."""

import logging
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from uavseg.execution import executors
from uavseg.execution.executors import OWN_THREAD, end_with_parent, logger, watched
from uavseg.output.staging import interrupts_held
from uavseg.warning_filters import changing_filters

Item = TypeVar("Item")
Result = TypeVar("Result")

_ENDING_S = 5.0  # time for a copy to leave nothing behind


def can_fork() -> bool:
    """Return whether copies of this process may share its work: on Linux, where no thread of others runs.

    A lock that another thread holds would stay locked in the copy. Copies keep no log.
    """
    others = (thread for thread in threading.enumerate() if not thread.name.startswith(OWN_THREAD))
    is_alone = threading.current_thread() is threading.main_thread() and len(list(others)) == 1
    return sys.platform == "linux" and is_alone and not logger.isEnabledFor(logging.INFO)


def fork_each(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    count: int,
    received: Callable[[Item, Result], object],
) -> None:
    """Call a function with each item in `count` copies of this process, and pass its results on as they come.

    For work that holds the interpreter's lock; see `can_fork`. Items and results are pickled, the function is
    not. An item whose copy was killed has no result. Where this is interrupted, so is the function in the
    copies; what it returns all the same is passed on.
    """
    from multiprocessing import connection, get_context

    context, waiting = get_context("fork"), deque(items)
    copies: dict[Any, Any] = {}  # processes by connection
    busy: dict[Any, Item] = {}
    try:
        for _ in range(min(count, len(items))):
            ours, theirs = context.Pipe()
            copy = context.Process(target=_serve, args=(function, theirs, [*copies, ours]), daemon=True)
            with changing_filters():
                warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which are ours
                copy.start()
            copies[ours] = copy
            theirs.close()
            busy[ours] = waiting.popleft()
            ours.send(busy[ours])
        while busy:
            ready: list[Any] = connection.wait(list(busy))
            for ours in ready:
                with interrupts_held():
                    item = busy.pop(ours)
                    try:
                        result = ours.recv()
                    except (EOFError, OSError):  # it was killed
                        continue
                    received(item, result)
                    if waiting:
                        busy[ours] = waiting.popleft()
                        with suppress(OSError):
                            ours.send(busy[ours])
    finally:
        for ours in busy:
            copies[ours].terminate()
        for ours, copy in copies.items():
            with suppress(EOFError, OSError):
                if ours in busy and ours.poll(_ENDING_S):
                    received(busy[ours], ours.recv())
            ours.close()  # which ends it
            copy.join(_ENDING_S)
            if copy.is_alive():
                copy.kill()


def _serve(function: Callable[[Item], Any], calls: Any, others: Sequence[Any]) -> None:
    """Answer the calls of the process of which this one is a copy, until it ends."""
    executors.in_copy = True
    for other in others:
        other.close()
    signal.set_wakeup_fd(-1)  # which is that of the other process
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other process says when to end
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    end_with_parent()
    with watched(None), suppress(KeyboardInterrupt, Exception):  # the other process does what has no result
        while True:
            item = calls.recv()
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
            result = function(item)
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
            calls.send(result)
