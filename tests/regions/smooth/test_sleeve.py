"""Sleeve fitting: segments pass through the portals of all edges that they replace."""

from itertools import pairwise

import numpy as np
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from uavseg.regions.smooth.arcs import (
    MAX_OFFSET,
    SLEEVE_WIDTH,
    STEPS_PER_PIXEL,
    area_slope,
    doubled_steps,
    place_points,
    portal_offsets,
    straighten,
)

Integers = NDArray[np.int64]
arcs = st.lists(st.sampled_from([(1, 0), (0, 1), (0, -1)]), min_size=1, max_size=60).map(
    lambda steps: np.cumsum([(0, 0), *steps], axis=0).T.astype(float)
)


def placed(base: NDArray[np.float64], offsets: NDArray[np.float64]) -> tuple[Integers, Integers, int]:
    """Points on the portals of an open arc (2, last + 1), their offsets in steps, and the last index."""
    n = base.shape[1] - 1
    px, py, steps = np.zeros((3, n + 2), np.int64)
    last = place_points(base[0], base[1], n, False, offsets, px, py, steps)
    return np.stack([px, py]), steps, last


@given(arcs, st.integers(0, 10**6))
def test_segments_pass_through_the_sleeve_of_every_portal(base: NDArray[np.float64], seed: int) -> None:
    n = base.shape[1] - 1
    offsets = np.random.default_rng(seed).uniform(-150, 150, n)
    points, steps, last = placed(base, offsets)
    assert np.abs(steps[1 : n + 1]).max() <= MAX_OFFSET
    kept = np.zeros(n + 2, np.int64)
    count = straighten(base[0], base[1], False, *points, steps, last, kept)
    assert kept[0] == 0 and kept[count - 1] == last and (np.diff(kept[:count]) > 0).all()
    for begin, end in pairwise(kept[:count]):
        for at in range(begin + 1, end):
            edge = base[:, at] - base[:, at - 1]
            left = np.array([edge[1], -edge[0]])  # along the portal
            a, b = points[:, begin], points[:, end]
            along = (edge @ (points[:, at] - a)) / (edge @ (b - a))
            miss = left @ (a + along * (b - a) - points[:, at])
            assert 0 <= along <= 1
            assert abs(miss) <= SLEEVE_WIDTH + 1e-9 and abs(steps[at] + miss) <= MAX_OFFSET + 1e-9


@given(st.integers(2, 40))
def test_a_straight_arc_is_one_segment(length: int) -> None:
    base = np.stack([np.arange(length + 1.0), np.zeros(length + 1)])
    points, steps, last = placed(base, np.zeros(length))
    kept = np.zeros(length + 2, np.int64)
    assert straighten(base[0], base[1], False, *points, steps, last, kept) == 2
    assert points[:, last].tolist() == [length * STEPS_PER_PIXEL, 0]


@given(arcs)
def test_an_arc_on_its_pixel_edges_crosses_portals_in_the_middle(base: NDArray[np.float64]) -> None:
    offsets = np.zeros(base.shape[1] - 1)
    portal_offsets(base[0], base[1], len(offsets), base[0], base[1], offsets)
    assert (offsets == 0).all()


@given(arcs, st.integers(0, 10**6))
def test_the_slope_is_the_derivative_of_the_doubled_area(base: NDArray[np.float64], seed: int) -> None:
    """The area is quadratic in a common shift of all points, so the central difference is exact."""
    n = base.shape[1] - 1
    offsets = np.random.default_rng(seed).integers(-100, 100, n).astype(float)

    def area(shift: int) -> int:
        points, _, last = placed(base, offsets + shift)
        return int(doubled_steps(*points, np.arange(last + 1), last + 1))

    points, _, last = placed(base, offsets)
    x, y = points[:, : last + 1]
    assert area(0) == (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    assert 2 * area_slope(base[0], base[1], n, False, *points, last) == area(1) - area(-1)
