"""Classification of pixels agrees with a plain version, and a halo is enough for a tile."""

import numpy as np
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.blocks.lbp import UNCOUNTED
from uavseg.segmentation.sample.g_scores import TextureModel
from uavseg.segmentation.sample.pixel_decision import (
    DECISION_HALO,
    WINDOW_RADIUS,
    PixelWeights,
    classify_pixels,
    undecided_cells,
)


def model(rng: np.random.Generator) -> TextureModel:
    return TextureModel(rng.integers(0, 9, 2048), rng.integers(0, 900, 64), rng.integers(0, 9, 2048))


def picture(seed: int, rows: int, cols: int) -> tuple[np.ndarray, ...]:
    """Cells, validity, grey, symbols and coarse symbols."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 3, (rows // 8, cols // 8)).astype(np.uint8)
    valid = (rng.random((rows, cols)) < 0.9).astype(np.uint8)
    grey = rng.integers(0, 65536, (rows, cols)).astype(np.uint16) * valid
    symbols = rng.integers(0, 2048, (rows - 2, cols - 2)).astype(np.uint16)
    symbols[rng.random(symbols.shape) < 0.1] = UNCOUNTED
    coarse = rng.permuted(symbols, axis=None)[2:-2, 2:-2].copy()
    return cells, valid, grey, symbols, coarse


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), rows=st.integers(1, 5), cols=st.integers(1, 5))
def test_pixels_are_classified_as_by_a_plain_version(seed: int, rows: int, cols: int) -> None:
    cells, valid, grey, symbols, coarse = picture(seed, 8 * rows, 8 * cols)
    rng = np.random.default_rng(seed)
    weights = PixelWeights.between(model(rng), model(rng))
    found = classify_pixels(cells, valid, grey, (symbols, coarse), weights)
    weight = np.zeros(valid.shape, np.int64)
    texture = np.where(symbols == UNCOUNTED, 0, weights.texture[symbols % 2048])
    weight[1:-1, 1:-1] = (texture + weights.greys[grey[1:-1, 1:-1] // 1024]) * valid[1:-1, 1:-1]
    mean = np.where(coarse == UNCOUNTED, 0, weights.coarse[coarse % 2048])
    weight[3:-3, 3:-3] += mean * valid[3:-3, 3:-3]
    for row, col in np.ndindex(valid.shape):
        around = weight[
            max(row - WINDOW_RADIUS, 0) : row + WINDOW_RADIUS + 1,
            max(col - WINDOW_RADIUS, 0) : col + WINDOW_RADIUS + 1,
        ]
        kind = cells[row // 8, col // 8]
        assert found[row, col] == (valid[row, col] and (kind == 1 or (kind == 2 and around.sum() > 0)))


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), row=st.integers(0, 3), col=st.integers(0, 3))
def test_a_crop_with_a_halo_is_classified_as_the_whole(seed: int, row: int, col: int) -> None:
    """Exact on a border of one pixel too, which the tracer reads."""
    cells, valid, grey, symbols, coarse = picture(seed, 96, 96)
    rng = np.random.default_rng(seed)
    weights = PixelWeights.between(model(rng), model(rng))
    whole = classify_pixels(cells, valid, grey, (symbols, coarse), weights)
    top, left, end = 8 * row, 8 * col, 16 + 2 * DECISION_HALO
    part = np.s_[top : top + end, left : left + end]
    inner, deep = (np.s_[top : top + end - less, left : left + end - less] for less in (2, 6))
    own = np.s_[row : row + end // 8, col : col + end // 8]
    pieces = (cells[own], valid[part], grey[part], symbols[inner], coarse[deep])
    *image, fine, means = (piece.copy() for piece in pieces)
    crop = classify_pixels(*image, (fine, means), weights)
    near = np.s_[DECISION_HALO - 1 : 1 - DECISION_HALO, DECISION_HALO - 1 : 1 - DECISION_HALO]
    assert np.array_equal(crop[near], whole[part][near])


def test_weights_of_swapped_models_change_sign() -> None:
    rng = np.random.default_rng(1)
    one, other = model(rng), model(rng)
    forth, back = PixelWeights.between(one, other), PixelWeights.between(other, one)
    assert np.array_equal(forth.texture, -back.texture) and np.array_equal(forth.greys, -back.greys)
    assert not PixelWeights.between(one, other, by_grey=False).greys.any()
    assert not PixelWeights.between(one, one).texture.any()


def test_weights_are_logarithms_of_ratios() -> None:
    one, other = TextureModel(), TextureModel()
    one.greys[:2], other.greys[:2] = (30, 0), (10, 20)
    one.coarse[0] = one.texture[0] = 50
    [first, second, third] = PixelWeights.between(one, other).greys[:3] / 1024
    assert abs(first - np.log(30.5 / 10.5)) < 1e-3
    assert abs(second - np.log(0.5 / 20.5)) < 1e-3
    assert third == 0  # in neither model
    weights = PixelWeights.between(one, other)
    assert np.array_equal(weights.coarse, weights.texture // 2)  # means that share pixels count half


@given(seed=st.integers(0, 10**6), reach=st.integers(1, 4))
def test_cells_near_both_sides_are_undecided(seed: int, reach: int) -> None:
    classes = np.random.default_rng(seed).choice(3, (7, 9), p=[0.7, 0.15, 0.15])
    matched, others = classes == 1, classes == 2
    found = undecided_cells(matched, others, reach)
    for row, col in np.ndindex(classes.shape):
        around = np.s_[max(row - reach, 0) : row + reach + 1, max(col - reach, 0) : col + reach + 1]
        both = matched[around].any() and others[around].any()
        assert found[row, col] == (2 if both else matched[row, col])
