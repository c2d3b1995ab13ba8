"""Thin pieces and holes of fewer than 12 pixels change side; all others stay."""

from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.refine.specks import MIN_PIECE, drop_specks

SHAPE = (24, 32)
ALL = np.ones((3, 4), np.uint8)


def dropped(inside: NDArray[np.uint8], valid: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    result = inside.copy()
    drop_specks(result, np.ones_like(inside) if valid is None else valid, ALL)
    return result


@settings(max_examples=60)
@given(st.integers(0, 100_000), st.sampled_from([0.1, 0.3, 0.5, 0.8]))
def test_specks_are_those_of_plain_arrays(plain_variation: ModuleType, seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    valid = (rng.random(SHAPE) > 0.05).astype(np.uint8)
    inside = (rng.random(SHAPE) < share).astype(np.uint8) & valid
    expected = np.where(plain_variation.specks(inside, valid), 1 - inside, inside)
    assert np.array_equal(dropped(inside, valid), expected)


@pytest.mark.parametrize("length, stays", [(MIN_PIECE - 1, False), (MIN_PIECE, True)])
def test_a_line_stays_from_12_pixels_on(length: int, stays: bool) -> None:
    line = np.zeros(SHAPE, np.uint8)
    line[10, 5 : 5 + length] = 1
    assert dropped(line).any() == stays
    assert dropped(1 - line).all() != stays


def test_a_square_of_nine_pixels_stays() -> None:
    square = np.zeros(SHAPE, np.uint8)
    square[8:11, 8:11] = 1
    assert np.array_equal(dropped(square), square)
    assert np.array_equal(dropped(1 - square), 1 - square)


def test_a_piece_that_touches_invalid_pixels_only_stays() -> None:
    speck = np.zeros(SHAPE, np.uint8)
    speck[5, 5] = 1
    assert np.array_equal(dropped(speck, speck), speck)


def test_cells_that_are_not_active_keep_their_specks() -> None:
    speck = np.zeros(SHAPE, np.uint8)
    speck[5, 5] = speck[5, 20] = 1
    active = ALL.copy()
    active[0, 0] = 0
    drop_specks(speck, np.ones_like(speck), active)
    assert np.argwhere(speck).tolist() == [[5, 5]]


def plain_kinds_without_specks(classes: NDArray[np.uint8], valid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Each small thin component takes the kind of most neighbours of its pixels, of several the smallest."""
    result = classes.copy()
    shown = np.where(valid > 0, classes.astype(int), -1)
    around = np.pad(shown, 1, constant_values=-1)
    for kind in np.unique(classes):
        same = shown == kind
        pieces, count = ndimage.label(same, None if kind else np.ones((3, 3)))
        thick = ndimage.binary_opening(same, np.ones((3, 3)))
        for piece in range(1, count + 1):
            own = pieces == piece
            contacts = [
                int(around[r + 1 + dr, c + 1 + dc])
                for r, c in np.argwhere(own)
                for dr in (-1, 0, 1)
                for dc in (-1, 0, 1)
            ]
            others = [other for other in contacts if other not in (kind, -1)]
            if own.sum() < MIN_PIECE and others:
                result[own & ~thick] = np.bincount(others).argmax()
    return result


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 100_000), st.sampled_from([2, 3, 6]))
def test_specks_of_several_kinds_are_those_of_plain_arrays(seed: int, classes: int) -> None:
    rng = np.random.default_rng(seed)
    valid = (rng.random(SHAPE) > 0.05).astype(np.uint8)
    side = int(rng.choice([1, 2, 4]))
    image = rng.choice([0, 1, 2, 5, 90, 127][:classes], (24 // side, 32 // side)).repeat(side, 0)
    image = image.repeat(side, 1).astype(np.uint8)
    image[rng.random(SHAPE) < 0.1] = 1
    image *= valid
    assert np.array_equal(dropped(image, valid), plain_kinds_without_specks(image, valid))
