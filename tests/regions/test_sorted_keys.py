"""Sorted keys: duplicates removed, and binary search."""

import bisect

import numpy as np
from hypothesis import given, strategies as st

from uavseg.regions.smooth.arcs import lower_bound, sorted_unique

keys = st.lists(st.integers(-5, 5) | st.integers(-(2**62), 2**62))


@given(keys)
def test_keys_are_sorted_and_distinct(some: list[int]) -> None:
    assert sorted_unique(np.array(some, np.int64)).tolist() == sorted(set(some))


@given(keys, st.integers(-6, 6))
def test_the_lower_bound_is_that_of_bisect(some: list[int], key: int) -> None:
    known = sorted_unique(np.array(some, np.int64))
    assert lower_bound(known, key) == bisect.bisect_left(known.tolist(), key)
