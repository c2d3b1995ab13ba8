"""Log-likelihood-ratio weights agree with a plain version and separate a sample from others."""

from math import floor, log

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.blocks.lbp import UNCOUNTED
from uavseg.segmentation.sample.g_scores import min_count
from uavseg.segmentation.sample.pixel_decision import (
    PRIOR_PIXELS,
    WEIGHT_UNITS,
    SampleWeights,
    SymbolPair,
    _log_ratio_weights,
    _sample_window_means,
    best_mean_weights,
    symbol_counts,
)

NONE = -(1 << 31)


def drawn(seed: int, rows: int, cols: int, many: int = 40, missing: float = 0.05) -> SymbolPair:
    """Symbols of both scales, some of them not counted."""
    rng = np.random.default_rng(seed)
    fine, coarse = (rng.integers(0, many, (rows, cols)).astype(np.uint16) for _ in range(2))
    fine[rng.random((rows, cols)) < missing] = UNCOUNTED
    coarse[(fine == UNCOUNTED) | (rng.random((rows, cols)) < missing)] = UNCOUNTED
    return fine, coarse


def plain_weight(sample: np.ndarray, background: np.ndarray, symbol: int) -> float:
    """Log ratio of two probabilities, that of the sample with the background as its prior."""
    in_raster = background[symbol] / background.sum()
    in_sample = (sample[symbol] + PRIOR_PIXELS * in_raster) / (sample.sum() + PRIOR_PIXELS)
    return log(in_sample / in_raster)


def test_weights_are_logarithms_of_ratios() -> None:
    background, sample = symbol_counts(drawn(1, 64, 64)), symbol_counts(drawn(1, 64, 64)) // 3
    weights = _log_ratio_weights(sample, background)
    for scale, symbol in np.ndindex(2, 40):
        expected = plain_weight(sample[scale], background[scale], symbol)
        assert weights[scale, symbol] == pytest.approx(WEIGHT_UNITS * expected, abs=0.5)
    assert not weights[:, 40:].any()  # not in the background


def test_a_missing_symbol_weighs_more_in_a_larger_sample() -> None:
    background = np.zeros((2, 2048), np.int64)
    background[:, :2] = 50_000
    for pixels, expected in ((1_000, 0.5), (9_000, 0.1)):  # with the pseudo-count of 1000
        sample = np.zeros_like(background)
        sample[:, 0] = pixels
        assert (_log_ratio_weights(sample, background)[:, 1] == round(1024 * log(expected))).all()


def test_a_sample_with_the_proportions_of_the_background_has_no_weights() -> None:
    counts = symbol_counts(drawn(2, 64, 64))
    assert not _log_ratio_weights(counts, 7 * counts).any()
    assert not _log_ratio_weights(0 * counts, counts).any()


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20)
def test_the_mean_weight_of_the_background_is_not_positive(seed: int) -> None:
    """The mean over the raster is minus a Kullback-Leibler divergence, over the sample above it."""
    rng = np.random.default_rng(seed)
    background = rng.integers(1, 90, (2, 2048))
    sample = rng.binomial(background, rng.random((2, 2048)))
    weights = _log_ratio_weights(sample, background)
    assert (weights * background).sum() <= 2048
    assert (weights * sample).sum() / sample.sum() > (weights * background).sum() / background.sum()


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), rows=st.integers(3, 5), cols=st.integers(3, 5), side=st.integers(1, 2))
def test_cells_have_the_best_mean_of_the_windows_around(seed: int, rows: int, cols: int, side: int) -> None:
    symbols = drawn(seed, 8 * rows, 8 * cols, missing=0.11)
    weights = np.random.default_rng(seed).integers(-5000, 5000, (2, 2048))
    found = best_mean_weights(symbols, weights, side)
    assert found.shape == (rows - 2 * side + 2, cols - 2 * side + 2)
    means = np.full((rows - side + 1, cols - side + 1), NONE)
    for row, col in np.ndindex(means.shape):
        part = np.s_[8 * row : 8 * (row + side), 8 * col : 8 * (col + side)]
        counts = symbol_counts((symbols[0][part], symbols[1][part]))
        if counts[0].sum() >= min_count(side):
            means[row, col] = floor(int((weights * counts).sum()) / int(counts[0].sum()))
    for row, col in np.ndindex(found.shape):
        assert found[row, col] == means[row : row + side, col : col + side].max()


@settings(max_examples=8)
@given(seed=st.integers(0, 10**6), side=st.integers(1, 2))
def test_own_windows_are_weighted_by_the_rest_of_the_sample(seed: int, side: int) -> None:
    symbols = drawn(seed, 24, 32, missing=0.1)
    background = 3 * symbol_counts(symbols)
    expected = []
    for row in range(4 - side):
        for col in range(5 - side):
            part = np.s_[8 * row : 8 * (row + side), 8 * col : 8 * (col + side)]
            window = symbol_counts((symbols[0][part], symbols[1][part]))
            rest = symbol_counts(symbols) - window
            total = sum(
                window[scale, symbol] * plain_weight(rest[scale], background[scale], symbol)
                for scale, symbol in zip(*np.nonzero(window), strict=True)
            )
            if window[0].sum() >= min_count(side):
                expected.append(total / window[0].sum())
    assert _sample_window_means(symbols, background, side) == pytest.approx(expected)


def test_a_large_sample_has_about_a_thousand_windows() -> None:
    fine, coarse = drawn(3, 1024, 1024, missing=0)
    symbols = (fine, coarse)
    assert 1000 <= len(_sample_window_means(symbols, symbol_counts(symbols), 2)) <= 4096


def test_windows_of_the_samples_source_pass_and_others_do_not() -> None:
    """Also where only a tenth of the pixels have other symbols."""
    rng = np.random.default_rng(4)

    def image(shape: tuple[int, int], odd: int) -> SymbolPair:
        return tuple(  # type: ignore[return-value]
            np.where(
                rng.random(shape) < 0.1, odd + rng.integers(0, 5, shape), rng.integers(50, 90, shape)
            ).astype(np.uint16)
            for _ in range(2)
        )

    sample, same, other = image((80, 80), 0), image((256, 256), 0), image((256, 256), 20)
    background = sum(symbol_counts(symbols) for symbols in (sample, same, other))
    sample_weights = SampleWeights.of(sample, np.asarray(background), 4)
    assert (best_mean_weights(same, sample_weights.weights, 4) >= sample_weights.threshold(0.9)).all()
    assert (best_mean_weights(other, sample_weights.weights, 4) < sample_weights.threshold(0.9)).mean() > 0.99
    alone = SampleWeights.of(sample, symbol_counts(sample) + symbol_counts(same), 4)
    assert (best_mean_weights(same, alone.weights, 4) >= alone.threshold(0.9)).all()


def test_a_lower_similarity_lowers_the_threshold() -> None:
    sample_weights = SampleWeights(np.zeros((2, 2048), np.int64), -30)
    assert [sample_weights.threshold(s) for s in (1, 0.9, 0.5)] == [-30, -84, -385]
