"""Region outlines: sums merge by adding, and regions are numbered by their size."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rings import merge_sums, rasterise, renumber_by_size, select_sums, size_order
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.components import Sums, component_sums

NAMES = ("counts", "greys", "squares", "firsts")
images = st.integers(0, 10**6).map(
    lambda seed: np.random.default_rng(seed).integers(0, 6, (7, 9)).astype(np.uint32)
)


def sums_of(labels: NDArray[np.uint32], count: int) -> Sums:
    grey = (np.arange(labels.size).reshape(labels.shape) * 7919 % 65536).astype(np.uint16)
    return component_sums(labels, count, grey)


def same(one: Sums, other: Sums) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in NAMES)


@given(images, st.lists(st.integers(0, 2), min_size=5, max_size=5))
def test_merged_sums_are_those_of_merged_labels(labels: NDArray[np.uint32], groups: list[int]) -> None:
    labels = np.where(labels == 0, 1, labels).astype(np.uint32)
    labels[0, :5] = np.arange(1, 6)  # every label occurs
    _, group = np.unique(groups, return_inverse=True)
    merged = merge_sums(sums_of(labels, 5), group, int(group.max()) + 1)
    assert same(merged, sums_of((group[labels - 1] + 1).astype(np.uint32), int(group.max()) + 1))


@given(images)
def test_the_order_is_by_pixels_then_by_first_pixel(labels: NDArray[np.uint32]) -> None:
    labels[0, :5] = np.arange(1, 6)
    sums = sums_of(labels, 5)
    ordered = select_sums(sums, size_order(sums))
    keys = [
        (-int(count), *first) for count, first in zip(ordered.counts, ordered.firsts.tolist(), strict=True)
    ]
    assert keys == sorted(keys)
    assert sorted(ordered.counts) == sorted(sums.counts)


@given(images, st.sets(st.integers(1, 5)))
@settings(max_examples=40)
def test_renumbered_regions_are_those_that_are_kept_largest_first(
    labels: NDArray[np.uint32], dropped: set[int]
) -> None:
    labels[0, :5] = np.arange(1, 6)
    rings = trace(labels)
    found = renumber_by_size(rings, sums_of(labels, 5), ~np.isin(rings.labels, list(dropped)))
    image = rasterise(found.rings, Window(0, 0, *labels.shape))
    assert np.array_equal(image > 0, (labels > 0) & ~np.isin(labels, list(dropped)))
    assert same(found.sums, sums_of(image, 5 - len(dropped)))
    assert np.array_equal(size_order(found.sums), np.arange(5 - len(dropped)))
    pairs = set(zip(labels[image > 0].tolist(), image[image > 0].tolist(), strict=True))
    assert len(pairs) == 5 - len(dropped)  # each old label has one new one
