"""Surface nets: corners relax within their squares, ends are fixed, and areas are restored."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from uavseg.regions.smooth.smooth_outlines import MAX_SHIFT, doubled_area, relax

Floats = NDArray[np.float64]
steps = st.lists(st.sampled_from([(1, 0), (0, 1), (0, -1)]), min_size=1, max_size=40)


def relaxed(base: Floats, cyclic: bool = False) -> Floats:
    """The relaxed corners of an arc, (n + 1, 2), from those on pixel edges."""
    n = len(base) - 1
    x, y, other_x, other_y = np.zeros((4, n + 1))
    relax(base[:, 0].copy(), base[:, 1].copy(), n, cyclic, x, y, other_x, other_y)
    return np.stack([x, y], axis=1)


def arc(directions: list[tuple[int, int]]) -> Floats:
    return np.cumsum([(0, 0), *directions], axis=0).astype(float)


@given(steps)
def test_corners_stay_in_their_squares_and_ends_where_they_are(directions: list[tuple[int, int]]) -> None:
    base = arc(directions)
    moved = relaxed(base)
    assert np.abs(moved - base).max() <= MAX_SHIFT
    assert moved[[0, -1]].tolist() == base[[0, -1]].tolist()


@given(st.integers(1, 30))
def test_a_straight_arc_stays(length: int) -> None:
    base = arc([(1, 0)] * length)
    assert relaxed(base) == pytest.approx(base, abs=1e-12)


@pytest.mark.slow
@given(steps)
def test_a_mirrored_arc_relaxes_to_the_mirror_image(directions: list[tuple[int, int]]) -> None:
    base = arc(directions)
    assert relaxed(base * [1, -1]) == pytest.approx(relaxed(base) * [1, -1], abs=1e-12)


@pytest.mark.parametrize("run", [1, 2, 3])
def test_stairs_are_flattened_and_keep_their_area(run: int) -> None:
    base = arc([(1, 0)] * run + ([(0, 1)] + [(1, 0)] * run) * 12)
    moved = relaxed(base)
    n = len(base) - 1
    assert doubled_area(*moved.T, n) == pytest.approx(doubled_area(*base.T, n), abs=0.05)
    middle = slice(n // 3, 2 * n // 3)
    line = np.polyfit(*moved[middle].T, 1)
    stairs = base[middle, 1] - np.polyval(np.polyfit(*base[middle].T, 1), base[middle, 0])
    assert np.abs(moved[middle, 1] - np.polyval(line, moved[middle, 0])).max() < np.abs(stairs).max() / 3


def test_a_cyclic_arc_moves_its_first_corner_too_and_stays_closed() -> None:
    side = 6
    square = [(1, 0)] * side + [(0, 1)] * side + [(-1, 0)] * side + [(0, -1)] * side
    base = arc(square)
    moved = relaxed(base, cyclic=True)
    assert moved[0].tolist() == moved[-1].tolist() != base[0].tolist()
    assert doubled_area(*base.T, len(base) - 1) == 2 * side * side
    assert doubled_area(*moved.T, len(base) - 1) == pytest.approx(2 * side * side, rel=0.01)


@given(steps)
def test_the_doubled_area_is_that_of_the_shoelace_formula(directions: list[tuple[int, int]]) -> None:
    x, y = arc(directions).T
    expected = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    assert doubled_area(x, y, len(x) - 1) == expected
