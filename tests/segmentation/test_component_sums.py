"""Sums of components are those of plain loops, and those of tiles add up."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.segmentation.components import component_sums, label_components

seeds = st.integers(0, 100_000)
shapes = st.tuples(st.integers(1, 45), st.integers(1, 45))


def blots(seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Pixels of a random mask."""
    return (np.random.default_rng(seed).random(shape) < 0.6).astype(np.uint8)


@settings(max_examples=60)
@given(seeds, shapes, st.integers(0, 3))
def test_sums_are_those_of_each_component_alone(seed: int, shape: tuple[int, int], margin: int) -> None:
    labels, count = label_components(blots(seed, shape))
    grey = (
        np.random.default_rng(seed)
        .integers(0, 65536, [side + 2 * margin for side in shape])
        .astype(np.uint16)
    )
    core = grey[margin : margin + shape[0], margin : margin + shape[1]].astype(np.int64)
    sums = component_sums(labels, count, grey, margin)
    each = [labels == label for label in range(1, count + 1)]
    assert sums.counts.tolist() == [int(one.sum()) for one in each]
    assert sums.greys.tolist() == [int(core[one].sum()) for one in each]
    assert sums.squares.tolist() == [int((core[one] ** 2).sum()) for one in each]
    assert sums.firsts.tolist() == [np.argwhere(one)[0].tolist() for one in each]


def test_squares_of_a_large_white_component_are_exact() -> None:
    white = np.full((1500, 1500), 65535, np.uint16)
    sums = component_sums(np.ones(white.shape, np.uint32), 1, white)
    assert int(sums.squares[0]) == white.size * 65535**2


@settings(max_examples=40)
@given(seeds, shapes, st.integers(0, 45))
def test_sums_of_two_halves_add_up(seed: int, shape: tuple[int, int], split: int) -> None:
    labels, count = label_components(blots(seed, shape))
    grey = np.random.default_rng(seed).integers(0, 65536, shape).astype(np.uint16)
    whole = component_sums(labels, count, grey)
    halves = [component_sums(labels[part], count, grey[part]) for part in (np.s_[:split], np.s_[split:])]
    for name in ("counts", "greys", "squares"):
        assert np.array_equal(sum(getattr(half, name) for half in halves), getattr(whole, name))
