"""Threshold of least cross entropy: comparison with scikit-image and with the definition, and its laws."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from skimage.filters import threshold_li

from uavseg.raster.intensity.thresholds import least_cross_entropy

COUNTS = st.lists(st.integers(0, 50), min_size=2, max_size=40).filter(lambda one: np.count_nonzero(one) > 1)


def entropy(counts: list[int], end: int) -> float:
    """The criterion of a threshold above a bin, from its definition; intensities count from the first bin."""
    bins = np.flatnonzero(counts)
    values, weights = bins - bins[0] + 0.5, np.array(counts)[bins]
    total = 0.0
    for side in (bins <= end, bins > end):
        mean = np.average(values[side], weights=weights[side])
        total += (weights[side] * values[side] * np.log(values[side] / mean)).sum()
    return float(total)


@given(COUNTS)
def test_no_other_threshold_has_less(counts: list[int]) -> None:
    bins = np.flatnonzero(counts).tolist()
    end, start = least_cross_entropy(counts)
    assert start == bins[bins.index(end) + 1]
    weights = np.array(counts)[bins]
    if (weights * (bins - np.average(bins, weights=weights)) ** 3).sum() >= 0:
        values = [entropy(counts, one) for one in bins[:-1]]
        assert entropy(counts, end) == pytest.approx(min(values), abs=1e-9)


@given(COUNTS)
def test_a_negative_has_the_same_classes(counts: list[int]) -> None:
    bins = np.flatnonzero(counts)
    third = np.array(counts)[bins] * (bins - np.average(bins, weights=np.array(counts)[bins])) ** 3
    if abs(third.sum()) < 1e-6 * np.abs(third).sum():
        return  # symmetric: either side may be the tail
    end, start = least_cross_entropy(counts)
    other_end, other_start = least_cross_entropy(counts[::-1])
    last = len(counts) - 1
    assert (last - other_start, last - other_end) == (end, start)


@pytest.mark.parametrize("seed", range(4))
def test_scikit_image_finds_the_same_in_a_long_tail(seed: int) -> None:
    values = np.random.default_rng(seed).gamma(1.5, 20, 50_000)
    counts = np.bincount(values.astype(int))
    end, start = least_cross_entropy(counts)
    assert (end + start + 1) / 2 == pytest.approx(threshold_li(values), abs=1.5)


def test_one_bin_has_no_threshold() -> None:
    with pytest.raises(ValueError, match="two bins"):
        least_cross_entropy([0, 4, 0])
