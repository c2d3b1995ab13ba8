"""The estimate is the deviation of the noise, whatever lies under it."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.refine.noise import estimate_noise

SHAPE = (160, 192)
CELLS = (SHAPE[0] // 8, SHAPE[1] // 8)
ONES = np.ones(SHAPE, np.uint8)
NO_BOUND = np.zeros(0, np.int64)


def noisy(deviation: float, seed: int = 0) -> NDArray[np.uint16]:
    """A slope with normal noise."""
    rows, cols = np.indices(SHAPE)
    noise = np.random.default_rng(seed).normal(0, deviation, SHAPE)
    return np.clip(20000 + 40 * rows + 25 * cols + noise, 0, 65535).astype(np.uint16)


@pytest.mark.parametrize("deviation", [200, 1000, 3000])
def test_the_deviation_of_normal_noise_is_found(deviation: float) -> None:
    found = estimate_noise(noisy(deviation), ONES, np.ones(CELLS, np.uint8), NO_BOUND)
    assert found.shape == (SHAPE[0] // 16, SHAPE[1] // 16)
    # The larger of two estimates, and so somewhat above the deviation.
    assert deviation * 0.9 < np.median(found) < deviation * 1.5


def test_a_plane_has_no_noise() -> None:
    assert estimate_noise(noisy(0), ONES, np.ones(CELLS, np.uint8), NO_BOUND).max() < 2  # rounding of grey


def test_an_edge_is_no_noise() -> None:
    grey = np.where(np.arange(SHAPE[1]) < 93, 10000, 50000).astype(np.uint16) * ONES.astype(np.uint16)
    assert not estimate_noise(grey, ONES, np.ones(CELLS, np.uint8), NO_BOUND).any()


@settings(max_examples=20)
@given(st.integers(0, 100_000))
def test_squares_are_estimated_where_a_cell_is_active_and_as_if_all_were(seed: int) -> None:
    active = (np.random.default_rng(seed).random(CELLS) < 0.1).astype(np.uint8)
    grey = noisy(800, seed)
    found = estimate_noise(grey, ONES, active, NO_BOUND)
    whole = estimate_noise(grey, ONES, np.ones(CELLS, np.uint8), NO_BOUND)
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
    assert np.array_equal(
        estimate_noise(grey, valid, active, NO_BOUND), estimate_noise(other, valid, active, NO_BOUND)
    )


@settings(max_examples=10)
@given(st.integers(0, 100_000))
def test_a_mirrored_image_has_the_same_noise(seed: int) -> None:
    valid = (np.random.default_rng(seed).random(SHAPE) > 0.02).astype(np.uint8)
    grey, active, bounds = noisy(800, seed) * valid, np.ones(CELLS, np.uint8), np.array([22000])
    found = estimate_noise(grey, valid, active, bounds)
    for axis in (0, 1):
        turned, known = (np.ascontiguousarray(np.flip(image, axis)) for image in (grey, valid))
        assert np.array_equal(estimate_noise(turned, known, active, bounds), np.flip(found, axis))


@pytest.mark.parametrize("pitch", [5, 8, 13])
@pytest.mark.parametrize("deviation", [0, 300, 1500])
def test_rows_in_two_intervals_are_no_noise(pitch: int, deviation: float) -> None:
    rng = np.random.default_rng(pitch)
    rows = np.indices(SHAPE).sum(axis=0) % pitch < pitch // 2
    grey = (np.where(rows, 45000, 20000) + rng.normal(0, deviation, SHAPE)).astype(np.uint16)
    two = np.array([32768])
    active = np.ones(CELLS, np.uint8)
    found = estimate_noise(grey, ONES, active, two)
    assert (found <= deviation * 2.5 + 1).all() and (found >= deviation * 0.7).all()
    assert estimate_noise(grey, ONES, active, NO_BOUND).min() > 4000


@pytest.mark.parametrize("draw", ["normal", "uniform", "exponential"])
def test_noise_on_both_sides_of_an_edge_is_noise(draw: str) -> None:
    sample = getattr(np.random.default_rng(0), draw)(size=SHAPE)
    grey = (20000 + 3000 * sample).astype(np.uint16)
    active, two = np.ones(CELLS, np.uint8), np.array([int(np.median(grey))])
    assert np.array_equal(
        estimate_noise(grey, ONES, active, two), estimate_noise(grey, ONES, active, NO_BOUND)
    )
