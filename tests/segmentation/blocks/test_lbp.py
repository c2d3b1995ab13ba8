"""Contrast is an exact fraction; neither it nor the LBP code knows of tiles, turning or brightness."""

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import tiles
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram, lbp_symbols

NO_EDGES = np.full(7, 65536, np.int32)
extreme = st.sampled_from([0, 1, 7, 8, 9, 32767, 32768, 65534, 65535])
nine_greys = st.lists(st.one_of(extreme, st.integers(0, 65535)), min_size=9, max_size=9)


def noise(seed: int, shape: tuple[int, int]) -> NDArray[np.uint16]:
    """Greys of few or of many values."""
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 65536, shape) >> rng.integers(0, 15)).astype(np.uint16)


def holes(seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    return (np.random.default_rng([seed, 1]).random(shape) > 0.03).astype(np.uint8)


def only_contrast(image: NDArray[np.uint16]) -> int:
    """The contrast of the one counted pixel of a 3x3 image."""
    (value,) = np.flatnonzero(contrast_histogram(image))
    return int(value)


def exact_contrast(nine: list[int]) -> int:
    centre, neighbours = nine[4], nine[:4] + nine[5:]
    above = [q for q in neighbours if q >= centre]
    below = [q for q in neighbours if q < centre]
    if not above or not below:
        return 0
    return floor(Fraction(sum(above), len(above)) - Fraction(sum(below), len(below)))


def plain_symbols(
    grey: NDArray[np.uint16], valid: NDArray[np.uint8], bin_edges: NDArray[np.int32]
) -> NDArray[np.int64]:
    """Symbols by whole-array arithmetic; bits run clockwise from the upper left."""
    rows, cols = grey.shape
    clockwise = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)]
    centre = grey[1:-1, 1:-1].astype(np.int64)
    code, n, high, low = np.zeros((4, rows - 2, cols - 2), np.int64)
    counted = valid[1:-1, 1:-1] > 0
    for bit, (down, right) in enumerate(clockwise):
        there = slice(down, rows - 2 + down), slice(right, cols - 2 + right)
        q, above = grey[there].astype(np.int64), grey[there] >= centre
        code += above << bit
        n += above
        high += np.where(above, q, 0)
        low += np.where(above, 0, q)
        counted &= valid[there] > 0
    m = 8 - n
    contrast = np.where(n * m > 0, (high * m - low * n) // np.maximum(n * m, 1), 0)
    level = (contrast[..., None] > bin_edges).sum(axis=2)
    return np.where(counted, 8 * code + level, 65535)


@pytest.mark.slow
@settings(max_examples=300)
@given(nine_greys)
def test_contrast_is_the_floor_of_the_exact_fraction(nine: list[int]) -> None:
    assert only_contrast(np.array(nine, np.uint16).reshape(3, 3)) == exact_contrast(nine)


@pytest.mark.parametrize("many", range(1, 8))
def test_contrast_just_below_a_whole_number_is_not_rounded_up(many: int) -> None:
    for whole in (65535, 65534, 4097, 2):
        high = [whole] * many
        high[0] -= 1  # their mean is 1 / many below a whole number
        nine = high + [0] * (8 - many)
        nine.insert(4, 1)
        assert exact_contrast(nine) == whole - 1
        assert only_contrast(np.array(nine, np.uint16).reshape(3, 3)) == whole - 1


@pytest.mark.parametrize("seed", range(6))
def test_contrasts_of_a_whole_image_are_counted_once_each(seed: int) -> None:
    grey = noise(seed, (23, 31))
    windows = np.lib.stride_tricks.sliding_window_view(grey, (3, 3)).reshape(-1, 9)
    expected = np.bincount([exact_contrast(nine) for nine in windows.tolist()], minlength=65536)
    assert np.array_equal(contrast_histogram(grey), expected)


def test_the_strongest_contrast_there_is() -> None:
    image = np.array([[65535] * 3, [0, 65535, 0], [0, 0, 0]], np.uint16)
    assert only_contrast(image) == 65535


@pytest.mark.parametrize("shape", [(2, 2), (1, 9), (9, 2), (0, 0)])
def test_an_image_without_an_inside_has_no_contrast(shape: tuple[int, int]) -> None:
    assert contrast_histogram(np.ones(shape, np.uint16)).sum() == 0


@settings(max_examples=30)
@given(st.integers(0, 1000), st.tuples(st.integers(1, 150), st.integers(1, 150)), st.sampled_from([64, 128]))
def test_histograms_of_tiles_add_up_to_that_of_the_whole(
    seed: int, shape: tuple[int, int], side: int
) -> None:
    grey = np.pad(noise(seed, shape), 1)
    valid = np.pad(holes(seed, shape), 1)
    total = np.zeros(65536, np.int64)
    for window in tiles(shape, side):
        part = np.s_[window.row : window.row + window.rows + 2, window.col : window.col + window.cols + 2]
        total += contrast_histogram(np.ascontiguousarray(grey[part]), np.ascontiguousarray(valid[part]))
    assert np.array_equal(total, contrast_histogram(grey, valid))


@settings(max_examples=30)
@given(st.integers(0, 1000), st.lists(st.integers(0, 70000), min_size=7, max_size=7))
def test_symbols_are_those_of_plain_arithmetic(seed: int, bin_edges: list[int]) -> None:
    grey, valid = noise(seed, (19, 33)), holes(seed, (19, 33))
    some = np.array(sorted(bin_edges), np.int32) >> seed % 17
    assert np.array_equal(lbp_symbols(grey, valid, some), plain_symbols(grey, valid, some))
    assert np.array_equal(lbp_symbols(grey, None, some), plain_symbols(grey, np.ones_like(valid), some))


@pytest.mark.parametrize("seed", range(4))
def test_an_invalid_pixel_uncounts_the_nine_around_it(seed: int) -> None:
    grey, valid = noise(seed, (20, 20)), np.ones((20, 20), np.uint8)
    valid[7, 11] = 0
    uncounted = lbp_symbols(grey, valid, NO_EDGES) == 65535
    assert uncounted.sum() == 9 and uncounted[5:8, 9:12].all()
    assert contrast_histogram(grey, valid).sum() == 18 * 18 - 9


@settings(max_examples=20)
@given(st.integers(0, 1000), st.integers(1, 32000))
def test_a_brighter_image_has_the_same_texture(seed: int, more: int) -> None:
    grey = noise(seed, (30, 30)) >> 1
    brighter = (grey + np.uint16(more)).astype(np.uint16)
    bin_edges = contrast_bin_edges(contrast_histogram(grey))
    assert np.array_equal(contrast_histogram(grey), contrast_histogram(brighter))
    assert np.array_equal(lbp_symbols(grey, None, bin_edges), lbp_symbols(brighter, None, bin_edges))


@pytest.mark.parametrize("turn", [np.rot90, np.fliplr, np.flipud, np.transpose])
def test_a_turned_image_has_the_same_contrasts(turn: object) -> None:
    for seed in range(5):
        grey, valid = noise(seed, (27, 40)), holes(seed, (27, 40))
        turned = [np.ascontiguousarray(turn(image)) for image in (grey, valid)]  # type: ignore[operator]
        assert np.array_equal(contrast_histogram(grey, valid), contrast_histogram(*turned))


@pytest.mark.slow
@settings(max_examples=150)
@given(st.lists(st.one_of(st.integers(0, 6), st.sampled_from([0, 0, 65535])), max_size=60))
def test_a_bin_edge_is_the_smallest_contrast_with_enough_pixels_at_or_below_it(contrasts: list[int]) -> None:
    bin_edges = contrast_bin_edges(np.bincount(contrasts, minlength=65536).astype(np.int64))
    ordered = sorted(contrasts)
    for k in range(1, 8):
        enough = [t for t in {0, *ordered} if 8 * sum(c <= t for c in ordered) >= k * len(ordered)]
        assert bin_edges[k - 1] == min(enough)


def test_where_contrasts_seldom_tie_bins_are_of_equal_size() -> None:
    grey = np.random.default_rng(3).integers(0, 65536, (200, 200)).astype(np.uint16)
    bin_edges = contrast_bin_edges(contrast_histogram(grey))
    found = np.bincount(lbp_symbols(grey, None, bin_edges).ravel() % 8, minlength=8)
    eighth = 198 * 198 / 8
    assert abs(found[0] + found[1] - 2 * eighth) < 10  # two ninths are the least or the greatest of nine: 0
    assert (abs(found[2:] - eighth) < 10).all()


def test_where_contrasts_tie_bins_stay_empty() -> None:
    grey = np.zeros((40, 40), np.uint16)
    grey[20, 20] = 800  # nine contrasts that are not 0, of 1444
    bin_edges = contrast_bin_edges(contrast_histogram(grey))
    assert bin_edges.tolist() == [0] * 7
    assert set(np.unique(lbp_symbols(grey, None, bin_edges) % 8)) <= {0, 7}
