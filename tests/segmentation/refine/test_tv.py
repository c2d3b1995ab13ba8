"""Refinement by total variation agrees with plain arrays, and depends on a bounded neighbourhood."""

from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.params import IntensityRange
from uavseg.segmentation.refine import total_variation
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.tv import refine_by_tv, refine_kinds_by_tv

Image = NDArray[np.uint8]
Grey = NDArray[np.uint16]
seeds = st.integers(0, 100_000)
MIDDLE = IntensityRange(0.35, 0.65)


def random_case(seed: int, cells: tuple[int, int]) -> tuple[Image, Image, Image, Grey]:
    """Patches of grey with noise, holes in the valid pixels, cells inside and mixed cells."""
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


def in_range_of(valid: Image, grey: Grey, interval: IntensityRange) -> Image:
    low, high = interval.greys
    return ((low <= grey) & (grey <= high)).astype(np.uint8) & valid


def refined(
    inside: Image, mixed: Image, valid: Image, grey: Grey, interval: IntensityRange = MIDDLE
) -> Image:
    in_range = in_range_of(valid, grey, interval)
    return refine_by_tv(inside, mixed, valid, grey, in_range, interval.greys)


@settings(max_examples=60)
@given(seeds, st.tuples(st.integers(1, 4), st.integers(1, 5)))
def test_the_kernels_agree_with_plain_arrays(
    plain_variation: ModuleType, seed: int, squares: tuple[int, int]
) -> None:
    case = random_case(seed, (2 * squares[0], 2 * squares[1]))
    inside, *rest = case
    expected = plain_variation.denoise(inside.copy(), *rest, MIDDLE.low, MIDDLE.high)
    assert np.array_equal(refined(*case), expected)


@settings(max_examples=20)
@given(seeds, st.sampled_from([64, 128]))
def test_panels_change_nothing(seed: int, width: int) -> None:
    case = random_case(seed, (6, 40))
    expected = refined_copy(case)
    with patch.object(total_variation, "_PANEL", width):
        assert np.array_equal(refined_copy(case), expected)


def test_panels_without_a_halo_may_differ() -> None:
    cases = [random_case(seed, (6, 40)) for seed in range(40)]
    with patch.object(total_variation, "_PANEL", 64), patch.object(total_variation, "TV_HALO", 0):
        found = [refined_copy(case) for case in cases]
    assert any((refined_copy(case) != other).any() for case, other in zip(cases, found, strict=True))


