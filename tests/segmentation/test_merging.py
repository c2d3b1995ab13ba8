"""Merging joins whole adjacent regions, keeps their histograms, and stops later with a larger stop."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.lbpc import _merge_regions


@pytest.mark.slow
@given(st.integers(0, 10_000), st.integers(2, 30))
@settings(max_examples=50)
def test_merging_never_splits_a_region_and_stops_later_with_a_larger_stop(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, count, (12, 12)).astype(np.uint32)
    labels = np.unique(labels, return_inverse=True)[1].reshape(12, 12).astype(np.uint32)
    symbols = rng.integers(0, 6, (12, 12)).astype(np.uint16)
    parts = []
    for stop in (1.0, 2.0, np.inf):
        after, models = _merge_regions(labels, symbols, stop, 0.1)
        parts.append(len(models) - 1)
        for k in range(1, len(models)):
            assert np.array_equal(np.bincount(symbols[after == k], minlength=2048), models[k])
        assert np.array_equal(after == 0, labels == 0)
        assert (
            len({(a, b) for a, b in zip(labels.ravel(), after.ravel(), strict=True)})
            == labels.max() + (labels == 0).any()
        )
    assert parts[0] >= parts[1] >= parts[2]


def test_the_most_similar_neighbours_merge_first() -> None:
    labels = np.repeat(np.array([[1, 2, 3, 4]], np.uint32), 20, 0).repeat(10, 1)
    symbols = np.random.default_rng(0).integers(0, 8, labels.shape).astype(np.uint16)
    symbols[:, 20:] += 8  # two textures, each in two regions
    merged, models = _merge_regions(labels, symbols, 2.0, 0.5)
    assert np.array_equal(merged, np.where(labels < 3, 1, 2)) and len(models) == 3


def test_regions_that_do_not_touch_are_never_merged() -> None:
    labels = np.zeros((20, 30), np.uint32)
    labels[:, :10], labels[:, 20:] = 1, 2
    merged, _ = _merge_regions(labels, np.zeros(labels.shape, np.uint16), np.inf, 1.0)
    assert np.array_equal(merged, labels)
