"""Who runs the work: nothing else in the project knows.

A map takes a function and a sequence of items and gives the results in the order of the items, whoever
computed them. Functions and items must survive pickling, so that the same call may run on a cluster.
"""

import os
from collections import deque
from collections.abc import Callable, Generator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from uavseg.errors import ParameterError

if TYPE_CHECKING:
    from concurrent.futures import Future

Item = TypeVar("Item")
Result = TypeVar("Result")
Progress = Callable[[int, int], None]
"""Told how many items are done, and of how many."""


class Map(Protocol):
    """Applies a function to each item; results come in the order of the items.

    Nobody works on once what it gives is closed.
    """

    def __call__(
        self,
        function: Callable[[Item], Result],
        items: Sequence[Item],
        progress: Progress | None = None,
    ) -> Generator[Result, None, None]: ...


def serial(
    function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
) -> Generator[Result, None, None]:
    """One item after the other, here and now.

    Examples
    --------
    >>> list(serial(abs, [-1, 2, -3]))
    [1, 2, 3]
    """
    for done, item in enumerate(items, start=1):
        yield function(item)
        if progress is not None:
            progress(done, len(items))


def threads(count: int | None = None) -> Map:
    """A map over `count` threads; all cores that the process may use if none is given.

    Only a few results wait at any time, so memory does not grow with the number of items.

    Raises
    ------
    ParameterError
        If `count` is below 1.
    """
    count = usable_cores() if count is None else count
    if count < 1:
        raise ParameterError(f"the number of threads is at least 1, not {count}")
    if count == 1:
        return serial

    def run(
        function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        from concurrent.futures import ThreadPoolExecutor  # 13 ms that one thread does not need

        with ThreadPoolExecutor(count) as pool:

            def begin(item: Item) -> "Future[Result]":
                return pool.submit(function, item)

            yield from in_order(begin, lambda future: future.result(), lambda: 2 * count, items, progress)

    return run


def in_order(
    begin: Callable[[Item], Any],
    result: Callable[[Any], Result],
    room: Callable[[], int],
    items: Sequence[Item],
    progress: Progress | None,
) -> Generator[Result, None, None]:
    """Results in the order of the items; what waits is cancelled when nobody wants more.

    Parameters
    ----------
    begin : callable
        Begins an item, gives its future.
    result : callable
        Waits for a future's result.
    room : callable
        How many may be begun and not yet taken.
    items : sequence
    progress : callable or None
    """
    waiting: deque[Any] = deque()
    done = 0
    try:
        for item in items:
            waiting.append(begin(item))
            while len(waiting) >= room():
                yield result(waiting.popleft())
                done += 1
                if progress is not None:
                    progress(done, len(items))
        while waiting:
            yield result(waiting.popleft())
            done += 1
            if progress is not None:
                progress(done, len(items))
    finally:
        for future in waiting:
            future.cancel()


def usable_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def split_progress(progress: Progress, count: int) -> list[Progress]:
    """One progress for each of several stages, which together make the given one."""

    def stage(k: int, done: int, total: int) -> None:
        progress(k * total + done, count * total)

    return [partial(stage, k) for k in range(count)]
