"""Clearance: exact distances from the centre of a cell to the nearest point of an impassable one."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.ndimage import distance_transform_edt

from uavseg.occupancy.paths.clearance import clearance, is_at_least

MASKS = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=15))


def plain(mask: np.ndarray, width: float, height: float) -> np.ndarray:
    """Smallest distance to any impassable cell, including a ring of them around the map."""
    around = np.pad(mask, 1)
    blocked = np.argwhere(~around) - 1
    distance = np.zeros(mask.shape)
    for row, col in np.argwhere(mask):
        away = np.maximum(np.abs(blocked - (row, col)) - 0.5, 0) * (height, width)
        distance[row, col] = np.hypot(*away.T).min()
    return distance


def cells_with_clearance(mask: np.ndarray, metres: float, width: float = 1, height: float = 1) -> np.ndarray:
    """Cells that keep a distance from every impassable cell and from the edge of the map."""
    return np.asarray(mask & is_at_least(clearance(mask, width, height), metres))


@pytest.mark.slow
@given(MASKS)
@settings(max_examples=200)
def test_square_cells_have_the_distances_of_the_plain_definition_exactly(mask: np.ndarray) -> None:
    doubled = (2 * clearance(mask)) ** 2  # a whole number
    assert np.array_equal(np.rint(doubled), np.rint((2 * plain(mask, 1, 1)) ** 2))
    assert np.abs(doubled - np.rint(doubled)).max() < 1e-9


@pytest.mark.slow
@given(MASKS, st.floats(0.1, 10), st.floats(0.1, 10))
@settings(max_examples=200)
def test_cells_may_be_longer_than_wide(mask: np.ndarray, width: float, height: float) -> None:
    assert clearance(mask, width, height) == pytest.approx(plain(mask, width, height), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 5))])
def test_scipy_agrees_on_large_maps(seed: int) -> None:
    """On a grid twice as fine: centres of cells are odd, impassable cells are drawn with their edges."""
    mask = np.random.default_rng(seed).random((150, 211)) < 0.999 - 0.05 * seed
    fine = np.ones((2 * 150 + 1, 2 * 211 + 1), bool)
    fine[[0, -1]] = fine[:, [0, -1]] = False
    for down in (0, 1, 2):
        for right in (0, 1, 2):
            fine[down : down + 300 : 2, right : right + 422 : 2] &= mask
    expected = distance_transform_edt(fine)[1::2, 1::2] / 2
    assert clearance(mask) == pytest.approx(expected, rel=1e-12)


def test_clearance_is_kept_from_the_edge_of_the_map() -> None:
    assert cells_with_clearance(np.ones((5, 6), bool), 1.5).tolist() == [
        [False] * 6,
        *([False, *[True] * 4, False] for _ in range(3)),
        [False] * 6,
    ]


def test_a_distance_that_is_met_exactly_is_met() -> None:
    mask = np.ones((200, 300), bool)
    mask[100, 100] = False
    for cells in range(1, 60):
        metres = (cells - 0.5) * 0.05  # to the edge of the impassable cell
        assert cells_with_clearance(mask, metres, 0.05, 0.05)[100, 100 + cells]
        assert not cells_with_clearance(mask, metres * (1 + 1e-6), 0.05, 0.05)[100, 100 + cells]


@given(MASKS, st.floats(0, 5))
@settings(max_examples=50)
def test_more_distance_leaves_fewer_cells(mask: np.ndarray, metres: float) -> None:
    near, far = cells_with_clearance(mask, metres), cells_with_clearance(mask, metres + 0.7)
    assert not (far & ~near).any() and not (near & ~mask).any()
    assert np.array_equal(cells_with_clearance(mask, 0.5), mask)  # what half a cell is nearer than
