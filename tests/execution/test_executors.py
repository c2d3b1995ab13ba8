"""Whoever runs the work: the same results in the same order, errors at once, and little waiting in memory."""

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, serial, threads, usable_cores

MAPS = [serial, threads(2), threads(5)]
maps = pytest.mark.parametrize("run", MAPS, ids=["serial", "2 threads", "5 threads"])
PATIENCE_S = 20  # how long a test waits for what must happen


class Items(Sequence[int]):
    """0, 1, 2, ...: tells which were asked for."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.asked: list[int] = []

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, k: Any) -> Any:
        if not 0 <= k < self.count:
            raise IndexError
        self.asked.append(k)
        return k


@settings(deadline=None, max_examples=30)
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
    told: list[Any] = []
    assert list(run(abs, [], lambda *done: told.append(done))) == [] == told


@maps
def test_an_error_comes_through_where_its_result_would_be(run: Map) -> None:
    got: list[float] = []
    with pytest.raises(ZeroDivisionError):
        for result in run(lambda item: 12 / item, [1, 2, 3, 0, 4]):
            got.append(result)
    assert got == [12, 6, 4]


@maps
def test_after_an_error_no_more_is_begun(run: Map) -> None:
    begun: list[int] = []

    def work(item: int) -> int:
        begun.append(item)
        if item == 2:
            raise ValueError("two")
        return item

    with pytest.raises(ValueError, match="two"):
        list(run(work, range(1000)))
    assert max(begun) < 2 + 2 * 5 + 1
    settled = len(begun)
    time.sleep(0.02)
    assert len(begun) == settled


@maps
def test_a_consumer_that_stops_stops_the_work(run: Map) -> None:
    begun: list[int] = []
    results = run(lambda item: begun.append(item) or item, range(1000))
    assert [next(results), next(results)] == [0, 1]
    results.close()  # type: ignore[attr-defined]
    assert len(begun) <= 2 + 2 * 5
    settled = len(begun)
    time.sleep(0.02)
    assert len(begun) == settled


def test_what_waits_is_never_begun_once_the_consumer_stops() -> None:
    begun: list[int] = []
    busy, release = threading.Barrier(3), threading.Event()

    def work(item: int) -> int:
        begun.append(item)
        if item in (1, 2):
            busy.wait(PATIENCE_S)
            release.wait(PATIENCE_S)
        return item

    results = threads(2)(work, range(10))
    assert next(results) == 0
    busy.wait(PATIENCE_S)  # both threads are at work, and item 3 waits
    threading.Timer(0.5, release.set).start()
    results.close()  # type: ignore[attr-defined]
    assert sorted(begun) == [0, 1, 2]


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_only_a_few_results_wait(count: int) -> None:
    lock, waiting, most, items = threading.Lock(), 0, 0, Items(300)

    def work(item: int) -> int:
        nonlocal waiting, most
        with lock:
            waiting += 1
            most = max(most, waiting)
        return item

    for k, _ in enumerate(threads(count)(work, items)):
        assert len(items.asked) <= k + 1 + 2 * count  # items too are made when they are needed
        with lock:
            waiting -= 1
    assert most <= 2 * count


@maps
def test_progress_counts_every_item(run: Map) -> None:
    told: list[tuple[int, int]] = []
    list(run(abs, range(23), lambda done, total: told.append((done, total))))
    assert told == [(k, 23) for k in range(1, 24)]


@maps
def test_progress_is_told_by_the_caller_s_own_thread(run: Map) -> None:
    names = set()
    list(run(abs, range(9), lambda done, total: names.add(threading.get_ident())))
    assert names == {threading.get_ident()}


@pytest.mark.parametrize("count", [0, -1])
def test_fewer_threads_than_one_are_refused(count: int) -> None:
    with pytest.raises(ParameterError, match=f"at least 1, not {count}"):
        threads(count)


def test_one_thread_is_the_caller_s_own() -> None:
    assert threads(1) is serial
    assert set(threads(1)(lambda item: threading.get_ident(), range(3))) == {threading.get_ident()}


def test_without_a_number_there_are_as_many_as_cores() -> None:
    assert usable_cores() >= 1
    assert list(threads()(abs, [-1, -2])) == [1, 2]


def test_no_thread_is_left_behind() -> None:
    before = threading.active_count()
    list(threads(4)(abs, range(50)))
    failing: Callable[[int], float] = lambda item: 1 / item  # noqa: E731
    with pytest.raises(ZeroDivisionError):
        list(threads(4)(failing, range(50)))
    assert threading.active_count() == before
