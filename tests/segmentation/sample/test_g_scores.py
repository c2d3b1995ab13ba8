"""Scores of moving windows agree with a plain version, wherever a window starts."""

from collections import Counter
from math import comb, log

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from tests.reference import g_statistic
from uavseg.segmentation.blocks.g_statistic import expected_g
from uavseg.segmentation.blocks.lbp import UNCOUNTED
from uavseg.segmentation.sample.g_scores import (
    MAX_SCORE,
    NO_SCORE,
    NULL_SCORE,
    SCORE_UNITS,
    GreyBounds,
    TextureModel,
    best_scores,
    min_count,
    texture_model,
    window_scores,
)

Image = NDArray[np.uint16]


def drawn(seed: int, rows: int, cols: int, many: int = 30, missing: float = 0.1) -> tuple[Image, Image]:
    """Symbols, some of them not counted, and greys."""
    rng = np.random.default_rng(seed)
    symbols = rng.choice(rng.integers(0, 2048, many), (rows, cols)).astype(np.uint16)
    symbols[rng.random((rows, cols)) < missing] = UNCOUNTED
    return symbols, rng.integers(0, 65536, (rows, cols)).astype(np.uint16)


def everything(symbols: Image, grey: Image) -> TextureModel:
    return texture_model(symbols, grey, np.ones((symbols.shape[0] // 8, symbols.shape[1] // 8), np.uint8))


def plain_g(one: Counter[int], other: Counter[int]) -> float:
    """Sokal and Rohlf's G of two histograms, term by term."""

    def n_ln_n(n: int) -> float:
        return n * log(n) if n else 0.0

    cells = sum(n_ln_n(n) for counts in (one, other) for n in counts.values())
    totals = sum(n_ln_n(counts.total()) for counts in (one, other))
    symbols = sum(n_ln_n(one[name] + other[name]) for name in one.keys() | other.keys())
    return 2 * (cells - totals - symbols + n_ln_n(one.total() + other.total()))


def plain_expected_g(counts: list[int], share: float) -> float:
    """Expected G where each pixel belongs to the window with probability `share`."""

    def part(n: int) -> float:
        entropy = -share * log(share) - (1 - share) * log(1 - share)
        probabilities = [comb(n, f) * share**f * (1 - share) ** (n - f) for f in range(n + 1)]
        split = [n * log(n) - sum(m * log(m) for m in (f, n - f) if m) for f in range(n + 1)]
        return 2 * (
            n * entropy
            - sum(probability * joint for probability, joint in zip(probabilities, split, strict=True))
        )

    return sum(part(n) for n in counts)


def plain_scores(symbols: Image, model: Counter[int], side: int, leave_one_out: bool) -> NDArray[np.float64]:
    rows, cols = (length // 8 - side + 1 for length in symbols.shape)
    found = np.full((rows, cols), np.nan)
    for row in range(rows):
        for col in range(cols):
            crop = symbols[8 * row : 8 * (row + side), 8 * col : 8 * (col + side)]
            window = Counter(crop[crop != UNCOUNTED].tolist())
            if window.total() < min_count(side):
                continue
            rest = model - window if leave_one_out else model
            share = (8 * side) ** 2 / (model.total() + (0 if leave_one_out else (8 * side) ** 2))
            expectation = plain_expected_g(list((rest + window).values()), share)
            found[row, col] = (plain_g(window, rest) - expectation) / window.total()
    return found


@pytest.mark.slow
@settings(max_examples=12)
@given(
    seed=st.integers(0, 10**6),
    shape=st.tuples(st.integers(4, 6), st.integers(4, 6)),
    side=st.integers(1, 2),
    many=st.sampled_from([40, 200, 2000]),
    leave_one_out=st.booleans(),
)
def test_scores_are_those_of_a_plain_version(
    seed: int, shape: tuple[int, int], side: int, many: int, leave_one_out: bool
) -> None:
    symbols, grey = drawn(seed, 8 * shape[0], 8 * shape[1], many)
    sample = (symbols, grey) if leave_one_out else drawn(seed + 1, 64, 40, many)
    model = everything(*sample)
    found = window_scores(symbols, grey, model, side, leave_one_out=leave_one_out)
    counts = Counter(sample[0][sample[0] != UNCOUNTED].tolist())
    expected = plain_scores(symbols, counts, side, leave_one_out)
    assert np.array_equal(found == NO_SCORE, np.isnan(expected))
    known = found != NO_SCORE
    assert (
        np.abs((found[known].astype(int) - NULL_SCORE) / SCORE_UNITS - expected[known]).max(initial=0)
        < 2 / SCORE_UNITS
    )


def test_a_score_is_g_less_its_expectation() -> None:
    """The statistic is the one of the division."""
    (symbols, grey), (other, _) = drawn(1, 16, 16), drawn(2, 32, 32)
    model = everything(other, other)
    own = everything(symbols, grey)
    [[score]] = window_scores(symbols, grey, model, 2)
    g = g_statistic(own.texture, model.texture)
    both = own.texture + model.texture
    expectation = expected_g(int(both.max()), 256 / (256 + model.count))[both].sum()
    assert (score - NULL_SCORE) / SCORE_UNITS == pytest.approx((g - expectation) / own.count, abs=0.002)


@pytest.mark.parametrize("many", [20, 200, 2000])
def test_windows_of_the_models_own_source_score_as_under_the_null_hypothesis(many: int) -> None:
    """For any number of symbols: without the correction, G per pixel is 0.1, 0.6 and 2 here."""
    rng = np.random.default_rng(many)
    likely = rng.random(many) ** 3
    sample, image = (rng.choice(many, shape, p=likely / likely.sum()) for shape in ((64, 64), (256, 256)))
    sample, image = sample.astype(np.uint16), image.astype(np.uint16)
    model = everything(sample, sample)
    for scores in (
        window_scores(image, image, model, 2),
        window_scores(sample, sample, model, 2, leave_one_out=True),
    ):
        assert (scores.mean() - NULL_SCORE) / SCORE_UNITS == pytest.approx(0, abs=0.04)
    other = window_scores((image + many // 2) % np.uint16(many), image, model, 2)
    assert (other.min() - float(NULL_SCORE)) / SCORE_UNITS > 0.3


@pytest.mark.slow
@given(most=st.integers(1, 900), share=st.floats(0.001, 0.5))
@settings(max_examples=30)
def test_expected_g_is_interpolated_closely(most: int, share: float) -> None:
    assert expected_g(most, share)[most] == pytest.approx(plain_expected_g([most], share), rel=1e-6, abs=1e-9)
    assert expected_g(5000, share)[most] == pytest.approx(expected_g(most, share)[most], rel=0.01)


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), row=st.integers(0, 4), col=st.integers(0, 4), leave_one_out=st.booleans())
def test_the_start_of_a_moving_window_changes_nothing(
    seed: int, row: int, col: int, leave_one_out: bool
) -> None:
    symbols, grey = drawn(seed, 64, 64)
    model = everything(symbols, grey)
    whole = window_scores(symbols, grey, model, 2, GreyBounds(30000, 36000), leave_one_out)
    part = np.s_[8 * row :, 8 * col :]
    crop = window_scores(
        symbols[part].copy(), grey[part].copy(), model, 2, GreyBounds(30000, 36000), leave_one_out
    )
    assert np.array_equal(crop, whole[row:, col:])


def test_a_window_with_the_proportions_of_the_model_scores_below_the_null_score() -> None:
    symbols, grey = drawn(3, 16, 16, missing=0)
    model = everything(np.tile(symbols, (2, 3)), np.tile(grey, (2, 3)))
    expectation = expected_g(2000, 256 / (256 + model.count))[model.texture * 7 // 6].sum()
    [[score]] = window_scores(symbols, grey, model, 2)
    assert (int(score) - NULL_SCORE) / SCORE_UNITS == pytest.approx(-expectation / 256, abs=0.002)


def test_windows_that_share_nothing_score_the_most() -> None:
    symbols, grey = np.full((16, 16), 7, np.uint16), np.zeros((16, 16), np.uint16)
    one, two = everything(symbols, grey), everything(symbols + np.uint16(1), grey)
    [[most]] = window_scores(symbols, grey, two, 2)
    assert (most - NULL_SCORE) / SCORE_UNITS == pytest.approx(
        4 * log(2) - 2 / 256, abs=0.001
    )  # expected G: 1 per symbol
    [[less]] = window_scores(symbols, grey, one + two, 2)
    assert NULL_SCORE < less < most


def test_the_mean_must_lie_in_the_bounds() -> None:
    symbols, grey = np.full((16, 16), 7, np.uint16), np.full((16, 16), 500, np.uint16)
    model = everything(symbols, grey)
    for bounds, like in [((500, 500), True), ((0, 499), False), ((501, 65535), False)]:
        assert (window_scores(symbols, grey, model, 2, GreyBounds(*bounds)) < MAX_SCORE).tolist() == [[like]]


def test_a_window_needs_seven_eighths_of_its_pixels() -> None:
    symbols, grey = np.full((16, 16), 7, np.uint16), np.zeros((16, 16), np.uint16)
    model = everything(symbols, grey)
    symbols[:2] = UNCOUNTED
    assert (window_scores(symbols, grey, model, 2) < MAX_SCORE).all()
    symbols[2, 0] = UNCOUNTED
    assert window_scores(symbols, grey, model, 2).tolist() == [[NO_SCORE]]


def test_an_empty_model_and_a_small_image_have_no_scores() -> None:
    symbols, grey = drawn(4, 16, 16)
    assert window_scores(symbols, grey, TextureModel(), 2).tolist() == [[NO_SCORE]]
    assert window_scores(symbols, grey, everything(symbols, grey), 3).size == 0


@given(seed=st.integers(0, 10**6), side=st.integers(1, 5))
def test_a_cell_has_the_best_score_of_the_windows_around_it(seed: int, side: int) -> None:
    scores = np.random.default_rng(seed).integers(0, 65536, (3 + side, 5 + side)).astype(np.uint16)
    found = best_scores(scores, side)
    assert found.shape == (4, 6)
    for row, col in np.ndindex(found.shape):
        assert found[row, col] == scores[row : row + side, col : col + side].min()


@given(seed=st.integers(0, 10**6), margin=st.sampled_from([0, 3, 8]))
def test_models_of_cells_add_up(seed: int, margin: int) -> None:
    symbols, grey = drawn(seed, 24 + 2 * margin, 16 + 2 * margin)
    chosen = np.random.default_rng(seed).integers(0, 2, (3, 2)).astype(np.uint8)
    inner = np.s_[margin : margin + 24, margin : margin + 16]
    coarse = np.ascontiguousarray(symbols[inner][::-1])
    one, other = (texture_model(symbols, grey, cells, margin, coarse) for cells in (chosen, 1 - chosen))
    counted = symbols[inner] != UNCOUNTED
    both = one + other
    assert np.array_equal(both.texture, np.bincount(symbols[inner][counted], minlength=2048))
    assert np.array_equal(both.greys, np.bincount(grey[inner][counted] // 1024, minlength=64))
    assert np.array_equal(both.coarse, both.texture)  # the same symbols, turned around
    assert both.count == counted.sum()
    assert not texture_model(symbols, grey, chosen, margin).coarse.any()
