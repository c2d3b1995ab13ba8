"""The estimate is the deviation of the noise, whatever lies under it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.refine.noise import estimate_noise

SHAPE = (160, 192)
CELLS = (SHAPE[0] // 8, SHAPE[1] // 8)
ONES = np.ones(SHAPE, np.uint8)


def noisy(deviation: float, seed: int = 0) -> NDArray[np.uint16]:
    """A slope with normal noise."""
    rows, cols = np.indices(SHAPE)
    noise = np.random.default_rng(seed).normal(0, deviation, SHAPE)
    return np.clip(20000 + 40 * rows + 25 * cols + noise, 0, 65535).astype(np.uint16)


@pytest.mark.parametrize("deviation", [200, 1000, 3000])
def test_the_deviation_of_normal_noise_is_found(deviation: float) -> None:
    found = estimate_noise(noisy(deviation), ONES, np.ones(CELLS, np.uint8))
    assert found.shape == (SHAPE[0] // 16, SHAPE[1] // 16)
    # The larger of two estimates, and so somewhat above the deviation.
    assert deviation * 0.9 < np.median(found) < deviation * 1.5


def test_a_plane_has_no_noise() -> None:
    assert estimate_noise(noisy(0), ONES, np.ones(CELLS, np.uint8)).max() < 2  # rounding of grey


def test_an_edge_is_no_noise() -> None:
    grey = np.where(np.arange(SHAPE[1]) < 93, 10000, 50000).astype(np.uint16) * ONES.astype(np.uint16)
    assert not estimate_noise(grey, ONES, np.ones(CELLS, np.uint8)).any()


@settings(max_examples=20)
@given(st.integers(0, 100_000))
def test_squares_are_estimated_where_a_cell_is_active_and_as_if_all_were(seed: int) -> None:
    active = (np.random.default_rng(seed).random(CELLS) < 0.1).astype(np.uint8)
    grey = noisy(800, seed)
    found = estimate_noise(grey, ONES, active)
    whole = estimate_noise(grey, ONES, np.ones(CELLS, np.uint8))
    squares = active.reshape(CELLS[0] // 2, 2, CELLS[1] // 2, 2).any(axis=(1, 3))
    assert np.array_equal(found, np.where(squares, whole, 0))


@settings(max_examples=20)
@given(st.integers(0, 100_000))
def test_invalid_pixels_have_no_influence(seed: int) -> None:
    rng = np.random.default_rng(seed)
    valid = (rng.random(SHAPE) > 0.02).astype(np.uint8)
    grey = noisy(800, seed)
    other = np.where(valid, grey, rng.integers(0, 65536, SHAPE)).astype(np.uint16)
    active = np.ones(CELLS, np.uint8)
    assert np.array_equal(estimate_noise(grey, valid, active), estimate_noise(other, valid, active))
