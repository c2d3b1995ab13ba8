"""Classification with further bands is that of the kernel where there are none."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.pixel_decision import (
    ColorPlane,
    PixelWeights,
    classify_colored_pixels,
    classify_pixels,
)


def tile(seed: int):
    """Cells, validity, grey, symbols and weights at random."""
    dice = np.random.default_rng(seed)
    rows, cols = 8 * dice.integers(3, 7), 8 * dice.integers(3, 7)
    cells = dice.integers(0, 3, (rows // 8, cols // 8)).astype(np.uint8)
    valid = (dice.random((rows, cols)) < 0.9).astype(np.uint8)
    grey = dice.integers(0, 65536, (rows, cols)).astype(np.uint16)
    names = dice.integers(0, SYMBOLS, (rows - 2, cols - 2)).astype(np.uint16)
    coarse = dice.integers(0, SYMBOLS, (rows - 6, cols - 6)).astype(np.uint16)
    for each in (names, coarse):
        each[dice.random(each.shape) < 0.2] = UNCOUNTED
    weights = PixelWeights(*(dice.integers(-900, 901, n) for n in (SYMBOLS, 64, SYMBOLS)))
    return cells, valid, grey, names, coarse, weights


@settings(max_examples=60)
@given(st.integers(0, 10_000))
def test_without_further_bands_it_is_the_decision_by_texture_and_grey(seed: int) -> None:
    cells, valid, grey, names, coarse, weights = tile(seed)
    expected = classify_pixels(cells, valid, grey, names, coarse, weights)
    assert np.array_equal(classify_colored_pixels(cells, valid, grey, (names, coarse), weights, []), expected)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_a_band_that_is_the_grey_adds_its_weights_once_more(seed: int) -> None:
    cells, valid, grey, names, coarse, weights = tile(seed)
    doubled = PixelWeights(weights.texture, 2 * weights.greys, weights.coarse)
    expected = classify_pixels(cells, valid, grey, names, coarse, doubled)
    plane = ColorPlane(grey, valid, weights.greys)
    assert np.array_equal(
        classify_colored_pixels(cells, valid, grey, (names, coarse), weights, [plane]), expected
    )


def test_a_pixel_that_is_not_valid_in_a_band_has_no_weight_there() -> None:
    cells, valid, grey, names, coarse, weights = tile(3)
    plane = ColorPlane(grey, np.zeros_like(valid), np.full(64, 10**6))
    expected = classify_pixels(cells, valid, grey, names, coarse, weights)
    assert np.array_equal(
        classify_colored_pixels(cells, valid, grey, (names, coarse), weights, [plane]), expected
    )
