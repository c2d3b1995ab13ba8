"""Discs of pixels, maxima over them, and the opening of label images by them."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.refine.detail import PixelDisc, _disc_maxima, opening_mask

SIDES = st.integers(1, 9)
DISCS = st.builds(PixelDisc, SIDES, SIDES)
IMAGES = st.tuples(st.integers(0, 100_000), st.integers(9, 20), st.integers(9, 20))


def opened(mask: NDArray[np.bool_], disc: PixelDisc) -> NDArray[np.bool_]:
    """Opening by its definition: the union of all translates of the disc that lie in the mask."""
    found = np.zeros_like(mask)
    rows, cols = mask.shape[0] - disc.rows + 1, mask.shape[1] - disc.cols + 1
    for row in range(rows):
        for col in range(cols):
            part = np.s_[row : row + disc.rows, col : col + disc.cols]
            if mask[part][disc.pixels].all():
                found[part] |= disc.pixels
    return found


@pytest.mark.slow
@given(DISCS)
def test_a_disc_is_as_wide_as_its_sides_and_symmetric(disc: PixelDisc) -> None:
    pixels = disc.pixels
    assert pixels.shape == (disc.rows, disc.cols)
    assert pixels.any(axis=1).all() and pixels.any(axis=0).all()
    assert np.array_equal(pixels, pixels[::-1]) and np.array_equal(pixels, pixels[:, ::-1])
    assert np.array_equal(pixels.T, PixelDisc(disc.cols, disc.rows).pixels)


@pytest.mark.parametrize("side", [9, 32, 128])
def test_a_large_disc_has_the_area_of_a_circle(side: int) -> None:
    assert PixelDisc(side, side).pixels.sum() == pytest.approx(np.pi * side**2 / 4, rel=0.1)


@given(IMAGES, DISCS)
def test_maxima_over_discs_are_those_of_scipy(image: tuple[int, int, int], disc: PixelDisc) -> None:
    seed, *shape = image
    pixels = np.random.default_rng(seed).integers(0, 256, shape, np.uint8)
    found = _disc_maxima(pixels, disc)
    expected = ndimage.maximum_filter(pixels, footprint=disc.pixels)
    row, col = disc.rows // 2, disc.cols // 2
    assert np.array_equal(found, expected[row : row + found.shape[0], col : col + found.shape[1]])


@pytest.mark.slow
@given(IMAGES, DISCS, st.sampled_from([0.7, 0.9, 0.97]))
def test_the_opening_of_each_kind_is_that_of_morphology(
    image: tuple[int, int, int], disc: PixelDisc, share: float
) -> None:
    seed, *shape = image
    rng = np.random.default_rng(seed)
    own, others = rng.integers(0, 4), rng.integers(0, 4, shape)
    classes = np.where(rng.random(shape) < share, own, others).astype(np.uint8)
    covered = opening_mask(classes, np.ones_like(classes), disc)
    border = max(disc.rows, disc.cols)
    expected = np.zeros(shape, bool)
    for kind in range(4):
        expected |= opened(classes == kind, disc)
    inner = np.s_[border:-border, border:-border]  # discs that cross the edge fit by what is inside
    assert np.array_equal(covered[inner] > 0, expected[inner])
    assert (covered[expected] > 0).all()


def test_what_is_not_valid_fits_every_kind_but_holds_no_centre() -> None:
    classes = np.ones((20, 20), np.uint8)
    classes[:, 10:] = 0
    valid = np.ones_like(classes)
    valid[:, 10:] = 0
    valid[:, :6] = 0
    assert opening_mask(classes, valid, PixelDisc(9, 9))[:, 6:10].all()
    classes[:, 8] = 0  # two columns of 1, one of 0 and one of 1 between what is not valid
    assert not opening_mask(classes, valid, PixelDisc(9, 9)).any()
