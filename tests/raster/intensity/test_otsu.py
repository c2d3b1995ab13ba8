"""Otsu's thresholds are optimal, and those of scikit-image."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.raster.intensity.thresholds import Classes, are_separated, multi_otsu, select_classes

counts = st.lists(st.integers(0, 9), min_size=1, max_size=9).filter(any)


def within(histogram: list[int], begins: tuple[int, ...]) -> float:
    """Variance within classes that begin at these bins, times the total: by its definition."""
    bins, found = np.arange(len(histogram)), 0.0
    for low, high in zip((0, *begins), (*begins, len(histogram)), strict=True):
        weights, values = np.array(histogram[low:high], float), bins[low:high]
        if weights.sum():
            found += (weights * (values - np.average(values, weights=weights)) ** 2).sum()
    return found


@given(counts, st.integers(1, 5))
def test_no_other_partition_has_less_variance_within_classes(histogram: list[int], most: int) -> None:
    found = multi_otsu(histogram, most)
    assert [classes.count for classes in found] == list(range(1, min(most, np.count_nonzero(histogram)) + 1))
    whole = within(histogram, ())
    for classes in found:
        own = within(histogram, classes.starts)
        cuts = combinations(range(1, len(histogram)), classes.count - 1)
        assert own == pytest.approx(min(within(histogram, cut) for cut in cuts), abs=1e-9)
        assert whole * (1 - classes.explained) == pytest.approx(own, abs=1e-9)


def sampled(seed: int) -> np.ndarray:
    """Samples of four modes in 64 bins."""
    rng = np.random.default_rng(seed)
    heaps = [rng.normal(rng.uniform(0, 60), rng.uniform(1, 8), rng.integers(50, 900)) for _ in range(4)]
    return np.trim_zeros(np.histogram(np.clip(np.concatenate(heaps), 0, 63), 64, (0, 64))[0])


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_two_classes_are_those_of_scikit_image(seed: int) -> None:
    filters = pytest.importorskip("skimage.filters")
    histogram = sampled(seed)
    found = multi_otsu(histogram, 2)[1]
    assert (
        found.ends[0] <= filters.threshold_otsu(hist=(histogram, np.arange(histogram.size))) < found.starts[0]
    )


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(2, 4))
def test_many_classes_are_as_good_as_those_of_scikit_image(seed: int, classes: int) -> None:
    """Its first bin (0.26) has the value of the second, so ours are found with the two in one."""
    filters = pytest.importorskip("skimage.filters")
    histogram = sampled(seed)
    theirs = filters.threshold_multiotsu(hist=(histogram, np.arange(histogram.size)), classes=classes)
    histogram[:2] = 0, histogram[:2].sum()
    told = within(histogram.tolist(), tuple(int(cut) + 1 for cut in theirs))
    best = within(histogram.tolist(), multi_otsu(histogram, classes)[-1].starts)
    single = 1e-5 * float((histogram * np.arange(histogram.size) ** 2).sum())  # the precision of its sums
    assert best <= told * (1 + 1e-9) and told <= best + single


@given(counts, st.integers(0, 300), st.integers(0, 300), st.integers(1, 5))
def test_empty_bins_change_nothing(histogram: list[int], before: int, after: int, most: int) -> None:
    padded = multi_otsu([0] * before + histogram + [0] * after, most)
    for one, other in zip(multi_otsu(histogram, most), padded, strict=True):
        assert one.explained == other.explained
        assert tuple(end + before for end in one.ends) == other.ends
        assert tuple(start + before for start in one.starts) == other.starts


@given(counts, st.integers(2, 5))
def test_all_bins_between_an_end_and_a_start_are_empty(histogram: list[int], most: int) -> None:
    for classes in multi_otsu(histogram, most):
        for end, start in zip(classes.ends, classes.starts, strict=True):
            assert histogram[end] and histogram[start] and not any(histogram[end + 1 : start])


@given(counts, st.integers(1, 5))
def test_a_further_class_never_explains_less(histogram: list[int], most: int) -> None:
    told = [classes.explained for classes in multi_otsu(histogram, most)]
    assert told == sorted(told) or np.diff(told).min() > -1e-12


def test_an_empty_histogram_has_no_classes() -> None:
    assert multi_otsu([0, 0, 0], 3) == [] and multi_otsu([], 3) == []


def modes(*places: tuple[float, float, float]) -> np.ndarray:
    """Normal distributions: place, deviation and share of each."""
    bins = np.arange(256)
    shapes = (share / wide * np.exp(-(((bins - place) / wide) ** 2) / 2) for place, wide, share in places)
    return np.round(1e6 * np.sum(list(shapes), axis=0))


@pytest.mark.parametrize(
    ("histogram", "count"),
    [
        (modes((60, 12, 0.5), (180, 12, 0.5)), 2),
        (modes((60, 12, 0.9), (180, 12, 0.1)), 2),
        (modes((40, 10, 0.3), (120, 10, 0.4), (200, 10, 0.3)), 3),
        (modes((30, 8, 0.2), (90, 8, 0.3), (150, 8, 0.2), (210, 8, 0.3)), 4),
        (np.bincount([40, 80, 120, 160, 200]), 5),
    ],
)
def test_there_are_as_many_classes_as_modes(histogram: np.ndarray, count: int) -> None:
    found = select_classes(histogram, multi_otsu(histogram, 6))
    assert found.count == count and are_separated(histogram, found)


@pytest.mark.parametrize(
    "histogram", [np.ones(240), modes((128, 20, 1)), modes((110, 20, 0.5), (150, 20, 0.5))]
)
def test_without_a_valley_two_classes_are_not_separated(histogram: np.ndarray) -> None:
    found = select_classes(histogram, multi_otsu(histogram, 6))
    assert found.count == 2 and not are_separated(histogram, found)


def test_one_bin_is_one_class() -> None:
    assert select_classes([0, 7, 0], multi_otsu([0, 7, 0], 6)).count == 1


@given(counts, st.integers(0, 300), st.integers(0, 300), st.integers(1, 1000))
def test_separation_does_not_depend_on_empty_bins_and_scale(
    histogram: list[int], before: int, after: int, times: int
) -> None:
    more = [0] * before + [times * count for count in histogram] + [0] * after
    for one, other in zip(multi_otsu(histogram, 5), multi_otsu(more, 5), strict=True):
        assert one.starts == tuple(start - before for start in other.starts) or times > 1
        moved = Classes(
            tuple(end + before for end in one.ends), tuple(start + before for start in one.starts), 0.0
        )
        assert are_separated(histogram, one) == are_separated(more, moved)
