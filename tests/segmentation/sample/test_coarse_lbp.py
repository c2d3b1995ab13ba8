"""Texture of means of 2 x 2: against a slow plain version, and of the image of means."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.blocks.lbp import (
    COARSE_HALO,
    UNCOUNTED,
    coarse_symbols,
    contrast_histogram,
    lbp_symbols,
)

CUTS = np.array([0, 2000, 5000, 9000, 14000, 20000, 30000], np.int32)


def drawn(seed: int, rows: int, cols: int) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
    rng = np.random.default_rng(seed)
    grey = rng.integers(0, 65536, (rows, cols)).astype(np.uint16)
    return grey, (rng.random((rows, cols)) < 0.98).astype(np.uint8)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), rows=st.integers(0, 9), cols=st.integers(0, 9), every=st.booleans())
def test_symbols_are_those_of_the_nine_means_around(seed: int, rows: int, cols: int, every: bool) -> None:
    grey, valid = drawn(seed, rows + 2 * COARSE_HALO, cols + 2 * COARSE_HALO)
    found = coarse_symbols(grey, None if every else valid, CUTS)
    assert found.shape == (rows, cols)
    for row, col in np.ndindex(rows, cols):
        around = np.s_[row : row + 6, col : col + 6]
        means = grey[around].reshape(3, 2, 3, 2).astype(int).sum(axis=(1, 3)) // 4
        [[name]] = lbp_symbols(means.astype(np.uint16), None, CUTS)
        assert found[row, col] == (name if every or valid[around].all() else UNCOUNTED)


def test_noise_of_single_pixels_is_halved() -> None:
    rng = np.random.default_rng(1)
    grey = (30000 + 3000 * rng.normal(size=(200, 200))).astype(np.uint16)
    bin_edges = np.arange(1, 8, dtype=np.int32) * 1000
    fine = lbp_symbols(grey[2:-2, 2:-2].copy(), None, bin_edges) & 7
    coarse = coarse_symbols(grey, None, bin_edges) & 7
    assert contrast_histogram(grey).sum() and coarse.mean() < 0.65 * fine.mean()


@given(seed=st.integers(0, 10**6), row=st.integers(0, 5), col=st.integers(0, 5))
@settings(max_examples=20)
def test_a_part_with_its_margin_is_as_in_the_whole(seed: int, row: int, col: int) -> None:
    grey, valid = drawn(seed, 24, 24)
    whole = coarse_symbols(grey, valid, CUTS)
    part = coarse_symbols(grey[row:, col:], valid[row:, col:], CUTS)
    assert np.array_equal(part, whole[row:, col:])
