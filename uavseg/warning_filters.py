"""Filters of warnings, which belong to the whole process: one thread at a time changes them."""

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_lock = threading.RLock()


@contextmanager
def changing_filters(record: bool = False) -> Iterator[list[warnings.WarningMessage]]:
    """Catch warnings as `warnings.catch_warnings`, while no other thread is in such a context.

    Two threads that leave `catch_warnings` in the order in which they entered it leave filters of the second
    one behind, and one records what the other ignores. With `record`, warnings are collected in the list that
    is yielded.
    """
    with _lock:
        caught: Any
        with warnings.catch_warnings(record=record) as caught:
            yield caught if record else []
