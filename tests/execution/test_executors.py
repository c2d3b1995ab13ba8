"""Executors: the same results in the same order, errors at once, and few pending results in memory."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import ParameterError
from uavseg.execution import executors
from uavseg.execution.executors import Map, serial, threads, usable_cores

MAPS = [serial, threads(2), threads(5)]
maps = pytest.mark.parametrize("run", MAPS, ids=["serial", "2 threads", "5 threads"])
PATIENCE_S = 20  # how long a test waits for an event


class Items(Sequence[int]):
    """0, 1, 2, ...: records which were indexed."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.requested: list[int] = []

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, k: Any) -> Any:
        if not 0 <= k < self.count:
            raise IndexError
        self.requested.append(k)
        return k


@pytest.mark.slow
@settings(max_examples=30)
@given(st.lists(st.integers(), max_size=30), st.integers(1, 4))
def test_results_are_those_of_a_loop(items: list[int], count: int) -> None:
    assert list(threads(count)(str, items)) == list(serial(str, items)) == [str(item) for item in items]


def test_order_is_kept_where_the_first_is_slowest() -> None:
    others_done = threading.Event()

    def work(item: int) -> int:
        if item == 0:
            assert others_done.wait(PATIENCE_S)
        if item == 3:
            others_done.set()
        return item

    assert list(threads(4)(work, range(20))) == list(range(20))


def test_threads_run_at_the_same_time() -> None:
    meeting = threading.Barrier(3)
    assert sorted(threads(3)(lambda item: meeting.wait(PATIENCE_S), range(3))) == [0, 1, 2]


@maps
def test_no_items_give_no_results(run: Map) -> None:
    reported: list[Any] = []
    assert list(run(abs, [], lambda *done: reported.append(done))) == [] == reported


@maps
def test_an_error_is_raised_where_its_result_would_be(run: Map) -> None:
    results_before: list[float] = []
    with pytest.raises(ZeroDivisionError):
        for result in run(lambda item: 12 / item, [1, 2, 3, 0, 4]):
            results_before.append(result)
    assert results_before == [12, 6, 4]


@maps
def test_after_an_error_no_more_items_are_started(run: Map) -> None:
    started: list[int] = []

    def work(item: int) -> int:
        started.append(item)
        if item == 2:
            raise ValueError("two")
        return item

    with pytest.raises(ValueError, match="two"):
        list(run(work, range(1000)))
    assert max(started) < 2 + 2 * 5 + 1
    settled = len(started)
    time.sleep(0.02)
    assert len(started) == settled


@maps
def test_a_consumer_that_stops_stops_the_work(run: Map) -> None:
    started: list[int] = []
    results = run(lambda item: started.append(item) or item, range(1000))
    assert [next(results), next(results)] == [0, 1]
    results.close()  # type: ignore[attr-defined]
    assert len(started) <= 2 + 2 * 5
    settled = len(started)
    time.sleep(0.02)
    assert len(started) == settled


@pytest.mark.slow
def test_pending_items_are_never_started_once_the_consumer_stops() -> None:
    started: list[int] = []
    busy, release = threading.Barrier(3), threading.Event()

    def work(item: int) -> int:
        started.append(item)
        if item in (1, 2):
            busy.wait(PATIENCE_S)
            release.wait(PATIENCE_S)
        return item

    results = threads(2)(work, range(10))
    assert next(results) == 0
    busy.wait(PATIENCE_S)  # both threads are busy, and item 3 is pending
    threading.Timer(0.5, release.set).start()
    results.close()  # type: ignore[attr-defined]
    assert sorted(started) == [0, 1, 2]


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_only_a_few_results_are_pending(count: int) -> None:
    lock, pending, maximum, items = threading.Lock(), 0, 0, Items(300)

    def work(item: int) -> int:
        nonlocal pending, maximum
        with lock:
            pending += 1
            maximum = max(maximum, pending)
        return item

    for k, _ in enumerate(threads(count)(work, items)):
        assert len(items.requested) <= k + 1 + 2 * count  # items are made lazily too
        with lock:
            pending -= 1
    assert maximum <= 2 * count


@maps
def test_progress_counts_every_item(run: Map) -> None:
    reported: list[tuple[int, int]] = []
    list(run(abs, range(23), lambda done, total: reported.append((done, total))))
    assert reported == [(k, 23) for k in range(1, 24)]


@maps
def test_progress_is_reported_in_the_calling_thread(run: Map) -> None:
    names = set()
    list(run(abs, range(9), lambda done, total: names.add(threading.get_ident())))
    assert names == {threading.get_ident()}


@pytest.mark.parametrize("count", [0, -1])
def test_fewer_threads_than_one_are_refused(count: int) -> None:
    with pytest.raises(ParameterError, match=f"at least 1, not {count}"):
        threads(count)


def test_one_thread_is_the_calling_thread() -> None:
    assert threads(1) is serial
    assert set(threads(1)(lambda item: threading.get_ident(), range(3))) == {threading.get_ident()}


def test_by_default_there_are_as_many_threads_as_cores() -> None:
    assert usable_cores() >= 1
    assert list(threads()(abs, [-1, -2])) == [1, 2]


def test_no_thread_is_left_running() -> None:
    before = threading.active_count()
    list(threads(4)(abs, range(50)))
    failing: Callable[[int], float] = lambda item: 1 / item  # noqa: E731
    with pytest.raises(ZeroDivisionError):
        list(threads(4)(failing, range(50)))
    assert threading.active_count() == before


def test_threads_that_cannot_be_started_are_too_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    with pytest.raises(MemoryError, match="can't start new thread"):
        list(threads(2)(abs, [1, 2, 3]))


FAULTS = """
import resource, threading
import numpy as np
from uavseg.execution import executors
if {keep}:
    executors.keep_heap()
def work():
    for size in (4 << 19, 5 << 19, 6 << 19):  # all less than what gets huge pages
        for _ in range(20):
            np.ones(size, np.uint8)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(2):
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(executors._c_library() is None, reason="only glibc has these parameters")
def test_a_heap_that_is_kept_has_its_pages_mapped_once() -> None:
    faults = {
        keep: int(subprocess.check_output([sys.executable, "-c", FAULTS.format(keep=keep)]))
        for keep in (False, True)
    }
    assert faults[True] < faults[False] / 2
    assert faults[True] < 2 * (3 << 20) / 4096
