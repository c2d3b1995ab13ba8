"""Scores of two kinds: a gap between those of the sample and the others."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from skimage.filters import threshold_otsu

from uavseg.segmentation.sample.g_scores import (
    MAX_SCORE,
    NO_SCORE,
    NULL_SCORE,
    SCORE_UNITS,
    is_bimodal,
    separability,
)

LIMIT = NULL_SCORE + SCORE_UNITS // 4


def scores(*classes: tuple[float, float, int], seed: int = 0) -> NDArray[np.uint16]:
    """So many scores around a mean G per pixel, with a deviation."""
    rng = np.random.default_rng(seed)
    parts = [rng.normal(mean, deviation, count) for mean, deviation, count in classes]
    return np.clip(NULL_SCORE + SCORE_UNITS * np.concatenate(parts), 0, MAX_SCORE - 1).astype(np.uint16)


@given(st.integers(0, 99), st.floats(1, 3), st.integers(100, 900))
def test_two_distant_kinds_are(seed: int, far: float, count: int) -> None:
    found = scores((0.05, 0.05, 1000 - count), (far, 0.1 * far, count), seed=seed)
    assert is_bimodal(found, LIMIT)
    rng = np.random.default_rng(seed)
    more = np.concatenate([found, np.full(100, MAX_SCORE, np.uint16), np.full(9, NO_SCORE, np.uint16)])
    assert is_bimodal(rng.permutation(more), LIMIT), "neither order nor cells without a score count"


@pytest.mark.slow
@given(st.integers(0, 99), st.floats(0, 2), st.floats(0.01, 1))
def test_one_kind_is_not(seed: int, mean: float, deviation: float) -> None:
    assert not is_bimodal(scores((mean, deviation, 1000), seed=seed), LIMIT)


def test_a_slope_from_like_to_unlike_is_not() -> None:
    slope = np.linspace(NULL_SCORE, NULL_SCORE + 2 * SCORE_UNITS, 1000).astype(np.uint16)
    assert not is_bimodal(slope, LIMIT)


def test_a_few_that_are_unlike_are_not_a_kind() -> None:
    assert not is_bimodal(scores((0.05, 0.02, 950), (2, 0.1, 50)), LIMIT)


def test_too_few_scores_say_nothing() -> None:
    assert not is_bimodal(scores((0.05, 0.02, 16), (2, 0.1, 15)), LIMIT)
    assert is_bimodal(scores((0.05, 0.02, 16), (2, 0.1, 16)), LIMIT)
    assert not is_bimodal(np.full(100, NULL_SCORE, np.uint16), LIMIT)


def test_known_distributions_have_the_share_that_the_docstring_gives() -> None:
    assert separability(scores((1, 0.1, 100_000))) == pytest.approx(2 / np.pi, abs=0.02)
    even = np.linspace(0, MAX_SCORE - 1, 100_000).astype(np.uint16)
    assert separability(even) == pytest.approx(0.75, abs=0.01)
    assert separability(even[:31]) == separability(np.full(99, 7, np.uint16)) == 0


@given(st.integers(0, 999), st.integers(32, 3000), st.floats(0, 3), st.booleans())
def test_the_share_is_that_of_all_values_one_by_one(seed: int, count: int, far: float, few: bool) -> None:
    found = scores((0.5, 0.2, count), (0.5 + far, 0.3, count), seed=seed)
    found = found // 4096 * 4096 if few else found
    every = np.minimum(found.astype(float), np.quantile(found, 0.99))
    low = every <= threshold_otsu(every) if every.min() < every.max() else every < 0
    between = (
        low.mean() * (1 - low.mean()) * (every[low].mean() - every[~low].mean()) ** 2 if low.any() else 0
    )
    assert separability(found) == pytest.approx(between / max(every.var(), 1e-9), abs=1e-9)


@given(st.integers(0, 99), st.integers(1, 3), st.integers(0, 5000))
def test_neither_origin_nor_scale_matter(seed: int, scale: int, shift: int) -> None:
    found = scores((0.5, 0.2, 300), (1.5, 0.3, 300), seed=seed)
    assert separability((found // 4) * scale + shift) == pytest.approx(separability(found // 4), abs=0.005)
