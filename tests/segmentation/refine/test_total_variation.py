"""The denoised image has minimal total variation, and is thresholded as in plain arrays."""

from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.refine import total_variation
from uavseg.segmentation.refine.total_variation import MAX_WEIGHT, _classify_panels

seeds = st.integers(0, 100_000)
MIDDLE = IntensityRange(0.35, 0.65)


def within(low: int, high: int) -> np.ndarray:
    """The class of each grey: 1 in a range."""
    greys = np.arange(65536)
    return ((low <= greys) & (greys <= high)).astype(np.uint8)


@pytest.mark.slow
@settings(max_examples=8)
@given(seeds)
def test_sweeps_end_at_the_minimum_of_total_variation(plain_variation: ModuleType, seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.integers(0, 65536, (10, 13)).astype(np.uint16)
    weights = rng.integers(0, 6000, grey.shape)
    u, flows = plain_variation.minimise_tv(grey, weights, 2000)
    half = grey.astype(np.int64) // 2
    variation_of_u, dual = 0, 0
    for (a, b, share), flow in zip(plain_variation.pairs(grey.shape), flows, strict=True):
        limit = np.minimum(weights[a], weights[b]) * share // 64
        variation_of_u += (limit * np.abs(u[b] - u[a])).sum()
        dual += (flow * (u[b] - u[a])).sum()
    assert ((u - half) ** 2).sum() > 0
    assert variation_of_u - dual <= 0.001 * ((half - half.mean()) ** 2).sum()  # no gap: both are optimal
    assert grey.min() // 2 <= u.min() and u.max() <= grey.max() // 2


@settings(max_examples=30)
@given(seeds, st.sampled_from([0, 300, MAX_WEIGHT]))
def test_thresholds_are_those_of_plain_arrays(plain_variation: ModuleType, seed: int, largest: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.integers(0, 65536, (16, 24)).astype(np.uint16)
    valid = (rng.random(grey.shape) > 0.1).astype(np.uint8)
    grey *= valid
    weights = rng.integers(0, largest + 1, (2, 3)).astype(np.int16)
    inside = rng.integers(0, 2, grey.shape).astype(np.uint8) & valid
    u, _ = plain_variation.minimise_tv(grey, weights.repeat(8, 0).repeat(8, 1) * valid.astype(np.int64))
    low, high = MIDDLE.greys
    expected = np.where(u != grey // 2, (low <= 2 * u) & (2 * u <= high) & (valid > 0), inside > 0)
    _classify_panels(grey, valid, weights, within(*MIDDLE.greys), inside)
    assert np.array_equal(inside > 0, expected)


@settings(max_examples=20)
@given(seeds)
def test_without_weights_nothing_changes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.integers(0, 65536, (16, 24)).astype(np.uint16)
    before = rng.integers(0, 2, grey.shape).astype(np.uint8)
    inside = before.copy()
    _classify_panels(grey, np.ones_like(inside), np.zeros((2, 3), np.int16), within(*MIDDLE.greys), inside)
    assert np.array_equal(inside, before)


@settings(max_examples=30)
@given(seeds, st.sampled_from([0, 300, MAX_WEIGHT]))
def test_kinds_are_those_of_the_greys_of_plain_arrays(
    plain_variation: ModuleType, seed: int, largest: int
) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.integers(0, 65536, (16, 24)).astype(np.uint16)
    valid = (rng.random(grey.shape) > 0.1).astype(np.uint8)
    grey *= valid
    weights = rng.integers(0, largest + 1, (2, 3)).astype(np.int16)
    table = rng.integers(0, 128, 65536).astype(np.uint8)
    classes = rng.integers(0, 128, grey.shape).astype(np.uint8) * valid
    u, _ = plain_variation.minimise_tv(grey, weights.repeat(8, 0).repeat(8, 1) * valid.astype(np.int64))
    expected = np.where(u != grey // 2, table[2 * u] * valid, classes)
    _classify_panels(grey, valid, weights, table, classes)
    assert np.array_equal(classes, expected)


@pytest.mark.parametrize("share", [0.002, 0.02, 0.2])
def test_columns_without_weight_may_be_left_out(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same as if all were loaded, also where active cells touch across the end of a run at a corner."""
    rng = np.random.default_rng(5)
    shape = 160, 1024
    weights = rng.integers(1, 20_00, (20, 128)).astype(np.int16) * (rng.random((20, 128)) < share)
    for row, col in ((3, 7), (9, 15), (15, 40)):  # pairs of cells at a corner, where chunks of 64 pixels end
        weights[row, col], weights[row + 1, col + 1] = 900, 900
        weights[row + 3, col + 1], weights[row + 4, col] = 900, 900
    grey, valid = rng.integers(0, 65536, shape, dtype=np.uint16), np.ones(shape, np.uint8)
    found, expected = np.zeros((2, *shape), np.uint8)
    arguments = grey, valid, weights.astype(np.int16), within(20_000, 65_535)
    total_variation._classify_panels(*arguments, found)

    def everything(weights: np.ndarray) -> np.ndarray:
        runs = np.zeros((2, len(weights), 2, 2), np.int64)
        runs[:, :, 0, 1] = -(-weights.shape[1] // total_variation._CHUNK) * total_variation._CHUNK
        return runs

    monkeypatch.setattr(total_variation, "_runs", everything)
    total_variation._classify_panels(*arguments, expected)
    assert found.any() and (found == expected).all()
