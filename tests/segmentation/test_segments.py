"""A range takes in both its ends, of leaves and of pixels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.errors import IntensityRangeError
from uavseg.segmentation.blockmap import BlockMap, leaves
from uavseg.segmentation.segments import IntensityRange, in_range

V = np.arange(65536) / 65535
ends = st.one_of(
    st.floats(0, 1),
    st.integers(0, 65535).map(lambda g: g / 65535),
    st.integers(0, 1000).map(lambda k: k / 1000),
)


def steps_of_grey(*greys: int) -> BlockMap:
    """Blocks of 64 side by side, each of one grey."""
    blocks = BlockMap.empty((64, 64 * len(greys)))
    blocks.counts[:] = 64
    blocks.sums[:] = np.repeat(np.array(greys, np.uint32) * 64, 8)
    return blocks


@pytest.mark.parametrize("pair", [(0.5, 0.5), (0.6, 0.5), (-0.1, 0.5), (0.5, 1.01), (np.nan, 1), (0, np.nan)])
def test_a_range_that_is_none_is_refused_with_what_it_should_be(pair: tuple[float, float]) -> None:
    with pytest.raises(IntensityRangeError, match=r"0 <= low < high <= 1, not"):
        IntensityRange(*pair)


@settings(deadline=None, max_examples=100)
@given(ends, ends)
def test_greys_of_a_range_are_those_whose_v_lies_in_it(first: float, second: float) -> None:
    low, high = sorted((first, second))
    if low == high:
        return
    inside = np.flatnonzero((low <= V) & (high >= V))
    lowest, highest = IntensityRange(low, high).greys
    assert np.array_equal(inside, np.arange(lowest, highest + 1))


def test_the_full_range_is_all_greys() -> None:
    assert IntensityRange(0, 1).greys == (0, 65535)


def test_a_range_between_two_greys_has_none() -> None:
    lowest, highest = IntensityRange(10.2 / 65535, 10.8 / 65535).greys
    assert lowest > highest


def test_leaves_on_either_end_are_in_the_range() -> None:
    blocks = steps_of_grey(13106, 13107, 20000, 26214, 26215)
    inside = in_range(blocks, IntensityRange(0.2, 0.4), np.inf, np.inf)
    assert inside[0, ::8].tolist() == [0, 1, 1, 1, 0]
    assert inside.shape == (8, 40) and inside.dtype == np.uint8


def test_a_leaf_without_valid_pixels_is_in_no_range() -> None:
    blocks = steps_of_grey(0, 0)
    blocks.counts[:, 8:] = 0
    assert in_range(blocks, IntensityRange(0, 1), np.inf, np.inf)[0, ::8].tolist() == [1, 0]


def test_an_invalid_cell_goes_with_its_leaf() -> None:
    blocks = steps_of_grey(30000)
    blocks.counts[3, 3] = blocks.sums[3, 3] = 0
    assert in_range(blocks, IntensityRange(0.3, 0.6), np.inf, np.inf).all()


def test_a_tall_map_is_answered_as_its_leaves_are() -> None:
    rng = np.random.default_rng(0)
    blocks = BlockMap.empty((64 * 130 - 5, 100))  # more rows of blocks than are looked at together
    blocks.counts[:] = rng.integers(0, 65, blocks.counts.shape)
    blocks.sums[:] = rng.random(blocks.counts.shape) * 65535 * blocks.counts
    blocks.ratios[:] = rng.random(blocks.ratios.shape) * 2
    _, mean = leaves(blocks, 1.2, 0.4)
    assert np.array_equal(in_range(blocks, IntensityRange(0.3, 0.6), 1.2, 0.4), (mean >= 0.3) & (mean <= 0.6))
