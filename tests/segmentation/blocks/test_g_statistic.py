"""G of two histograms is that of scipy; its expectation is that of all ways to split a source."""

from math import comb

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import chi2_contingency

from uavseg.segmentation.blocks.g_statistic import N_LN_N, expected_g, g_statistic, n_ln_n, n_ln_n_table

counts = st.lists(st.tuples(st.integers(0, 90), st.integers(0, 90)), min_size=2, max_size=20)


@settings(max_examples=100)
@given(counts)
def test_g_is_that_of_scipy(pairs: list[tuple[int, int]]) -> None:
    table = np.array(pairs).T
    table = table[:, table.any(axis=0)]
    if table.shape[1] < 2 or not table.any(axis=1).all():
        return
    expected = chi2_contingency(table, correction=False, lambda_="log-likelihood").statistic
    assert g_statistic(*table) == pytest.approx(expected, rel=1e-9, abs=1e-8)


@settings(max_examples=100)
@given(counts, st.integers(1, 10))
def test_g_is_symmetric_and_0_between_multiples(pairs: list[tuple[int, int]], times: int) -> None:
    first, second = np.array(pairs).T
    assert g_statistic(first, second) == pytest.approx(g_statistic(second, first))
    few = np.minimum(first, 18)
    if few.any():
        assert g_statistic(few, times * few) == 0
    assert g_statistic(first, second) >= 0


@pytest.mark.parametrize("largest", [0, 1, 4096, 70_000])
def test_a_lookup_table_is_n_ln_n_as_far_as_it_goes(largest: int) -> None:
    table = n_ln_n_table(largest)
    assert len(table) == min(largest, 65536) + 1
    assert np.array_equal(table, n_ln_n(np.arange(len(table))))
    assert np.array_equal(table[:4097], N_LN_N[: len(table)])


@settings(max_examples=30)
@given(st.lists(st.integers(0, 6), min_size=1, max_size=3), st.sampled_from([0.1, 0.25, 0.5]))
def test_expected_g_is_the_mean_over_all_splits_with_independent_pixels(
    symbols: list[int], share: float
) -> None:
    """G of a split with totals as expected, averaged by the probability of each split."""
    expected = expected_g(6, share)[symbols].sum()
    entropy = -share * np.log(share) - (1 - share) * np.log(1 - share)
    mean = 0.0
    for n in symbols:
        for f in range(n + 1):
            probability = comb(n, f) * share**f * (1 - share) ** (n - f)
            joint = n_ln_n(np.array([n, f, n - f])) @ [1, -1, -1]
            mean += probability * 2 * (n * entropy - joint)
    assert expected == pytest.approx(mean, abs=1e-9)
