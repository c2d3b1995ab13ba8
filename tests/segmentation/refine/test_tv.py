"""Refinement by total variation agrees with plain arrays, and depends on a bounded neighbourhood."""

from types import ModuleType
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.refine import total_variation
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.total_variation import refine_by_tv, refine_classes_by_tv

Image = NDArray[np.uint8]
Grey = NDArray[np.uint16]
seeds = st.integers(0, 100_000)
MIDDLE = IntensityRange(0.35, 0.65)


def random_case(seed: int, cells: tuple[int, int]) -> tuple[Image, Grey]:
    """Valid pixels with holes, and patches of grey with noise."""
    rng = np.random.default_rng(seed)
    side = int(rng.choice([3, 9, 20]))
    shape = (8 * cells[0], 8 * cells[1])
    patches = rng.choice([0.2, 0.4, 0.5, 0.6, 0.9], [n // side + 1 for n in shape])
    v = patches.repeat(side, 0).repeat(side, 1)[: shape[0], : shape[1]]
    v = v + rng.normal(0, rng.choice([0, 0.01, 0.2]), shape)
    valid = (rng.random(shape) > rng.choice([0, 0.02, 0.3])).astype(np.uint8)
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16) * valid
    return valid, grey


def in_range_of(valid: Image, grey: Grey, interval: IntensityRange) -> Image:
    low, high = interval.greys
    return ((low <= grey) & (grey <= high)).astype(np.uint8) & valid


def refined(valid: Image, grey: Grey, interval: IntensityRange = MIDDLE) -> Image:
    return refine_by_tv(in_range_of(valid, grey, interval), valid, grey, interval.greys)


@pytest.mark.slow
@settings(max_examples=60)
@given(seeds, st.tuples(st.integers(1, 4), st.integers(1, 5)))
def test_the_kernels_agree_with_plain_arrays(
    plain_variation: ModuleType, seed: int, squares: tuple[int, int]
) -> None:
    case = random_case(seed, (2 * squares[0], 2 * squares[1]))
    expected = plain_variation.denoise(*case, MIDDLE.low, MIDDLE.high)
    assert np.array_equal(refined(*case), expected)


@settings(max_examples=20)
@given(seeds, st.sampled_from([64, 128]))
def test_panels_change_nothing(seed: int, width: int) -> None:
    case = random_case(seed, (6, 40))
    expected = refined(*case)
    with patch.object(total_variation, "_PANEL", width):
        assert np.array_equal(refined(*case), expected)


def test_panels_without_a_halo_may_differ() -> None:
    cases = [random_case(seed, (6, 40)) for seed in range(40)]
    with patch.object(total_variation, "_PANEL", 64), patch.object(total_variation, "TV_HALO", 0):
        found = [refined(*case) for case in cases]
    assert any((refined(*case) != other).any() for case, other in zip(cases, found, strict=True))


@settings(max_examples=30)
@given(seeds)
def test_u_stays_between_black_and_white(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.choice([0, 65535, 65530, 3], (32, 48)).astype(np.uint16)
    assert refined(np.ones(grey.shape, np.uint8), grey, IntensityRange(0, 1)).all()


@settings(max_examples=30)
@given(seeds)
def test_a_crop_with_a_halo_is_refined_as_the_whole(seed: int) -> None:
    assert crop_agrees(seed, REFINE_HALO // 8)


def test_a_crop_with_a_smaller_halo_may_differ() -> None:
    assert not all(crop_agrees(seed, 2) for seed in range(50))


def crop_agrees(seed: int, margin: int) -> bool:
    """Whether 2 x 4 cells and a border of a pixel, cropped with a margin of cells, are as in the whole."""
    case = random_case(seed, (24, 30))
    row, col = 10, 12
    whole = refined(*case)[8 * row - 1 : 8 * row + 17, 8 * col - 1 : 8 * col + 33]
    pixels = np.s_[8 * (row - margin) : 8 * (row + 2 + margin), 8 * (col - margin) : 8 * (col + 4 + margin)]
    part = [np.ascontiguousarray(image[pixels]) for image in case]
    first = 8 * margin - 1
    return np.array_equal(refined(*part)[first : first + 18, first : first + 34], whole)


@settings(max_examples=30)
@given(seeds)
def test_cells_that_neither_have_two_sides_nor_touch_such_cells_keep_their_own_values(seed: int) -> None:
    valid, grey = random_case(seed, (12, 14))
    found, own = refined(valid, grey), in_range_of(valid, grey, MIDDLE)
    sides = [mask.reshape(12, 8, 14, 8).any(axis=(1, 3)) for mask in (own, valid & (1 - own))]
    far = ~ndimage.maximum_filter(sides[0] & sides[1], 3, mode="constant").repeat(8, 0).repeat(8, 1)
    assert np.array_equal(found[far], own[far])
    assert not (found & (1 - valid)).any()


@settings(max_examples=30)
@given(seeds, st.integers(0, 65535))
def test_an_image_of_one_grey_is_inside_or_outside_as_its_grey(seed: int, value: int) -> None:
    valid, _ = random_case(seed, (6, 4))
    found = refined(valid, valid * np.uint16(value))
    assert np.array_equal(found, valid * np.uint8(MIDDLE.low <= value / 65535 <= MIDDLE.high))


@settings(max_examples=30)
@given(seeds)
def test_greys_that_all_lie_in_the_range_stay_in_it(seed: int) -> None:
    valid, grey = random_case(seed, (4, 6))
    narrow = (30000 + grey // 16) * valid
    assert np.array_equal(refined(valid, narrow), valid)


def test_a_noisy_shore_becomes_one_straight_region() -> None:
    rng = np.random.default_rng(3)
    v = np.where(np.arange(128) < 61, 0.42, 0.68) + rng.normal(0, 0.1, (128, 128))
    grey = (np.clip(v, 0, 1) * 65535).astype(np.uint16)
    ones = np.ones((128, 128), np.uint8)
    found = refined(ones, grey, IntensityRange(0.55, 1))
    truth = np.broadcast_to(np.arange(128) >= 61, found.shape)
    assert ((found > 0) & truth).sum() / ((found > 0) | truth).sum() > 0.98
    assert ndimage.label(found)[1] == 1


@settings(max_examples=40)
@given(seeds, st.tuples(st.integers(1, 4), st.integers(1, 5)))
def test_one_kind_is_refined_as_its_range(seed: int, squares: tuple[int, int]) -> None:
    valid, grey = random_case(seed, (2 * squares[0], 2 * squares[1]))
    low, high = MIDDLE.greys
    table = np.zeros(65536, np.uint8)
    table[low : high + 1] = 1
    found = refine_classes_by_tv(table[grey] * valid, valid, grey, table)
    assert np.array_equal(found, refined(valid, grey))


@settings(max_examples=20)
@given(seeds)
def test_a_crop_of_several_kinds_with_a_halo_is_refined_as_the_whole(seed: int) -> None:
    valid, grey = random_case(seed, (30, 30))
    table = np.searchsorted([0.3, 0.45, 0.55, 0.8], np.arange(65536) / 65535).astype(np.uint8)
    whole = refine_classes_by_tv(table[grey] * valid, valid, grey, table)
    part = [np.ascontiguousarray(image[:176, :176]) for image in (valid, grey)]
    found = refine_classes_by_tv(table[part[1]] * part[0], *part, table)
    inner = 176 - REFINE_HALO + 1
    assert np.array_equal(found[:inner, :inner], whole[:inner, :inner])
