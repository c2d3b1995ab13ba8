"""Small things, rows and grids are found whatever their arrangement; noise and texture stay whole."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

import uavseg
from uavseg.segmentation.in_memory import label_regions
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.refine.total_variation import refine_classes_by_tv
from uavseg.units import GREY_MAX

Mask = NDArray[np.bool_]
SIDE = 192
MIDDLE = 0.55  # the bound of the range, half way between things and ground
SIGMAS = (2 / 255, 7 / 255, 17 / 255)


def rows(angle: float, width: float, period: float, side: int = SIDE) -> Mask:
    """Rows at an angle in degrees."""
    row, col = np.indices((side, side))
    across = row * math.cos(math.radians(angle)) + col * math.sin(math.radians(angle))
    return np.round(across, 6) % period < width


def grid(width: int, period: int, side: int = SIDE) -> Mask:
    """Squares in rows and columns, none of them cut off at an edge."""
    row, col = np.indices((side, side)) - 2
    last = (side - 2 - width) // period * period + width
    one = (row % period < width) & (row >= 0) & (row < last)
    return one & (col % period < width) & (col >= 0) & (col < last)


def checkers(width: int) -> Mask:
    row, col = np.indices((width * (SIDE // width),) * 2)
    return (row // width + col // width) % 2 == 0


def alone(shape: Mask, seed: int) -> Mask:
    """One thing in each block of 64 pixels, anywhere in it."""
    rng, found = np.random.default_rng(seed), np.zeros((SIDE, SIDE), bool)
    for row in range(0, SIDE, 64):
        for col in range(0, SIDE, 64):
            down, right = rng.integers(0, 65 - np.array(shape.shape))
            found[row + down : row + down + shape.shape[0], col + right : col + right + shape.shape[1]] = (
                shape
            )
    return found


def noisy(truth: Mask, sigma: float, contrast: float, seed: int = 0) -> NDArray[np.float64]:
    """v of 8 bits, with normal noise."""
    noise = np.random.default_rng(seed).normal(0, sigma, truth.shape)
    return np.rint(255 * np.clip(MIDDLE + (truth - 0.5) * contrast + noise, 0, 1)) / 255


def found(v: NDArray[np.float64]) -> Mask:
    grey = np.floor(v * GREY_MAX + 0.5).astype(np.uint16)
    return label_regions(grey, IntensityRange(MIDDLE, 1)) > 0


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.sampled_from(SIGMAS),
    st.sampled_from([6, 8, 12]),
    st.floats(0, 180),
    st.integers(3, 12),
    st.integers(2, 28),
    st.integers(0, 1000),
)
@example(7 / 255, 6, 45, 3, 2, 0)
@example(2 / 255, 6, 0, 4, 4, 0)
def test_rows_at_any_angle_are_found(
    sigma: float, times: float, angle: float, width: int, gap: int, seed: int
) -> None:
    truth = rows(angle, width, max(width + gap, 5))
    assert overlap(found(noisy(truth, sigma, times * sigma, seed)), truth) > 0.9


@settings(max_examples=40)
@given(
    st.sampled_from(SIGMAS),
    st.sampled_from([6, 8, 12]),
    st.integers(4, 12),
    st.integers(2, 30),
    st.integers(0, 1000),
)
@example(7 / 255, 6, 4, 4, 0)
@example(7 / 255, 6, 6, 6, 0)
def test_squares_in_a_grid_are_found(sigma: float, times: float, width: int, gap: int, seed: int) -> None:
    truth = grid(width, width + gap)
    assert overlap(found(noisy(truth, sigma, times * sigma, seed)), truth) > (0.8 if width <= 5 else 0.9)


@pytest.mark.parametrize("width", [4, 5, 6, 8, 11])
@pytest.mark.parametrize("sigma", SIGMAS)
def test_checkers_are_found(width: int, sigma: float) -> None:
    truth = checkers(width)
    assert overlap(found(noisy(truth, sigma, 6 * sigma)), truth) > 0.9


THINGS = {  # at least 12 pixels, at least 3 by 3
    "3 by 4": np.ones((3, 4), bool),
    "4 by 4": np.ones((4, 4), bool),
    "5 by 5": np.ones((5, 5), bool),
    "7 by 7": np.ones((7, 7), bool),
    "disc": np.hypot(*(np.indices((7, 7)) - 3)) <= 3.2,
    "L": np.array([[1] * 3 + [0] * 5] * 6 + [[1] * 8] * 3, bool),
    "two that touch at a corner": np.kron(np.eye(2), np.ones((4, 4))) > 0,
}


@pytest.mark.parametrize("name", THINGS)
@pytest.mark.parametrize("sigma", SIGMAS)
@pytest.mark.parametrize("times", [6, 10])
def test_a_thing_alone_is_found(name: str, sigma: float, times: float) -> None:
    for seed in range(3):
        truth = alone(THINGS[name], seed)
        got = found(noisy(truth, sigma, times * sigma, seed))
        least = 0.8 if min(THINGS[name].shape) <= 5 else 0.9
        places = ndimage.find_objects(ndimage.label(truth, np.ones((3, 3)))[0])
        each = [overlap(got[place], truth[place]) for place in places]
        assert min(each) > 0.6 and np.mean(each) > least and overlap(got, truth) > least


@pytest.mark.parametrize(
    "how", [{"range": (0.55, 1)}, {"values": (140, None)}, {"classes": {"vine": (0.55, 1)}}]
)
def test_half_of_a_vineyard_is_half_of_its_area(how: dict[str, Any]) -> None:
    rng, bars = np.random.default_rng(0), np.arange(512) % 8 < 4
    image = (np.where(bars, 180, 60) + rng.integers(0, 8, (512, 512))).astype(np.uint8)
    regions = uavseg.extract(image, **how, collar="keep")
    assert len(regions) == 64 and regions["pixels"].sum() == 512 * 256


@pytest.mark.parametrize("edges", [(0.45, 0.55), (0.3, 0.4, 0.5, 0.6, 0.7), (0.5,)])
def test_rows_are_found_among_classes_and_levels(edges: tuple[float, ...]) -> None:
    truth = rows(30, 4, 9)
    v = np.clip(np.where(truth, 0.65, 0.35) + np.random.default_rng(0).normal(0, 0.02, truth.shape), 0, 1)
    grey = np.floor(v * GREY_MAX + 0.5).astype(np.uint16)
    table = np.searchsorted(edges, np.arange(GREY_MAX + 1) / GREY_MAX).astype(np.uint8)
    classes = refine_classes_by_tv(table[grey], np.ones(grey.shape, np.uint8), grey, table)
    assert overlap(classes == table[round(0.65 * GREY_MAX)], truth) > 0.97


@pytest.mark.parametrize("looks", [1, 2, 4])
def test_speckle_stays_one_region(looks: int) -> None:
    rng = np.random.default_rng(looks)
    bright = np.indices((384, 384))[1] < 200
    v = np.clip(np.where(bright, 0.45, 0.15) * rng.gamma(looks, 1 / looks, bright.shape), 0, 1)
    grey = np.floor(v * GREY_MAX + 0.5).astype(np.uint16)
    labels = label_regions(grey, IntensityRange(0.27, 1))
    assert overlap(labels > 0, bright) > 0.9
    assert np.bincount(labels.ravel())[1] > 0.95 * (labels > 0).sum()


def test_a_canopy_stays_one_region() -> None:
    rng = np.random.default_rng(0)
    crowns = ndimage.gaussian_filter(rng.normal(size=(384, 384)), 3)
    v = np.clip(0.62 + 0.1 * crowns / crowns.std() + rng.normal(0, 0.03, crowns.shape), 0, 1)
    labels = label_regions(np.floor(v * GREY_MAX + 0.5).astype(np.uint16), IntensityRange(0.45, 1))
    assert (labels == 1).mean() > 0.9
