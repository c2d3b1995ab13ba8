"""A detail: what is narrower is left out, cut or closed; what is wider stays; partitions stay partitions."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.refine.detail import Detail, PixelDisc, apply_detail, opening_mask

Image = NDArray[np.uint8]
SEEDS = st.integers(0, 100_000)
DETAILS = st.builds(Detail, st.integers(1, 12), st.integers(1, 12), st.booleans())


def scene(seed: int, shape: tuple[int, int] = (60, 70), classes: int = 3) -> tuple[Image, Image]:
    """Patches of several kinds with specks, and nodata in places."""
    rng = np.random.default_rng(seed)
    smooth = ndimage.gaussian_filter(rng.standard_normal(shape), rng.uniform(1, 6))
    image = np.digitize(smooth, np.quantile(smooth, np.arange(1, classes) / classes)).astype(np.uint8)
    specks = rng.random(shape) < rng.choice([0, 0.02, 0.2])
    image[specks] = rng.integers(0, classes, int(specks.sum()))
    valid = (ndimage.gaussian_filter(rng.standard_normal(shape), 3) < rng.choice([0.1, 9])).astype(np.uint8)
    return image * valid, valid


def of(image: Image, detail: Detail) -> Image:
    return apply_detail(image, np.ones_like(image), detail)


@given(SEEDS, DETAILS)
def test_nothing_narrower_than_the_detail_remains(seed: int, detail: Detail) -> None:
    image, valid = scene(seed)
    found = apply_detail(image, valid, detail)
    if found is image or detail.cover:
        return
    covered = opening_mask(found, valid, PixelDisc(detail.rows, detail.cols))
    assert (covered[found > 0] > 0).all()
    assert not found[valid == 0].any()


@given(SEEDS, DETAILS)
def test_levels_stay_a_partition_of_what_is_valid(seed: int, detail: Detail) -> None:
    image, valid = scene(seed)
    image = (image + 1) * valid
    found = apply_detail(image, valid, Detail(detail.rows, detail.cols, cover=True))
    assert np.array_equal(found > 0, valid > 0)
    assert set(np.unique(found)) <= set(np.unique(image))


@pytest.mark.slow
@given(SEEDS, DETAILS, st.integers(0, 60), st.integers(0, 70))
def test_the_result_at_a_pixel_depends_on_no_pixel_beyond_the_halo(
    seed: int, detail: Detail, row: int, col: int
) -> None:
    halo = detail.halo
    image, valid = scene(seed, (60 + 2 * halo, 70 + 2 * halo))
    whole = apply_detail(image, valid, detail)
    part = np.s_[row : row + 2 * halo + 1, col : col + 2 * halo + 1]
    alone = apply_detail(image[part].copy(), valid[part].copy(), detail)
    middle = image[part].shape[0] // 2, image[part].shape[1] // 2
    assert alone[middle] == whole[row + middle[0], col + middle[1]]


@given(SEEDS, DETAILS)
def test_a_turned_image_gives_turned_kinds(seed: int, detail: Detail) -> None:
    image, valid = scene(seed)
    turned = Detail(detail.cols, detail.rows, detail.cover)
    expected = apply_detail(image, valid, detail).T
    assert np.array_equal(apply_detail(image.T.copy(), valid.T.copy(), turned), expected)
    flipped = apply_detail(image[::-1].copy(), valid[::-1].copy(), detail)
    assert np.array_equal(flipped[::-1].T, expected)


@pytest.mark.parametrize("side", range(3, 13))
def test_a_second_time_changes_hardly_anything(side: int) -> None:
    """A share of the pixels of many scenes: one whose patches are as wide as the detail may change by 2 %."""
    changed = []
    for seed in range(20):
        image, valid = scene(seed, (90, 90), 2)
        once = apply_detail(image, valid, Detail(side, side))
        changed.append(np.mean(apply_detail(once, valid, Detail(side, side)) != once))
    assert np.mean(changed) < 0.005


@given(SEEDS, st.integers(2, 12))
def test_wide_kinds_with_smooth_borders_stay(seed: int, side: int) -> None:
    """What is open by a disc, and whose complement is, does not change at that disc's size."""
    image, valid = scene(seed, classes=2)
    detail = Detail(side, side)
    disc = PixelDisc(side, side)
    if opening_mask(image, valid, disc)[valid > 0].all():
        assert np.array_equal(apply_detail(image, valid, detail), image)


@pytest.mark.parametrize("width", range(1, 14))
@pytest.mark.parametrize("side", [2, 3, 4, 7, 10])
def test_a_bar_stays_from_the_detail_on_and_a_gap_from_there(side: int, width: int) -> None:
    bar = np.zeros((60, 80), np.uint8)
    bar[20 : 20 + width] = 1
    assert of(bar, Detail(side, side)).any() == (width >= side)
    assert np.array_equal(of(bar, Detail(side, side)), bar if width >= side else 0 * bar)
    assert np.array_equal(of(1 - bar, Detail(side, side)), 1 - bar if width >= side else np.ones_like(bar))


def test_sides_are_those_of_rows_and_columns() -> None:
    bar = np.zeros((60, 80), np.uint8)
    bar[20:25] = 1
    assert of(bar, Detail(5, 11)).any() and not of(bar, Detail(6, 1)).any()
    assert of(bar.T.copy(), Detail(11, 5)).any() and not of(bar.T.copy(), Detail(1, 6)).any()


def test_a_neck_is_cut_and_the_two_parts_stay_whole() -> None:
    image = np.zeros((80, 100), np.uint8)
    image[10:30, :] = image[50:70, :] = 1
    apart = image.copy()
    image[30:50, 40:45] = 1
    found = of(image, Detail(8, 8))
    assert ndimage.label(found)[1] == 2 and not found[34:46].any()
    assert found[apart > 0].all() and found.sum() < apart.sum() + 40  # its ends are rounded
    assert ndimage.label(of(image, Detail(5, 5)))[1] == 1


def test_specks_and_pinholes_neither_break_nor_join() -> None:
    """An opening by the wanted disc alone leaves nothing of this."""
    rng = np.random.default_rng(0)
    truth = np.zeros((120, 120), np.uint8)
    truth[:, :60] = 1
    noisy = truth ^ (rng.random(truth.shape) < 0.04)
    disc = PixelDisc(12, 12)
    assert opening_mask(noisy, np.ones_like(noisy), disc).mean() < 0.5
    assert np.mean(of(noisy, Detail(12, 12)) != truth) < 0.02


def test_a_narrow_class_goes_to_its_neighbours_half_each() -> None:
    image = np.ones((40, 61), np.uint8)
    image[:, 28:33] = 3
    image[:, 33:] = 2
    found = of(image, Detail(8, 8))
    assert set(np.unique(found)) == {1, 2}
    assert (found[:, :30] == 1).all() and (found[:, 31:] == 2).all()


def test_fine_stripes_are_left_out_and_levels_keep_them() -> None:
    stripes = (np.indices((120, 120))[1] // 3 % 2 + 1).astype(np.uint8)
    assert not of(stripes, Detail(12, 12))[30:90, 30:90].any()
    assert np.array_equal(of(stripes, Detail(12, 12, cover=True))[30:90, 30:90], stripes[30:90, 30:90])
