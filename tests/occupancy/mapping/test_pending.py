"""Pending updates: offsets name each cell once, and the largest count leads to the minimum."""

import numpy as np
from hypothesis import given, strategies as st

from uavseg.occupancy.mapping.log_odds import MAX_LOG_ODDS, add_one_free
from uavseg.occupancy.mapping.pending import (
    MAX_FREE_COUNT,
    cell_at_offset,
    col_offset,
    empty_pending,
    row_offset,
)

SHAPES = st.tuples(st.integers(1, 200), st.integers(1, 200))


@given(SHAPES, st.data())
def test_an_offset_leads_back_to_its_cell(shape: tuple[int, int], data: st.DataObject) -> None:
    row, col = (data.draw(st.integers(0, length - 1)) for length in shape)
    offset = row_offset(row, shape[1]) + col_offset(col)
    assert cell_at_offset(offset, shape[1]) == row * shape[1] + col


@given(SHAPES, st.data())
def test_an_offset_is_that_of_the_array_of_blocks(shape: tuple[int, int], data: st.DataObject) -> None:
    row, col = (data.draw(st.integers(0, length - 1)) for length in shape)
    pending = empty_pending(shape)
    pending.reshape(-1)[row_offset(row, shape[1]) + col_offset(col)] = 1
    assert pending[row // 64, col // 64, row % 64 // 8, col % 64 // 8, row % 8, col % 8] == 1


@given(SHAPES)
def test_a_map_begins_without_updates_at_a_cache_line(shape: tuple[int, int]) -> None:
    pending = empty_pending(shape)
    assert not pending.any() and pending.ctypes.data % 64 == 0
    assert pending.shape == (-(-shape[0] // 64), -(-shape[1] // 64), 8, 8, 8, 8)


def test_the_largest_count_leads_from_any_log_odds_to_the_minimum_and_no_smaller_one_does() -> None:
    odds = np.float32(MAX_LOG_ODDS)
    for _ in range(MAX_FREE_COUNT):
        assert odds > -MAX_LOG_ODDS
        odds = add_one_free(odds)
    assert odds == -MAX_LOG_ODDS == add_one_free(odds)
