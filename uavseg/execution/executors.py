"""Executors: the only module that knows about threads; lazy sequences of items; a log of phases.

An executor (`Map`) takes a function and a sequence of items, and yields the results in the order of the
items. Functions and items must be picklable, so that the same call can run on a cluster.
"""

import logging
import os
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache, partial
from operator import index
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, overload

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.output.staging import interrupts_held
from uavseg.warning_filters import changing_filters

if TYPE_CHECKING:
    from concurrent.futures import Future

logger = logging.getLogger("uavseg.jobs")

Watcher = Callable[[str | None, int, int], object]
"""Called with a phase that begins, None where it ends or "" between; and its steps: those done, and all."""
_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)
_ENDING_S = 5.0  # time for a copy to leave nothing behind


def decided(text: str, *values: object) -> None:
    """Log a decision of a job."""
    logger.info(text, *values)


@contextmanager
def phase(name: str) -> Iterator[None]:
    """Log how long a phase takes, without the time in which kernels are compiled."""
    begun = working_seconds()
    watcher = _watcher.get()
    if watcher is not None:
        watcher(name, 0, 0)
    yield
    if watcher is not None:
        watcher(None, 0, 0)
    logger.info("phase %s: %.2f s", name, working_seconds() - begun)


@contextmanager
def watched(watcher: Watcher | None) -> Iterator[None]:
    """Call a function, or none, as phases begin, end and go on."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def steps_done(done: int, total: int) -> None:
    """Report to the watcher that so many steps of a phase are done."""
    watcher = _watcher.get()
    if watcher is not None:
        watcher("", done, total)


def working_seconds() -> float:
    """Return the seconds of a clock that stands still while kernels are compiled."""
    from uavseg._jit import messages

    return time.perf_counter() - messages.compiling_seconds()


Item = TypeVar("Item")
Element = TypeVar("Element", covariant=True)
Result = TypeVar("Result")
Progress = Callable[[int, int], None]
"""Called with the number of items done, and the number of items."""


class Map(Protocol):
    """An executor: results of a function for each item, in order; closing the generator stops the work."""

    def __call__(
        self, function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]: ...


def serial(
    function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
) -> Generator[Result, None, None]:
    """Run one item after the other in the calling thread.

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
    """Return an executor that runs `count` threads, by default one for each core that the process may use.

    At most 2 x `count` items are started and not yet consumed, so memory does not grow with their number.
    """
    count = usable_cores() if count is None else count
    if count < 1:
        raise ParameterError(f"the number of threads is at least 1, not {count}")
    if count == 1:
        return serial

    def run(
        function: Callable[[Item], Result], items: Sequence[Item], progress: Progress | None = None
    ) -> Generator[Result, None, None]:
        if len(items) == 1:  # where two threads share the interpreter's lock, one waits 5 ms for the other
            yield from serial(function, items, progress)
            return
        from concurrent.futures import ThreadPoolExecutor  # takes 13 ms, which one thread saves

        with ThreadPoolExecutor(count) as pool:

            def submit(item: Item) -> "Future[Result]":
                try:
                    return pool.submit(function, item)
                except RuntimeError as error:  # the system starts no more threads
                    raise MemoryError(str(error)) from error

            yield from in_order(submit, lambda future: future.result(), lambda: 2 * count, items, progress)

    return run


def in_order(
    submit: Callable[[Item], Any],
    result: Callable[[Any], Result],
    capacity: Callable[[], int],
    items: Sequence[Item],
    progress: Progress | None,
) -> Generator[Result, None, None]:
    """Yield results of futures in the order of the items; closing the generator cancels pending ones.

    `submit` starts an item and returns its future, `result` waits for a future and returns its result, and
    `capacity` is how many items may be started and not yet consumed.
    """
    pending: deque[Any] = deque()
    done = 0
    try:
        for started, item in enumerate(items, start=1):
            pending.append(submit(item))
            while pending and (started == len(items) or len(pending) >= capacity()):
                yield result(pending.popleft())
                done += 1
                if progress is not None:
                    progress(done, len(items))
    finally:
        for future in pending:
            future.cancel()


