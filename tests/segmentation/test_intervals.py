"""A range includes both its ends; a value on an edge of states or levels belongs below it."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import IntensityRangeError, ParameterError
from uavseg.segmentation.params.segment import IntensityRange, Levels, StateLimits

V = np.arange(65536) / 65535


ends = st.one_of(
    st.floats(0, 1),
    st.integers(0, 65535).map(lambda g: g / 65535),
    st.integers(0, 1000).map(lambda k: k / 1000),
)


@pytest.mark.parametrize("pair", [(0.5, 0.5), (0.6, 0.5), (-0.1, 0.5), (0.5, 1.01), (np.nan, 1), (0, np.nan)])
def test_a_range_that_is_none_is_refused_with_what_it_should_be(pair: tuple[float, float]) -> None:
    with pytest.raises(IntensityRangeError, match=r"0 <= low < high <= 1, got"):
        IntensityRange(*pair)


@settings(max_examples=100)
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


@pytest.mark.slow
@settings(max_examples=100)
@given(st.one_of(st.floats(1 / 65535, 1), st.integers(1, 500).map(lambda k: 1 / k), st.just(0.1)))
def test_levels_cover_everything_once(width: float) -> None:
    levels = Levels(width)
    assert levels.bounds[0] == 0 and levels.bounds[-1] == 1 and len(levels.bounds) == levels.count + 1
    assert (np.diff(levels.bounds[:-1]) > 0).all() and (np.diff(levels.edges) <= width + 1e-11).all()
    assert levels.edges == tuple(round(k * width, 12) for k in range(1, levels.count))


def test_one_half_of_eight_bits_is_unknown_either_way() -> None:
    assert StateLimits().of(np.array([126, 127, 128, 129]) / 255).tolist() == [1, 2, 2, 3]


@given(st.lists(ends, min_size=1, max_size=20))
def test_the_table_of_states_agrees_with_the_state_of_each_v(values: list[float]) -> None:
    limits = StateLimits()
    greys = np.floor(np.array(values) * 65535).astype(int)
    assert np.array_equal(limits.table[greys], limits.of(V[greys]))


@given(ends, ends, ends)
def test_the_edges_of_a_range_part_v_into_below_in_and_above(first: float, second: float, v: float) -> None:
    low, high = sorted((first, second))
    if low < high:
        expected = 0 if v < low else 1 if v <= high else 2
        assert np.searchsorted(IntensityRange(low, high).edges, v) == expected