@settings(max_examples=30)
@given(seeds)
def test_u_stays_between_black_and_white(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.choice([0, 65535, 65530, 3], (32, 48)).astype(np.uint16)
    ones, cells = np.ones(grey.shape, np.uint8), np.ones((4, 6), np.uint8)
    mask = refined_in(IntensityRange(0, 1), ones * 0, cells, ones, grey)
    assert mask.all()


@settings(max_examples=30)
@given(seeds)
def test_a_crop_with_a_halo_is_refined_as_the_whole(seed: int) -> None:
    assert crop_agrees(seed, REFINE_HALO // 8)


def test_a_crop_with_a_smaller_halo_may_differ() -> None:
    assert not all(crop_agrees(seed, 2) for seed in range(50))


def refined_in(interval: IntensityRange, *case: Any) -> Image:
    return refined(*case, interval)


def crop_agrees(seed: int, margin: int) -> bool:
    """Whether 2 x 4 cells and a border of a pixel, cropped with a margin of cells, are as in the whole."""
    case = random_case(seed, (24, 30))
    row, col = 10, 12
    whole = refined_copy(case)[8 * row - 1 : 8 * row + 17, 8 * col - 1 : 8 * col + 33]
    cells = np.s_[row - margin : row + 2 + margin, col - margin : col + 4 + margin]
    pixels = np.s_[8 * (row - margin) : 8 * (row + 2 + margin), 8 * (col - margin) : 8 * (col + 4 + margin)]
    part = tuple(image[cells if k == 1 else pixels] for k, image in enumerate(case))
    first = 8 * margin - 1
    return np.array_equal(refined_copy(part)[first : first + 18, first : first + 34], whole)


def refined_copy(case: tuple[Any, ...]) -> Image:
    inside, *rest = (np.ascontiguousarray(image).copy() for image in case)
    return refined(inside, *rest)


@settings(max_examples=30)
@given(seeds)
def test_cells_that_neither_are_mixed_nor_touch_mixed_cells_do_not_change(seed: int) -> None:
    inside, mixed, valid, grey = random_case(seed, (12, 14))
    found = refined_copy((inside, mixed, valid, grey))
    far = np.kron(ndimage.maximum_filter(mixed, 3, mode="constant"), np.ones((8, 8))) == 0
    assert np.array_equal(found[far], inside[far])
    assert not (found & (1 - valid)).any()


@settings(max_examples=30)
@given(seeds, st.integers(0, 65535))
def test_an_image_of_one_grey_is_inside_or_outside_as_its_grey(seed: int, value: int) -> None:
    inside, _, valid, _ = random_case(seed, (6, 4))
    found = refined_copy((inside, np.ones((6, 4), np.uint8), valid, valid * np.uint16(value)))
    assert np.array_equal(found, valid * np.uint8(MIDDLE.low <= value / 65535 <= MIDDLE.high))


@settings(max_examples=30)
@given(seeds)
def test_greys_that_all_lie_in_the_range_stay_in_it(seed: int) -> None:
    _, _, valid, grey = random_case(seed, (4, 6))
    narrow = (30000 + grey // 16) * valid
    found = refined_copy((valid * np.uint8(0), np.ones((4, 6), np.uint8), valid, narrow))
    assert np.array_equal(found, valid)


def test_a_noisy_shore_becomes_one_straight_region() -> None:
    rng = np.random.default_rng(3)
    v = np.where(np.arange(128) < 61, 0.42, 0.68) + rng.normal(0, 0.1, (128, 128))
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16)
    ones = np.ones((128, 128), np.uint8)
    found = refined(ones * 0, np.ones((16, 16), np.uint8), ones, grey, IntensityRange(0.55, 1))
    truth = np.broadcast_to(np.arange(128) >= 61, found.shape)
    assert ((found > 0) & truth).sum() / ((found > 0) | truth).sum() > 0.98
    assert ndimage.label(found)[1] == 1


@settings(max_examples=40)
@given(seeds, st.tuples(st.integers(1, 4), st.integers(1, 5)))
def test_one_kind_is_refined_as_its_range(seed: int, squares: tuple[int, int]) -> None:
    inside, mixed, valid, grey = random_case(seed, (2 * squares[0], 2 * squares[1]))
    low, high = MIDDLE.greys
    table = np.zeros(65536, np.uint8)
    table[low : high + 1] = 1
    found = refine_kinds_by_tv(inside.copy(), mixed, valid, grey, table)
    assert np.array_equal(found, refined(inside, mixed, valid, grey))


@settings(max_examples=20)
@given(seeds)
def test_a_crop_of_several_kinds_with_a_halo_is_refined_as_the_whole(seed: int) -> None:
    _, mixed, valid, grey = random_case(seed, (30, 30))
    table = np.searchsorted([0.3, 0.45, 0.55, 0.8], np.arange(65536) / 65535).astype(np.uint8)
    kinds = np.random.default_rng(seed).integers(0, 5, (30, 30)).astype(np.uint8).repeat(8, 0).repeat(8, 1)
    kinds *= valid
    whole = refine_kinds_by_tv(kinds.copy(), mixed, valid, grey, table)
    part = [np.ascontiguousarray(image[:176, :176]).copy() for image in (kinds, valid, grey)]
    found = refine_kinds_by_tv(part[0], np.ascontiguousarray(mixed[:22, :22]), *part[1:], table)
    inner = 176 - REFINE_HALO + 1
    assert np.array_equal(found[:inner, :inner], whole[:inner, :inner])