@dataclass(frozen=True, slots=True)
class LazySequence(Sequence[Element], Generic[Element]):
    """A sequence of which each item is made anew whenever it is indexed, so that many are never held at once.

    It pickles, and has a fingerprint, if `make_item` does: a function of a module or a `partial` of one.

    Examples
    --------
    >>> squares = LazySequence(5, lambda k: k * k)
    >>> squares[-1], list(squares[1:4])
    (16, [1, 4, 9])
    """

    length: int
    make_item: Callable[[int], Element]  # from a position 0..length - 1 to the item there

    def __len__(self) -> int:
        return self.length

    @overload
    def __getitem__(self, which: int) -> Element: ...

    @overload
    def __getitem__(self, which: slice) -> "LazySequence[Element]": ...

    def __getitem__(self, which: int | slice) -> "Element | LazySequence[Element]":
        positions = range(self.length)
        if isinstance(which, slice):
            return lazy_selection(self, positions[which])
        return self.make_item(positions[index(which)])


def lazy_selection(items: Sequence[Element], positions: Sequence[int]) -> LazySequence[Element]:
    """Select positions of a sequence; each item is taken when it is indexed."""
    return LazySequence(len(positions), partial(_selected, items, positions))


def _selected(items: Sequence[Element], positions: Sequence[int], k: int) -> Element:
    return items[positions[k]]


OWN_THREAD = "uavseg-"
"""Start of the names of threads that hold no lock which a copy of the process needs; see `can_fork`."""


in_copy = False  # set where this process is a copy of another, see `fork_each`


def threads_of_gdal(wanted: int | str) -> str:
    """Return how many threads GDAL may use for a file: 1 in a copy, as the threads of its pool are gone."""
    return "1" if in_copy else str(wanted)


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def split_progress(progress: Progress, count: int) -> list[Progress]:
    """Make a progress callback for each of `count` stages, which drive the given one in equal shares."""

    def report(k: int, done: int, total: int) -> None:
        progress(k * total + done, count * total)

    return [partial(report, k) for k in range(count)]


def keep_heap() -> None:
    """Keep freed memory for the next tile, where the C library can (glibc); for a process of our own.

    Else the arrays of each tile, and of each thread, are pages that the system takes back and clears again,
    which takes a twelfth of the CPU time of `uavseg extract`. Arrays of over 32 MB are returned at once, and
    `trim_heap` returns the rest.
    """
    c_library = _c_library()
    if c_library is not None:
        for parameter, value in _HEAP:
            c_library.mallopt(parameter, value)


def trim_heap() -> None:
    """Return freed heap memory to the operating system, where the C library can (glibc).

    Called between phases: the arrays of one phase differ in size from those of the next, so the memory freed
    by the first would otherwise stay with the process.
    """
    c_library = _c_library()
    if c_library is not None:
        c_library.malloc_trim(0)


_HEAP = (
    (-8, 1),  # M_ARENA_MAX: threads share one heap
    (-1, 256 << 20),  # M_TRIM_THRESHOLD
    (-3, 32 << 20),  # M_MMAP_THRESHOLD
)


@cache
def _c_library() -> Any:
    """Return the C library, if it is glibc."""
    if sys.platform != "linux":
        return None
    import ctypes

    library = ctypes.CDLL(None)
    return library if hasattr(library, "malloc_trim") else None


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
    global in_copy
    in_copy = True
    for other in others:
        other.close()
    signal.set_wakeup_fd(-1)  # which is that of the other process
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other process says when to end
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    c_library = _c_library()
    if c_library is not None:  # on Linux, end by SIGTERM when the other process ends
        c_library.prctl(1, 15)  # PR_SET_PDEATHSIG
    with watched(None), suppress(KeyboardInterrupt, Exception):  # the other process does what has no result
        while True:
            item = calls.recv()
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
            result = function(item)
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
            calls.send(result)
