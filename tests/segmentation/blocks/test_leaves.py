"""A range takes in both its ends; a value on an edge of states or levels belongs below it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.segmentation.blocks.block_map import BlockMap, find_leaves
from uavseg.segmentation.blocks.leaves import cell_levels, cell_states, cells_in_range, cells_to_pixels
from uavseg.segmentation.intervals import IntensityRange, Levels, StateLimits
from uavseg.segmentation.params import DivisionParams

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
    with pytest.raises(IntensityRangeError, match=r"0 <= low < high <= 1, got"):
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
    inside = cells_in_range(blocks, IntensityRange(0.2, 0.4), DivisionParams(np.inf, np.inf))
    assert inside[0, ::8].tolist() == [0, 1, 1, 1, 0]
    assert inside.shape == (8, 40) and inside.dtype == np.uint8


def test_a_leaf_without_valid_pixels_is_in_no_range() -> None:
    blocks = steps_of_grey(0, 0)
    blocks.counts[:, 8:] = 0
    assert cells_in_range(blocks, IntensityRange(0, 1), DivisionParams(np.inf, np.inf))[0, ::8].tolist() == [
        1,
        0,
    ]


def test_an_invalid_cell_goes_with_its_leaf() -> None:
    blocks = steps_of_grey(30000)
    blocks.counts[3, 3] = blocks.sums[3, 3] = 0
    assert cells_in_range(blocks, IntensityRange(0.3, 0.6), DivisionParams(np.inf, np.inf)).all()


def test_a_tall_map_is_answered_as_its_leaves_are() -> None:
    rng = np.random.default_rng(0)
    blocks = BlockMap.empty((64 * 130 - 5, 100))  # more rows of blocks than are looked at together
    blocks.counts[:] = rng.integers(0, 65, blocks.counts.shape)
    blocks.sums[:] = rng.random(blocks.counts.shape) * 65535 * blocks.counts
    blocks.ratios[:] = rng.random(blocks.ratios.shape) * 2
    _, mean = find_leaves(blocks, DivisionParams(1.2, 0.4))
    assert np.array_equal(
        cells_in_range(blocks, IntensityRange(0.3, 0.6), DivisionParams(1.2, 0.4)),
        (mean >= 0.3) & (mean <= 0.6),
    )


# States and levels


@pytest.mark.parametrize(
    "pair", [(0.6, 0.4), (0.5, 0.5), (-0.1, 0.5), (0.4, 1.1), (np.nan, 0.6), (0.4, np.nan), (0.4, np.inf)]
)
def test_limits_upside_down_are_refused(pair: tuple[float, float]) -> None:
    with pytest.raises(ParameterError, match=r"0 <= free below < occupied above <= 1, got"):
        StateLimits(*pair)


@pytest.mark.parametrize("width", [0, -0.1, 1.01, np.nan, np.inf, 1e-6])
def test_a_width_that_is_none_is_refused(width: float) -> None:
    with pytest.raises(ParameterError, match=r"width"):
        Levels(width)


@settings(deadline=None, max_examples=100)
@given(st.one_of(st.floats(1 / 65535, 1), st.integers(1, 500).map(lambda k: 1 / k), st.just(0.1)))
def test_levels_cover_everything_once(width: float) -> None:
    levels = Levels(width)
    assert levels.bounds[0] == 0 and levels.bounds[-1] == 1 and len(levels.bounds) == levels.count + 1
    assert (np.diff(levels.bounds[:-1]) > 0).all() and (np.diff(levels.edges) <= width + 1e-11).all()
    assert levels.edges == tuple(round(k * width, 12) for k in range(1, levels.count))


def test_a_mean_on_an_edge_belongs_below_it() -> None:
    blocks = steps_of_grey(0, 13107, 13108, 26214, 52429, 65535)
    assert cell_levels(blocks, Levels(0.2), DivisionParams(np.inf, np.inf))[0, ::8].tolist() == [
        1,
        1,
        2,
        2,
        5,
        5,
    ]
    limits = StateLimits(13107 / 65535, 26214 / 65535)
    assert cell_states(blocks, limits, DivisionParams(np.inf, np.inf))[0, ::8].tolist() == [1, 1, 2, 2, 3, 3]
    assert limits.table[[0, 13107, 13108, 26214, 26215, 65535]].tolist() == [1, 1, 2, 2, 3, 3]


def test_one_half_of_eight_bits_is_unknown_either_way() -> None:
    assert StateLimits().of(np.array([126, 127, 128, 129]) / 255).tolist() == [1, 2, 2, 3]


def test_a_leaf_without_valid_pixels_has_no_state_and_no_level() -> None:
    blocks = BlockMap.empty((64, 64))
    assert not cell_states(blocks, StateLimits(), DivisionParams(1.2, 0.05)).any()
    assert not cell_levels(blocks, Levels(0.1), DivisionParams(1.2, 0.05)).any()


def test_many_levels_have_room() -> None:
    blocks = steps_of_grey(0, 65535)
    found = cell_levels(blocks, Levels(0.001), DivisionParams(np.inf, np.inf))
    assert found.dtype == np.uint32 and found[0, ::8].tolist() == [1, 1000]
    assert cell_levels(blocks, Levels(0.004), DivisionParams(np.inf, np.inf)).dtype == np.uint8


@pytest.mark.parametrize("dtype", [np.uint8, np.uint32])
def test_cells_are_spread_over_their_valid_pixels(dtype: type) -> None:
    rng = np.random.default_rng(2)
    cells = rng.integers(0, 256, (3, 5)).astype(dtype)
    valid = rng.integers(0, 2, (24, 40)).astype(np.uint8)
    found = cells_to_pixels(cells, valid)
    assert found.dtype == dtype and np.array_equal(found, cells.repeat(8, 0).repeat(8, 1) * valid)
