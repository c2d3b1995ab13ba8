"""Breaks chosen from a histogram lie between its values, whatever these are."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.jobs.segment_classes import quantile_breaks
from uavseg.segmentation.params.segment import Breaks
from uavseg.segmentation.range_choice import propose_ranges

greys = st.sampled_from([0, 1, 2, 65534, 65535]) | st.integers(0, 65535)


@pytest.mark.slow
@settings(max_examples=100)
@given(st.dictionaries(greys, st.integers(1, 9), min_size=1, max_size=9), st.integers(2, 9))
def test_quantiles_part_any_histogram_at_numbers_between_its_values(
    pixels: dict[int, int], count: int
) -> None:
    histogram = np.zeros(65536, np.int64)
    histogram[list(pixels)] = list(pixels.values())
    edges = Breaks(quantile_breaks(histogram, count)).edges if len(pixels) > 1 else ()
    v = np.repeat(np.arange(65536), histogram) / 65535
    for k in range(1, count):  # an edge belongs to the level below it
        below = v[-(-k * len(v) // count) - 1]
        if below < v[-1]:
            assert ((below <= np.array(edges)) & (np.array(edges) < v[v > below][0])).sum() == 1
    assert len(edges) <= count - 1


@pytest.mark.slow
@pytest.mark.parametrize("count", [None, 2, 3])
@settings(max_examples=30)
@given(pixels=st.dictionaries(greys, st.integers(1, 9), min_size=2, max_size=9))
def test_otsu_parts_any_histogram_of_several_values(pixels: dict[int, int], count: int | None) -> None:
    histogram = np.zeros(65536, np.int64)
    histogram[list(pixels)] = list(pixels.values())
    assert Breaks(propose_ranges(histogram, count).edges).edges
