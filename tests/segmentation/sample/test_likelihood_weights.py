"""Evidence for a sample: against a slow plain version, wherever it is cut, and what it means."""

from math import floor, log

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.segmentation.blocks.lbp import UNCOUNTED
from uavseg.segmentation.sample.g_scores import min_count
from uavseg.segmentation.sample.likelihood_weights import (
    PRIOR_PIXELS,
    WEIGHT_UNITS,
    SampleWeights,
    SymbolPair,
    best_mean_weights,
    log_ratio_weights,
    own_window_means,
    symbol_counts,
)

NONE = -(1 << 31)


def drawn(seed: int, rows: int, cols: int, many: int = 40, missing: float = 0.05) -> SymbolPair:
    """Symbols of both scales, some of which do not count; all have some of the first."""
    rng = np.random.default_rng(seed)
    fine, coarse = (rng.integers(0, many, (rows, cols)).astype(np.uint16) for _ in range(2))
    fine[rng.random((rows, cols)) < missing] = UNCOUNTED
    coarse[(fine == UNCOUNTED) | (rng.random((rows, cols)) < missing)] = UNCOUNTED
    return fine, coarse


def plain_weight(sample: np.ndarray, whole: np.ndarray, name: int) -> float:
    """ln of the ratio of two probabilities, the sample's with the raster as its prior."""
    in_raster = whole[name] / whole.sum()
    in_sample = (sample[name] + PRIOR_PIXELS * in_raster) / (sample.sum() + PRIOR_PIXELS)
    return log(in_sample / in_raster)


def test_weights_are_logarithms_of_ratios() -> None:
    whole, sample = symbol_counts(drawn(1, 64, 64)), symbol_counts(drawn(1, 64, 64)) // 3
    weights = log_ratio_weights(sample, whole)
    for scale, name in np.ndindex(2, 40):
        wanted = plain_weight(sample[scale], whole[scale], name)
        assert weights[scale, name] == pytest.approx(WEIGHT_UNITS * wanted, abs=0.5)
    assert not weights[:, 40:].any()  # the raster has none of them


def test_what_a_sample_lacks_speaks_against_it_the_more_the_larger_it_is() -> None:
    whole = np.zeros((2, 2048), np.int64)
    whole[:, :2] = 50_000
    for pixels, expected in ((1_000, 0.5), (9_000, 0.1)):  # 1000 of the raster's are thought to be in it
        sample = np.zeros_like(whole)
        sample[:, 0] = pixels
        assert (log_ratio_weights(sample, whole)[:, 1] == round(1024 * log(expected))).all()


def test_a_sample_with_the_rasters_proportions_has_no_evidence() -> None:
    counts = symbol_counts(drawn(2, 64, 64))
    assert not log_ratio_weights(counts, 7 * counts).any()
    assert not log_ratio_weights(0 * counts, counts).any()


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_the_raster_has_no_evidence_for_its_own_part_on_average(seed: int) -> None:
    """The mean over the raster is minus a Kullback-Leibler divergence, over the sample above it."""
    rng = np.random.default_rng(seed)
    whole = rng.integers(1, 90, (2, 2048))
    sample = rng.binomial(whole, rng.random((2, 2048)))
    weights = log_ratio_weights(sample, whole)
    assert (weights * whole).sum() <= 2048
    assert (weights * sample).sum() / sample.sum() > (weights * whole).sum() / whole.sum()


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), rows=st.integers(3, 5), cols=st.integers(3, 5), side=st.integers(1, 2))
def test_cells_have_the_best_mean_of_the_windows_around(seed: int, rows: int, cols: int, side: int) -> None:
    names = drawn(seed, 8 * rows, 8 * cols, missing=0.11)
    weights = np.random.default_rng(seed).integers(-5000, 5000, (2, 2048))
    found = best_mean_weights(names, weights, side)
    assert found.shape == (rows - 2 * side + 2, cols - 2 * side + 2)
    means = np.full((rows - side + 1, cols - side + 1), NONE)
    for row, col in np.ndindex(means.shape):
        part = np.s_[8 * row : 8 * (row + side), 8 * col : 8 * (col + side)]
        counts = symbol_counts((names[0][part], names[1][part]))
        if counts[0].sum() >= min_count(side):
            means[row, col] = floor(int((weights * counts).sum()) / int(counts[0].sum()))
    for row, col in np.ndindex(found.shape):
        assert found[row, col] == means[row : row + side, col : col + side].max()


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10**6), side=st.integers(1, 2))
def test_a_samples_own_windows_are_weighed_by_the_rest_of_it(seed: int, side: int) -> None:
    names = drawn(seed, 24, 32, missing=0.1)
    whole = 3 * symbol_counts(names)
    wanted = []
    for row in range(4 - side):
        for col in range(5 - side):
            part = np.s_[8 * row : 8 * (row + side), 8 * col : 8 * (col + side)]
            window = symbol_counts((names[0][part], names[1][part]))
            rest = symbol_counts(names) - window
            total = sum(
                window[scale, name] * plain_weight(rest[scale], whole[scale], name)
                for scale, name in zip(*np.nonzero(window), strict=True)
            )
            if window[0].sum() >= min_count(side):
                wanted.append(total / window[0].sum())
    assert own_window_means(names, whole, side) == pytest.approx(wanted)


def test_of_a_large_sample_about_a_thousand_windows_are_looked_at() -> None:
    fine, coarse = drawn(3, 1024, 1024, missing=0)
    names = (fine, coarse)
    assert 1000 <= len(own_window_means(names, symbol_counts(names), 2)) <= 4096


def test_windows_of_the_samples_source_are_like_it_and_others_are_not() -> None:
    """However few of its symbols differ: here a tenth of the pixels have one of twice as many symbols."""
    rng = np.random.default_rng(4)

    def image(shape: tuple[int, int], odd: int) -> SymbolPair:
        return tuple(  # type: ignore[return-value]
            np.where(
                rng.random(shape) < 0.1, odd + rng.integers(0, 5, shape), rng.integers(50, 90, shape)
            ).astype(np.uint16)
            for _ in range(2)
        )

    sample, same, other = image((80, 80), 0), image((256, 256), 0), image((256, 256), 20)
    whole = sum(symbol_counts(names) for names in (sample, same, other))
    evidence = SampleWeights.of(sample, np.asarray(whole), 4)
    assert (best_mean_weights(same, evidence.weights, 4) >= evidence.threshold(0.9)).all()
    assert (best_mean_weights(other, evidence.weights, 4) < evidence.threshold(0.9)).mean() > 0.99
    alone = SampleWeights.of(sample, symbol_counts(sample) + symbol_counts(same), 4)
    assert (best_mean_weights(same, alone.weights, 4) >= alone.threshold(0.9)).all()


def test_less_similarity_asks_for_less() -> None:
    evidence = SampleWeights(np.zeros((2, 2048), np.int64), -30)
    assert [evidence.threshold(s) for s in (1, 0.9, 0.5)] == [-30, -84, -385]
