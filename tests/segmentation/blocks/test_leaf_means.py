"""The histogram of leaf means counts every valid pixel once, and merges by adding."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.blocks import block_map
from uavseg.segmentation.blocks.block_map import BlockMap, find_leaves
from uavseg.segmentation.blocks.leaves import histogram_of_means, means_among
from uavseg.segmentation.in_memory import block_map_of_array
from uavseg.segmentation.params.segment import DivisionParams


def scene(seed: int, shape: tuple[int, int] = (200, 150)) -> BlockMap:
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 65536, (shape[0] // 20 + 1, shape[1] // 20 + 1))
    grey = np.kron(coarse, np.ones((20, 20)))[: shape[0], : shape[1]] + rng.normal(0, 2000, shape)
    return block_map_of_array(np.clip(grey, 0, 65535).astype(np.uint16), rng.random(shape) < 0.8)


@settings(max_examples=15)
@given(st.integers(0, 99), st.sampled_from([0.02, 0.3, np.inf]))
def test_the_histogram_is_that_of_the_leaves(seed: int, step: float) -> None:
    blocks = scene(seed)
    found = histogram_of_means(blocks, DivisionParams(1.2, step))
    _, mean = find_leaves(blocks, DivisionParams(1.2, step))
    wanted = np.zeros(65536, np.int64)
    for v, count in zip(mean.flat, blocks.counts.flat, strict=True):
        if count:
            wanted[int(v * 65535 + 0.5)] += int(count)
    assert np.array_equal(found, wanted) and found.sum() == blocks.counts.sum()


def test_parts_merge_by_adding(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = scene(1, (400, 130))
    whole = histogram_of_means(blocks, DivisionParams(1.2, 0.05))
    parts = [
        replace(
            blocks,
            sums=blocks.sums[8 * a : 8 * b],
            counts=blocks.counts[8 * a : 8 * b],
            ratios=blocks.ratios[a:b],
        )
        for a, b in ((0, 3), (3, 4), (4, 7))
    ]
    assert np.array_equal(sum(histogram_of_means(part, DivisionParams(1.2, 0.05)) for part in parts), whole)
    monkeypatch.setattr(block_map, "_STRIP_BLOCKS", 2)
    assert np.array_equal(histogram_of_means(blocks, DivisionParams(1.2, 0.05)), whole)


def test_values_that_are_means_are_found() -> None:
    grey = np.full((64, 64), 26214, np.uint16)  # v = 0.4
    grey[:, 32:] = 52428
    blocks = block_map_of_array(grey)
    assert means_among(blocks, (0.2, 0.4, 0.400001, 0.8), DivisionParams(1.2, 0.05)) == {0.4, 0.8}
    assert means_among(blocks, (), DivisionParams(1.2, 0.05)) == set()
