"""Leaves are in a range with both its ends; a mean on an edge of states or levels belongs below it."""

import numpy as np
import pytest

from uavseg.segmentation.blocks.block_map import BlockMap, find_leaves
from uavseg.segmentation.blocks.leaves import cell_classes, cell_intervals, cells_in_range, cells_to_pixels
from uavseg.segmentation.params.segment import (
    DivisionParams,
    IntensityRange,
    Levels,
    StateLimits,
    partition_of_levels,
)

UNDIVIDED = DivisionParams(np.inf, np.inf)


def steps_of_grey(*greys: int) -> BlockMap:
    """Blocks of 64 side by side, each of one grey."""
    blocks = BlockMap.empty((64, 64 * len(greys)))
    blocks.counts[:] = 64
    blocks.sums[:] = np.repeat(np.array(greys, np.uint32) * 64, 8)
    return blocks


def test_leaves_on_either_end_are_in_the_range() -> None:
    blocks = steps_of_grey(13106, 13107, 20000, 26214, 26215)
    inside = cells_in_range(blocks, IntensityRange(0.2, 0.4), UNDIVIDED)
    assert inside[0, ::8].tolist() == [0, 1, 1, 1, 0]
    assert inside.shape == (8, 40) and inside.dtype == np.uint8


def test_a_leaf_without_valid_pixels_is_in_no_range() -> None:
    blocks = steps_of_grey(0, 0)
    blocks.counts[:, 8:] = 0
    assert cells_in_range(blocks, IntensityRange(0, 1), UNDIVIDED)[0, ::8].tolist() == [1, 0]


def test_an_invalid_cell_belongs_to_its_leaf() -> None:
    blocks = steps_of_grey(30000)
    blocks.counts[3, 3] = blocks.sums[3, 3] = 0
    assert cells_in_range(blocks, IntensityRange(0.3, 0.6), UNDIVIDED).all()


def test_strips_of_a_tall_map_agree_with_its_leaves() -> None:
    rng = np.random.default_rng(0)
    blocks = BlockMap.empty((64 * 130 - 5, 100))  # more rows of blocks than a strip has
    blocks.counts[:] = rng.integers(0, 65, blocks.counts.shape)
    blocks.sums[:] = rng.random(blocks.counts.shape) * 65535 * blocks.counts
    blocks.ratios[:] = rng.random(blocks.ratios.shape) * 2
    _, mean = find_leaves(blocks, DivisionParams(1.2, 0.4))
    assert np.array_equal(
        cells_in_range(blocks, IntensityRange(0.3, 0.6), DivisionParams(1.2, 0.4)),
        (mean >= 0.3) & (mean <= 0.6),
    )


# States and levels


def test_a_mean_on_an_edge_belongs_below_it() -> None:
    blocks = steps_of_grey(0, 13107, 13108, 26214, 52429, 65535)
    assert cell_classes(blocks, partition_of_levels(Levels(0.2)), UNDIVIDED)[0, ::8].tolist() == [
        1,
        1,
        2,
        2,
        5,
        5,
    ]
    limits = StateLimits(13107 / 65535, 26214 / 65535)
    assert cell_intervals(blocks, limits.edges, UNDIVIDED)[0, ::8].tolist() == [1, 1, 2, 2, 3, 3]
    assert limits.table[[0, 13107, 13108, 26214, 26215, 65535]].tolist() == [1, 1, 2, 2, 3, 3]


def test_a_leaf_without_valid_pixels_has_no_state_and_no_level() -> None:
    blocks = BlockMap.empty((64, 64))
    assert not cell_intervals(blocks, StateLimits().edges, DivisionParams(1.2, 0.05)).any()
    assert not cell_classes(blocks, partition_of_levels(Levels(0.1)), DivisionParams(1.2, 0.05)).any()


def test_many_levels_fit_the_dtype() -> None:
    blocks = steps_of_grey(0, 65535)
    found = cell_classes(blocks, partition_of_levels(Levels(0.001)), UNDIVIDED)
    assert found.dtype == np.uint32 and found[0, ::8].tolist() == [1, 1000]
    assert cell_classes(blocks, partition_of_levels(Levels(0.004)), UNDIVIDED).dtype == np.uint8


@pytest.mark.parametrize("dtype", [np.uint8, np.uint32])
def test_cells_are_upsampled_to_their_valid_pixels(dtype: type) -> None:
    rng = np.random.default_rng(2)
    cells = rng.integers(0, 256, (3, 5)).astype(dtype)
    valid = rng.integers(0, 2, (24, 40)).astype(np.uint8)
    found = cells_to_pixels(cells, valid)
    assert found.dtype == dtype and np.array_equal(found, cells.repeat(8, 0).repeat(8, 1) * valid)
