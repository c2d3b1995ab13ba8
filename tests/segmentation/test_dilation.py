"""Dilation is the maximum over a square."""

import numpy as np
from hypothesis import given, settings, strategies as st
from scipy import ndimage

from uavseg.segmentation.blocks.dilation import dilate


@settings(max_examples=60)
@given(
    st.integers(0, 100_000),
    st.tuples(st.integers(1, 12), st.integers(1, 12)),
    st.integers(0, 14),
    st.sampled_from([np.bool_, np.uint8]),
)
def test_it_is_the_maximum_filter_of_scipy(
    seed: int, shape: tuple[int, int], reach: int, dtype: type
) -> None:
    cells = np.random.default_rng(seed).choice([0, 0, 0, 1], shape).astype(dtype)
    before = cells.copy()
    found = dilate(cells, reach)
    expected = ndimage.maximum_filter(cells.astype(np.uint8), 2 * reach + 1, mode="constant")
    assert found.dtype == dtype and found.flags.c_contiguous
    assert np.array_equal(found, expected) and np.array_equal(cells, before)
