"""Grey maps: cell sums follow the grey, and each change log has the changes since it was read."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.occupancy.mapping.pending import SELF, GreyMap

BITS = st.lists(st.integers(0, 511), min_size=6, max_size=6)


def changes(bits: list[int]) -> NDArray[np.uint16]:
    """Changes of 2 x 3 blocks."""
    return np.array(bits, np.uint16).reshape(2, 3)


@given(BITS)
def test_a_log_has_the_changed_blocks_and_those_that_the_bits_name(bits: list[int]) -> None:
    grey_map = GreyMap.empty((128, 150))
    log = grey_map.new_log()
    grey_map.changed[:] = changes(bits)
    grey_map.flush_changes()
    own, affected = log.pop()
    assert (own == (changes(bits) >> SELF & 1 > 0)).all()
    expected = np.zeros((2, 3), bool)
    for (row, col), own_bits in np.ndenumerate(changes(bits)):
        for k in range(9):
            r, c = row + k // 3 - 1, col + k % 3 - 1
            if own_bits >> k & 1 and 0 <= r < 2 and 0 <= c < 3:
                expected[r, c] = True
    assert (affected == expected).all()
    assert not any(blocks.any() for blocks in log.pop())


@given(BITS, BITS)
def test_logs_are_read_independently(first: list[int], second: list[int]) -> None:
    grey_map = GreyMap.empty((128, 150))
    early = grey_map.new_log()
    grey_map.changed[:] = changes(first)
    late = grey_map.new_log()  # after the first changes
    grey_map.changed[:] = changes(second)
    grey_map.flush_changes()
    assert (late.changed == changes(second)).all()
    assert (early.changed == (changes(first) | changes(second))).all()
    assert not grey_map.changed.any()


@settings(max_examples=30)
@given(st.integers(1, 150), st.integers(1, 150), st.integers(0, 2**32))
def test_sums_are_those_of_the_grey_in_the_map(rows: int, cols: int, seed: int) -> None:
    grey = np.random.default_rng(seed).integers(0, 65536, (rows, cols), np.uint16)
    grey_map = GreyMap.empty((rows, cols))
    grey_map.set_grey(grey)
    padded = np.zeros([8 * length for length in grey_map.sums.shape], np.int64)
    padded[:rows, :cols] = grey
    assert (grey_map.sums == padded.reshape(*_cells(padded)).sum(axis=(1, 3))).all()
    padded[:rows, :cols] = 1
    assert (grey_map.counts == padded.reshape(*_cells(padded)).sum(axis=(1, 3))).all()
    assert (grey_map.changed >> SELF & 1).all()


def _cells(image: NDArray[np.int64]) -> tuple[int, int, int, int]:
    return image.shape[0] // 8, 8, image.shape[1] // 8, 8
