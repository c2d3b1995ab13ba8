"""Cells near a bound of the range are mixed; those far from it are not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import mixed_cells


def blocks_of(v: NDArray[np.float64]) -> BlockMap:
    """A block map of these means of cells."""
    blocks = BlockMap.empty((8 * v.shape[0], 8 * v.shape[1]))
    blocks.sums[: v.shape[0], : v.shape[1]] = np.rint(v * 65535 * 64)
    blocks.counts[: v.shape[0], : v.shape[1]] = 64
    return blocks


def test_cells_far_from_the_ends_of_a_range_are_not_mixed() -> None:
    v = np.full((8, 16), 0.3)
    v[:, 8:] = 0.7
    blocks = blocks_of(v)
    inside = np.zeros((8, 16), np.uint8)
    inside[:, 8:] = 1
    found = mixed_cells(blocks, inside, 0.5, 1.0)
    assert found[:, 7:9].all() and not found[:, :7].any() and not found[:, 9:].any()


def test_a_thin_road_makes_the_cells_that_it_crosses_and_those_around_mixed() -> None:
    v = np.full((8, 8), 0.42)
    v[:, 4] += 0.26 * 3 / 8  # three pixels of eight
    found = mixed_cells(blocks_of(v), np.zeros((8, 8), np.uint8), 0.55, 1.0)
    assert found[:, 3:6].all() and not found[:, :3].any() and not found[:, 6:].any()


def test_a_cell_on_another_side_than_its_leaf_is_mixed_and_one_without_pixels_is_not() -> None:
    blocks = blocks_of(np.full((8, 8), 0.3))
    blocks.counts[:, :4] = blocks.sums[:, :4] = 0
    found = mixed_cells(blocks, np.ones((8, 8), np.uint8), 0.5, 1.0)
    assert found[:, 4:].all() and not found[:, :4].any()


@pytest.mark.parametrize("low, high", [(0.0, 0.5), (0.5, 1.0)])
def test_nothing_lies_beyond_the_ends_of_v(low: float, high: float) -> None:
    blocks = blocks_of(np.full((8, 8), low if low == 0 else high))
    assert not mixed_cells(blocks, np.ones((8, 8), np.uint8), low, high).any()


@settings(max_examples=40)
@given(st.integers(0, 100_000))
def test_a_turned_map_has_turned_mixed_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    v = rng.choice([0.3, 0.45, 0.7], (8, 8)) + rng.normal(0, 0.01, (8, 8))
    inside = rng.integers(0, 2, (8, 8)).astype(np.uint8)
    found = mixed_cells(blocks_of(v), inside, 0.4, 0.6)
    turned = mixed_cells(blocks_of(v.T), np.ascontiguousarray(inside.T), 0.4, 0.6)
    assert np.array_equal(turned, found.T)


@settings(max_examples=40)
@given(st.integers(0, 100_000))
def test_a_cell_that_is_not_mixed_agrees_with_its_neighbours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    v = rng.choice([0.3, 0.7], (8, 8), p=[0.9, 0.1]) + rng.normal(0, 0.01, (8, 8))
    inside = (v > 0.5).astype(np.uint8)
    found = mixed_cells(blocks_of(v), inside, 0.5, 1.0)
    for row, col in np.argwhere(found == 0):
        around = np.s_[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
        assert (inside[around] == inside[row, col]).all()
