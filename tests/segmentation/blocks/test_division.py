"""R is the largest G over the smallest between the children of a block; mirroring changes nothing."""

from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.reference import g_statistic
from uavseg.segmentation.blocks.division import block_ratios
from uavseg.segmentation.blocks.lbp import contrast_bin_edges, contrast_histogram, lbp_symbols

FIRST = np.zeros((1, 2), np.int64)
Ratios = NDArray[np.float64]


def noise(seed: int, shape: tuple[int, int]) -> NDArray[np.uint16]:
    """Four kinds of texture side by side, so that children differ."""
    rng = np.random.default_rng(seed)
    shifts = np.kron(rng.integers(0, 15, (6, 6)), np.ones((41, 37), int))[: shape[0], : shape[1]]
    return (rng.integers(0, 65536, shape) >> shifts).astype(np.uint16)


def ratios_of(grey: NDArray[np.uint16], valid: NDArray[np.uint8] | None = None) -> Ratios:
    """R of the block inside a border of one pixel, and of the blocks in it."""
    return block_ratios(grey, valid, contrast_bin_edges(contrast_histogram(grey, valid)), FIRST)[0]


def by_side(ratios: Ratios) -> list[Ratios]:
    """R as pictures: 1 x 1 of side 64, 2 x 2 of side 32, 4 x 4 of side 16."""
    return [ratios[:1].reshape(1, 1), ratios[1:5].reshape(2, 2), ratios[5:].reshape(4, 4)]


@pytest.mark.parametrize("seed", range(12))
def test_ratios_are_those_of_the_reference(reference: ModuleType, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 200, 2))
    grey = noise(seed, shape)
    valid = rng.random(shape) > rng.choice([0, 0.01, 0.3])
    grey[~valid] = 0
    beyond = [(1, -length % 64 + 1) for length in shape]
    padded, known = np.pad(grey, beyond), np.pad(valid, beyond).astype(np.uint8)
    corners = np.ascontiguousarray(np.argwhere(np.ones([-(-length // 64) for length in shape]))) * 64
    found = block_ratios(padded, known, contrast_bin_edges(contrast_histogram(padded, known)), corners)
    expected = reference.ratios(grey, valid)
    for (top, left), ratios in zip(corners.tolist(), found, strict=True):
        for side, picture in zip((64, 32, 16), by_side(ratios), strict=True):
            for (row, col), ratio in np.ndenumerate(picture):
                same = expected[top + side * row, left + side * col, side]
                np.testing.assert_allclose(ratio, same, rtol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_mirrored_block_has_mirrored_ratios(seed: int) -> None:
    grey = noise(seed, (66, 66))
    valid = (np.random.default_rng(seed).random(grey.shape) > 0.005).astype(np.uint8)
    plain = by_side(ratios_of(grey, valid))
    for turn in (np.fliplr, np.flipud, np.transpose, np.rot90):
        turned = ratios_of(*(np.ascontiguousarray(turn(image)) for image in (grey, valid)))
        for first, second in zip(plain, by_side(turned), strict=True):
            np.testing.assert_allclose(turn(first), second, rtol=1e-9)


@pytest.mark.parametrize("period", [1, 2, 4, 8])
def test_a_pattern_that_repeats_in_every_child_is_uniform(period: int) -> None:
    pattern = np.random.default_rng(period).integers(0, 65536, (period, period)).astype(np.uint16)
    assert (ratios_of(np.tile(pattern, (66, 66))[:66, :66].copy()) == 0).all()


def test_one_child_that_differs_from_three_equal_ones_divides_whatever_the_threshold() -> None:
    grey = np.zeros((66, 66), np.uint16)
    grey[10:20, 10:20] = np.random.default_rng(0).integers(0, 65536, (10, 10))
    assert ratios_of(grey)[0] == np.inf


def test_a_block_with_one_child_that_counts_is_uniform() -> None:
    grey = noise(1, (66, 66))
    valid = np.zeros_like(grey, np.uint8)
    valid[:34, :34] = 1  # the first quarter, with the border that counting wants
    ratios = ratios_of(grey, valid)
    assert ratios[0] == 0 and ratios[1] > 0
    assert (ratios[2:5] == 0).all()


def test_a_block_with_two_counted_children_has_one_pair_and_ratio_one() -> None:
    grey = noise(2, (66, 66))
    valid = np.zeros_like(grey, np.uint8)
    valid[:34] = 1  # the upper half
    assert ratios_of(grey, valid)[0] == 1


def test_a_mask_of_ones_is_the_same_as_none() -> None:
    grey = noise(4, (66, 66))
    assert np.array_equal(ratios_of(grey), ratios_of(grey, np.ones_like(grey, np.uint8)))


def test_a_block_does_not_depend_on_the_other_corners() -> None:
    grey = noise(5, (200, 140))
    bin_edges = contrast_bin_edges(contrast_histogram(grey))
    corners = np.array([[0, 0], [64, 64], [128, 0], [5, 71]], np.int64)
    together = block_ratios(grey, None, bin_edges, corners)
    for order in ([3, 1, 0, 2], [2], [1, 1]):
        assert np.array_equal(block_ratios(grey, None, bin_edges, corners[order]), together[order])
    row, col = corners[3]
    alone = np.ascontiguousarray(grey[row : row + 66, col : col + 66])
    assert np.array_equal(block_ratios(alone, None, bin_edges, FIRST)[0], together[3])


@pytest.mark.parametrize("seed", range(3))
def test_the_kernel_and_the_formula_agree(seed: int) -> None:
    grey = noise(seed + 10, (66, 66))
    bin_edges = contrast_bin_edges(contrast_histogram(grey))
    texture = lbp_symbols(grey, None, bin_edges)
    halves = [texture[r : r + 32, c : c + 32].ravel() for r in (0, 32) for c in (0, 32)]
    histograms = [np.bincount(half, minlength=2048) for half in halves]
    G = [g_statistic(histograms[i], histograms[j]) for i in range(4) for j in range(i)]
    assert ratios_of(grey)[0] == pytest.approx(max(G) / min(G), rel=1e-9)
