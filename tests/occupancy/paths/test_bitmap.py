"""Bitmaps: every cell in its bit, transposition, dead-end filling."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from uavseg.occupancy.paths.bitmap import fill_dead_ends, pack_mask, transpose_bitmap

MASKS = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=140))
SMALL = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12))


def unpack(bits: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The mask of a bitmap, one bit at a time."""
    cols = np.arange(1, shape[1] + 1)
    words = bits[1:-1][:, cols // 64]
    return (words >> (cols % 64).astype(np.uint64)) & np.uint64(1) > 0


@pytest.mark.slow
@given(MASKS)
def test_a_packed_mask_is_unpacked_equal_and_has_an_impassable_frame(mask: np.ndarray) -> None:
    bits = pack_mask(mask)
    assert bits.shape == (mask.shape[0] + 2, -(-(mask.shape[1] + 2) // 64))
    assert np.array_equal(unpack(bits, mask.shape), mask)
    assert sum(int(word).bit_count() for word in bits.ravel()) == mask.sum()  # nothing outside of the mask


@given(MASKS)
def test_a_transposed_bitmap_is_that_of_the_transposed_mask(mask: np.ndarray) -> None:
    turned = transpose_bitmap(pack_mask(mask), mask.shape[1])
    assert np.array_equal(turned, pack_mask(np.ascontiguousarray(mask.T)))


def without_dead_ends(mask: np.ndarray, kept: set[tuple[int, int]]) -> np.ndarray:
    """Remove cells with at most one edge neighbour until none is left, one after the other."""
    found = np.pad(mask, 1)
    while True:
        neighbours = found[:-2, 1:-1].astype(int) + found[2:, 1:-1] + found[1:-1, :-2] + found[1:-1, 2:]
        dead = found[1:-1, 1:-1] & (neighbours <= 1)
        for cell in kept:
            dead[cell] = False
        if not dead.any():
            return found[1:-1, 1:-1]
        found[1:-1, 1:-1] &= ~dead


@pytest.mark.slow
@given(SMALL, st.data())
@settings(max_examples=300)
def test_dead_ends_are_filled_to_the_next_fork_and_nothing_else(
    mask: np.ndarray, data: st.DataObject
) -> None:
    cells = st.tuples(*(st.integers(0, length - 1) for length in mask.shape))
    start, goal = data.draw(cells), data.draw(cells)
    bits = pack_mask(mask)
    fill_dead_ends(bits, (start[0] + 1, start[1] + 1), (goal[0] + 1, goal[1] + 1))
    assert np.array_equal(unpack(bits, mask.shape), without_dead_ends(mask, {start, goal}))
