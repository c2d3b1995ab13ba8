"""A lazy sequence is a list whose items are made when they are asked for."""

import pickle
from functools import partial
from operator import add, mul

import pytest
from hypothesis import given, strategies as st

from uavseg.execution.checkpoint import fingerprint
from uavseg.execution.executors import LazySequence, lazy_selection

lengths = st.integers(0, 20)
ends = st.none() | st.integers(-25, 25)
slices = st.builds(slice, ends, ends, st.none() | st.integers(-4, 4).filter(bool))


def times(factor: int, k: int) -> int:
    return factor * k


@given(lengths)
def test_it_reads_like_a_list(length: int) -> None:
    lazy, plain = LazySequence(length, partial(mul, 3)), [3 * k for k in range(length)]
    assert list(lazy) == plain and len(lazy) == length
    assert list(reversed(lazy)) == plain[::-1]
    assert [lazy[k] for k in range(-length, length)] == plain + plain


@given(lengths, slices, slices)
def test_slices_are_those_of_a_list(length: int, first: slice, second: slice) -> None:
    lazy, plain = LazySequence(length, partial(add, 5)), list(range(5, 5 + length))
    assert list(lazy[first]) == plain[first]
    assert list(lazy[first][second]) == plain[first][second]


@given(lengths, st.integers())
def test_a_position_outside_is_an_index_error(length: int, k: int) -> None:
    if not -length <= k < length:
        with pytest.raises(IndexError):
            LazySequence(length, abs)[k]


def test_items_are_made_when_they_are_asked_for_and_at_no_other_time() -> None:
    made: list[int] = []

    def make(k: int) -> int:
        made.append(k)
        return k

    lazy = LazySequence(10**9, make)
    assert len(lazy) == 10**9 and len(lazy[5:]) == 10**9 - 5
    assert made == []
    assert lazy[7] == 7 and lazy[2:][3] == 5 and made == [7, 5]


@given(st.lists(st.integers(), min_size=1), st.data())
def test_a_selection_keeps_the_order_of_its_positions(items: list[int], data: st.DataObject) -> None:
    positions = data.draw(st.lists(st.integers(0, len(items) - 1)))
    assert list(lazy_selection(items, positions)) == [items[k] for k in positions]


def test_it_survives_pickling_and_keeps_its_fingerprint() -> None:
    lazy = LazySequence(6, partial(times, 3))
    again = pickle.loads(pickle.dumps(lazy))
    assert list(again) == list(lazy) == [0, 3, 6, 9, 12, 15]
    assert fingerprint(again) == fingerprint(lazy) == fingerprint(LazySequence(6, partial(times, 3)))


@pytest.mark.parametrize("other", [LazySequence(5, partial(times, 3)), LazySequence(6, partial(times, 4))])
def test_what_makes_other_items_has_another_fingerprint(other: LazySequence[int]) -> None:
    assert fingerprint(other) != fingerprint(LazySequence(6, partial(times, 3)))
