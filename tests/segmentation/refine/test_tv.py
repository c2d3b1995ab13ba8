"""Total variation as it is told, pixel by pixel in plain arrays; and what it leaves alone."""

from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.mixed_cells import mixed_cells
from uavseg.segmentation.intervals import IntensityRange
from uavseg.segmentation.refine import total_variation
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.tv import refine_by_tv

Image = NDArray[np.uint8]
Grey = NDArray[np.uint16]
seeds = st.integers(0, 100_000)
MIDDLE = IntensityRange(0.35, 0.65)


def random_case(seed: int, cells: tuple[int, int]) -> tuple[Image, Image, Image, Grey]:
    """Patches of grey with noise, holes in the valid pixels, cells inside and cells to be decided."""
    rng = np.random.default_rng(seed)
    side = int(rng.choice([3, 9, 20]))
    shape = (8 * cells[0], 8 * cells[1])
    patches = rng.choice([0.2, 0.4, 0.5, 0.6, 0.9], [n // side + 1 for n in shape])
    v = patches.repeat(side, 0).repeat(side, 1)[: shape[0], : shape[1]]
    v = v + rng.normal(0, rng.choice([0, 0.01, 0.2]), shape)
    valid = (rng.random(shape) > rng.choice([0, 0.02, 0.3])).astype(np.uint8)
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16) * valid
    inside = np.kron(rng.integers(0, 2, cells), np.ones((8, 8), int)).astype(np.uint8) & valid
    return inside, (rng.random(cells) < rng.choice([0.05, 0.4, 1])).astype(np.uint8), valid, grey


def matching(valid: Image, grey: Grey, interval: IntensityRange) -> Image:
    low, high = interval.greys
    return ((low <= grey) & (grey <= high)).astype(np.uint8) & valid


def refined(
    inside: Image, open_cells: Image, valid: Image, grey: Grey, interval: IntensityRange = MIDDLE
) -> Image:
    fits = matching(valid, grey, interval)
    return refine_by_tv(inside, open_cells, valid, grey, fits, interval.greys)


@settings(deadline=None, max_examples=60)
@given(seeds, st.tuples(st.integers(1, 4), st.integers(1, 5)))
def test_the_kernels_do_what_plain_arrays_do(
    plain_variation: ModuleType, seed: int, squares: tuple[int, int]
) -> None:
    case = random_case(seed, (2 * squares[0], 2 * squares[1]))
    inside, *rest = case
    expected = plain_variation.denoised(inside.copy(), *rest, MIDDLE.low, MIDDLE.high)
    assert np.array_equal(refined(*case), expected)


@settings(deadline=None, max_examples=20)
@given(seeds, st.sampled_from([64, 128]))
def test_panels_change_nothing(seed: int, width: int) -> None:
    case = random_case(seed, (6, 40))
    expected = decided(case)
    with patch.object(total_variation, "_PANEL", width):
        assert np.array_equal(decided(case), expected)


def test_panels_with_less_around_them_may_change_something() -> None:
    cases = [random_case(seed, (6, 40)) for seed in range(40)]
    with patch.object(total_variation, "_PANEL", 64), patch.object(total_variation, "TV_HALO", 0):
        found = [decided(case) for case in cases]
    assert any((decided(case) != other).any() for case, other in zip(cases, found, strict=True))


@settings(deadline=None, max_examples=8)
@given(seeds)
def test_sweeps_end_at_the_minimum_of_total_variation(plain_variation: ModuleType, seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.integers(0, 65536, (10, 13)).astype(np.uint16)
    weights = rng.integers(0, 6000, grey.shape)
    u, flows = plain_variation.evened(grey, weights, 2000)
    half = grey.astype(np.int64) // 2
    variation_of_u, flowing = 0, 0
    for (a, b, share), flow in zip(plain_variation.pairs(grey.shape), flows, strict=True):
        limit = np.minimum(weights[a], weights[b]) * share // 64
        variation_of_u += (limit * np.abs(u[b] - u[a])).sum()
        flowing += (flow * (u[b] - u[a])).sum()
    assert ((u - half) ** 2).sum() > 0
    assert variation_of_u - flowing <= 0.001 * ((half - half.mean()) ** 2).sum()  # no gap: both are optimal
    assert grey.min() // 2 <= u.min() and u.max() <= grey.max() // 2


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_u_stays_between_black_and_white(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.choice([0, 65535, 65530, 3], (32, 48)).astype(np.uint16)
    ones, cells = np.ones(grey.shape, np.uint8), np.ones((4, 6), np.uint8)
    mask = decided_with(IntensityRange(0, 1), ones * 0, cells, ones, grey)
    assert mask.all()


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_a_cut_out_with_reach_around_it_is_decided_as_the_whole(seed: int) -> None:
    assert cut_out_agrees(seed, REFINE_HALO // 8)


def test_a_cut_out_with_less_around_it_may_not_be() -> None:
    assert not all(cut_out_agrees(seed, 2) for seed in range(50))


def decided_with(interval: IntensityRange, *case: Any) -> Image:
    return refined(*case, interval)


def cut_out_agrees(seed: int, margin: int) -> bool:
    """Whether 2 x 4 cells and a pixel around, cut out with cells around them, are as in the whole."""
    case = random_case(seed, (24, 30))
    row, col = 10, 12
    whole = decided(case)[8 * row - 1 : 8 * row + 17, 8 * col - 1 : 8 * col + 33]
    cells = np.s_[row - margin : row + 2 + margin, col - margin : col + 4 + margin]
    pixels = np.s_[8 * (row - margin) : 8 * (row + 2 + margin), 8 * (col - margin) : 8 * (col + 4 + margin)]
    part = tuple(image[cells if k == 1 else pixels] for k, image in enumerate(case))
    first = 8 * margin - 1
    return np.array_equal(decided(part)[first : first + 18, first : first + 34], whole)


def decided(case: tuple[Any, ...]) -> Image:
    inside, *rest = (np.ascontiguousarray(image).copy() for image in case)
    return refined(inside, *rest)


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_cells_that_are_settled_and_do_not_touch_others_stay_as_they_are(seed: int) -> None:
    inside, unsettled_cells, valid, grey = random_case(seed, (12, 14))
    found = decided((inside, unsettled_cells, valid, grey))
    far = np.kron(ndimage.maximum_filter(unsettled_cells, 3, mode="constant"), np.ones((8, 8))) == 0
    assert np.array_equal(found[far], inside[far])
    assert not (found & (1 - valid)).any()


@settings(deadline=None, max_examples=30)
@given(seeds, st.integers(0, 65535))
def test_an_image_of_one_grey_is_as_its_grey(seed: int, value: int) -> None:
    inside, _, valid, _ = random_case(seed, (6, 4))
    found = decided((inside, np.ones((6, 4), np.uint8), valid, valid * np.uint16(value)))
    assert np.array_equal(found, valid * np.uint8(MIDDLE.low <= value / 65535 <= MIDDLE.high))


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_greys_that_all_lie_in_the_range_stay_in_it(seed: int) -> None:
    _, _, valid, grey = random_case(seed, (4, 6))
    narrow = (30000 + grey // 16) * valid
    found = decided((valid * np.uint8(0), np.ones((4, 6), np.uint8), valid, narrow))
    assert np.array_equal(found, valid)


def test_a_noisy_shore_is_straight_and_alone() -> None:
    rng = np.random.default_rng(3)
    v = np.where(np.arange(128) < 61, 0.42, 0.68) + rng.normal(0, 0.1, (128, 128))
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16)
    ones = np.ones((128, 128), np.uint8)
    found = refined(ones * 0, np.ones((16, 16), np.uint8), ones, grey, IntensityRange(0.55, 1))
    truth = np.broadcast_to(np.arange(128) >= 61, found.shape)
    assert ((found > 0) & truth).sum() / ((found > 0) | truth).sum() > 0.98
    assert ndimage.label(found)[1] == 1


def blocks_of(v: NDArray[np.float64]) -> BlockMap:
    """A block map of these means of cells."""
    blocks = BlockMap.empty((8 * v.shape[0], 8 * v.shape[1]))
    blocks.sums[: v.shape[0], : v.shape[1]] = np.rint(v * 65535 * 64)
    blocks.counts[: v.shape[0], : v.shape[1]] = 64
    return blocks


def test_cells_far_from_the_ends_of_a_range_are_settled() -> None:
    v = np.full((8, 16), 0.3)
    v[:, 8:] = 0.7
    blocks = blocks_of(v)
    inside = np.zeros((8, 16), np.uint8)
    inside[:, 8:] = 1
    found = mixed_cells(blocks, inside, 0.5, 1.0)
    assert found[:, 7:9].all() and not found[:, :7].any() and not found[:, 9:].any()


def test_a_thin_road_leaves_the_cells_that_it_crosses_and_those_around_unsettled() -> None:
    v = np.full((8, 8), 0.42)
    v[:, 4] += 0.26 * 3 / 8  # three pixels of eight
    found = mixed_cells(blocks_of(v), np.zeros((8, 8), np.uint8), 0.55, 1.0)
    assert found[:, 3:6].all() and not found[:, :3].any() and not found[:, 6:].any()


def test_a_cell_that_is_not_as_its_leaf_is_unsettled_and_one_without_pixels_is_not() -> None:
    blocks = blocks_of(np.full((8, 8), 0.3))
    blocks.counts[:, :4] = blocks.sums[:, :4] = 0
    found = mixed_cells(blocks, np.ones((8, 8), np.uint8), 0.5, 1.0)
    assert found[:, 4:].all() and not found[:, :4].any()


@pytest.mark.parametrize("low, high", [(0.0, 0.5), (0.5, 1.0)])
def test_nothing_lies_beyond_the_ends_of_v(low: float, high: float) -> None:
    blocks = blocks_of(np.full((8, 8), low if low == 0 else high))
    assert not mixed_cells(blocks, np.ones((8, 8), np.uint8), low, high).any()
