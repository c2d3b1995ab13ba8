"""Filters of warnings: one thread at a time."""

import threading
import warnings

import pytest

from uavseg.warning_filters import changing_filters


def test_a_second_thread_waits_for_the_first() -> None:
    order: list[str] = []
    begun = threading.Event()

    def other() -> None:
        begun.set()
        with changing_filters():
            order.append("other")

    thread = threading.Thread(target=other)
    with changing_filters():
        thread.start()
        begun.wait()
        thread.join(0.05)
        order.append("this")
    thread.join()
    assert order == ["this", "other"]


def test_warnings_are_recorded_and_filters_put_back() -> None:
    before = list(warnings.filters)
    with changing_filters(record=True) as caught, changing_filters():
        warnings.simplefilter("always")
        warnings.warn("known", stacklevel=1)
    assert [str(one.message) for one in caught] == ["known"]
    assert warnings.filters == before
    with pytest.warns(UserWarning, match="seen"), changing_filters() as nothing:
        warnings.warn("seen", stacklevel=1)
    assert nothing == []
