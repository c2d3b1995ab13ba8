"""Mirrored, turned or shifted images: which have the same regions, and how many pixels else differ."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from uavseg.segmentation.in_memory import label_regions
from uavseg.segmentation.params.segment import IntensityRange, Method, Refinement, SegmentParams
from uavseg.segmentation.refine.total_variation import refine_classes_by_tv

Image = NDArray[np.bool_]
Grey = NDArray[np.uint16]
Turn = Callable[[NDArray[Any]], NDArray[Any]]
MIRRORED: dict[str, Turn] = {
    "upside down": lambda a: a[::-1],
    "from right to left": lambda a: a[:, ::-1],
    "half a turn": lambda a: a[::-1, ::-1],
}
TRANSPOSED: dict[str, Turn] = {
    "transposed": lambda a: a.T,
    "a quarter turn": lambda a: np.rot90(a),
    "a quarter turn back": lambda a: np.rot90(a, -1),
    "transposed the other way": lambda a: a[::-1, ::-1].T,
}
ALL = MIRRORED | TRANSPOSED
RANGE = IntensityRange(0.55, 1)
EXACT: list[tuple[Method, Refinement, int, dict[str, Turn]]] = [  # sides are multiples of the number
    ("adaptive", "tv", 16, MIRRORED),
    ("adaptive", "pixels", 1, ALL),
    ("adaptive", "none", 64, ALL),
    ("adaptive", "smooth", 64, ALL),
    ("adaptive", "scan", 64, MIRRORED),
    ("paper", "none", 64, ALL),
    ("paper", "scan", 64, MIRRORED),
]
SETTINGS = [pytest.param(*setting, id=" ".join(setting[:2])) for setting in EXACT]


def drawn(seed: int, shape: tuple[int, int]) -> tuple[Grey, Image]:
    """Bright things of any size on a dark ground, with noise and texture, and invalid pixels."""
    rng = np.random.default_rng(seed)
    plane = ndimage.gaussian_filter(rng.normal(size=shape), rng.choice([2, 4, 8]))
    v = np.where(plane > np.quantile(plane, rng.uniform(0.3, 0.9)), 0.68, 0.42)
    v += rng.choice([0, 0.05, 0.15]) * rng.normal(size=shape)
    v += rng.choice([0, 0.5]) * ndimage.gaussian_filter(rng.normal(size=shape), 2)
    valid = rng.random(shape) > rng.choice([0, 0.02])
    valid[: rng.integers(0, shape[0] // 2 + 1)] &= rng.random() < 0.5
    return (np.clip(v, 0, 1) * 65535).astype(np.uint16), valid


def regions(grey: Grey, valid: Image, params: SegmentParams) -> Image:
    return label_regions(np.ascontiguousarray(grey), RANGE, np.ascontiguousarray(valid), params) > 0


@pytest.mark.parametrize(("method", "refine", "side", "turns"), SETTINGS)
@settings(max_examples=12)
@given(data=st.data())
def test_turned_images_have_the_same_regions_turned(
    method: Method, refine: Refinement, side: int, turns: dict[str, Turn], data: st.DataObject
) -> None:
    rows, cols = (side * data.draw(st.integers(1, 160 // side)) for _ in range(2))
    grey, valid = drawn(data.draw(st.integers(0, 100_000)), (rows, cols))
    params = SegmentParams(method, refine=refine)
    expected = regions(grey, valid, params)
    for turn in turns.values():
        assert np.array_equal(regions(turn(grey), turn(valid), params), turn(expected))


@pytest.mark.parametrize(("method", "refine", "side", "turns"), SETTINGS)
@settings(max_examples=12)
@given(data=st.data())
def test_images_shifted_by_whole_squares_have_the_same_regions_shifted(
    method: Method, refine: Refinement, side: int, turns: dict[str, Turn], data: st.DataObject
) -> None:
    del turns
    shape = data.draw(st.tuples(*2 * [st.integers(1, 160)]))
    down, right = (side * data.draw(st.integers(0, 2)) for _ in range(2))
    grey, valid = drawn(data.draw(st.integers(0, 100_000)), shape)
    around = ((down, 0), (right, 0))
    params = SegmentParams(method, refine=refine)
    found = regions(np.pad(grey, around), np.pad(valid, around), params)
    assert np.array_equal(found[down:, right:], regions(grey, valid, params))


@settings(max_examples=20)
@given(st.integers(0, 100_000), st.tuples(st.integers(1, 8), st.integers(1, 8)))
def test_mirrored_images_have_the_same_kinds_mirrored(seed: int, squares: tuple[int, int]) -> None:
    grey, valid = drawn(seed, (16 * squares[0], 16 * squares[1]))
    table = np.searchsorted([0.3, 0.45, 0.55, 0.8], np.arange(65536) / 65535).astype(np.uint8)

    def classes(grey: Grey, valid: Image) -> NDArray[np.uint8]:
        known = np.ascontiguousarray(valid).view(np.uint8)
        masked = np.ascontiguousarray(grey) * known
        return refine_classes_by_tv(table[masked] * known, known, masked, table)

    for turn in MIRRORED.values():
        assert np.array_equal(classes(turn(grey), turn(valid)), turn(classes(grey, valid)))


@settings(max_examples=30)
@given(st.integers(0, 100_000), st.tuples(st.integers(1, 120), st.integers(1, 120)))
def test_pixels_without_another_side_within_15_pixels_never_move(seed: int, shape: tuple[int, int]) -> None:
    grey, valid = drawn(seed, shape)
    own = (RANGE.greys[0] <= grey) & valid
    found = regions(grey, valid, SegmentParams())
    near = [ndimage.maximum_filter(side, 31, mode="constant") for side in (own, valid & ~own)]
    alone = ~(near[0] & near[1])
    assert np.array_equal(found[alone], own[alone])


@pytest.mark.parametrize(
    ("noise", "texture", "bound"),
    [(0.0, 0.0, 0.0), (0.05, 0.0, 0.0005), (0.15, 0.0, 0.015), (0.05, 0.1, 0.03)],
)
def test_few_pixels_of_other_moves_differ(noise: float, texture: float, bound: float) -> None:
    for seed in range(2):
        rng = np.random.default_rng(seed)
        plane, grain = (ndimage.gaussian_filter(rng.normal(size=(256, 256)), sigma) for sigma in (3, 2))
        v = np.where(plane > np.quantile(plane, 0.6), 0.68, 0.42)
        v += noise * rng.normal(size=v.shape) + texture * grain / grain.std()
        grey, valid = (np.clip(v, 0, 1) * 65535).astype(np.uint16), np.ones(v.shape, bool)
        expected = regions(grey, valid, SegmentParams())
        found = [regions(grey.T, valid.T, SegmentParams()).T]
        for down, right in ((1, 0), (0, 3), (8, 8)):
            around = ((down, 0), (right, 0))
            shifted = regions(np.pad(grey, around), np.pad(valid, around), SegmentParams())
            found.append(shifted[down:, right:])
        shares = [np.count_nonzero(other != expected) / expected.size for other in found]
        assert max(shares) <= bound
        assert texture == 0 or min(shares) > 0  # so the bound says something
