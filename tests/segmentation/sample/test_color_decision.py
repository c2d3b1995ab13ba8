"""Classification with further bands is that of a plain version, and of the grey where a band is the grey."""

import numpy as np
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.blocks.lbp import SYMBOLS, UNCOUNTED
from uavseg.segmentation.sample.pixel_decision import (
    WINDOW_RADIUS,
    ColorPlane,
    PixelWeights,
    classify_pixels,
)


def classify_plainly(cells, valid, grey, symbols, weights, colors):
    """The weight of each pixel, summed over its window, by arrays."""
    total = np.zeros(valid.shape, np.int64)
    inner = total[1:-1, 1:-1]
    inner += weights.greys[grey[1:-1, 1:-1] >> 10]
    for table, image in zip((weights.texture, weights.coarse), symbols, strict=True):
        around = np.pad(image, (inner.shape[0] - image.shape[0]) // 2, constant_values=UNCOUNTED)
        counted = around != UNCOUNTED
        inner += np.where(counted, table[np.where(counted, around, 0)], 0)
    for color in colors:
        inner += np.where(color.valid, color.weights[color.grey >> 10], 0)[1:-1, 1:-1]
    inner *= valid[1:-1, 1:-1]
    sides = cells.repeat(8, 0).repeat(8, 1)
    return (valid != 0) & ((sides == 1) | ((sides == 2) & (box_sums(total) > 0)))


def box_sums(values):
    """Sum over the window of each pixel, as far as it lies within the array."""
    for axis in (0, 1):
        sums = np.concatenate([np.zeros_like(values.take([0], axis)), values.cumsum(axis)], axis)
        ends = np.arange(values.shape[axis])
        low, high = np.maximum(ends - WINDOW_RADIUS, 0), np.minimum(ends + WINDOW_RADIUS + 1, len(ends))
        values = sums.take(high, axis) - sums.take(low, axis)
    return values


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
def test_the_decision_is_that_of_a_plain_version(seed: int) -> None:
    cells, valid, grey, names, coarse, weights = tile(seed)
    dice = np.random.default_rng(seed)
    planes = [
        ColorPlane(dice.permuted(grey), (dice.random(valid.shape) < 0.8).view(np.uint8), weights.greys[::-1])
        for _ in range(seed % 3)
    ]
    image = cells, valid, grey, (names, coarse), weights
    assert np.array_equal(classify_pixels(*image, planes), classify_plainly(*image, planes))


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_a_band_that_is_the_grey_adds_its_weights_once_more(seed: int) -> None:
    cells, valid, grey, names, coarse, weights = tile(seed)
    doubled = PixelWeights(weights.texture, 2 * weights.greys, weights.coarse)
    expected = classify_pixels(cells, valid, grey, (names, coarse), doubled)
    plane = ColorPlane(grey, valid, weights.greys)
    assert np.array_equal(classify_pixels(cells, valid, grey, (names, coarse), weights, [plane]), expected)


def test_a_pixel_that_is_not_valid_in_a_band_has_no_weight_there() -> None:
    cells, valid, grey, names, coarse, weights = tile(3)
    plane = ColorPlane(grey, np.zeros_like(valid), np.full(64, 10**6))
    expected = classify_pixels(cells, valid, grey, (names, coarse), weights)
    assert np.array_equal(classify_pixels(cells, valid, grey, (names, coarse), weights, [plane]), expected)
