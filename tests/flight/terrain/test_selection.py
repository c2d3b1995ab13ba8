"""Few points of a profile: within the tolerance, and no steeper than allowed."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings, strategies as st

from uavseg.flight.terrain.altitude_profile import FIRST_WINDOW, limit_slopes, points_within

profiles = st.lists(st.floats(-100, 100), min_size=2, max_size=40)


def spaced(count: int, seed: int) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).uniform(0.1, 5, count))


@given(profiles, st.integers(0, 99), st.floats(0.1, 30))
def test_lines_between_the_points_stay_within_the_tolerance(
    heights: list[float], seed: int, tolerance_m: float
) -> None:
    along, height = spaced(len(heights), seed), np.array(heights)
    points = points_within(along, height, tolerance_m)
    assert points[0] == 0 and points[-1] == len(along) - 1 and np.all(np.diff(points) > 0)
    straight = np.interp(along, along[points], height[points])
    assert np.abs(straight - height).max() <= tolerance_m + 1e-9


@given(profiles, st.integers(0, 99), st.floats(0.1, 30))
def test_each_point_is_the_farthest_that_one_line_reaches(
    heights: list[float], seed: int, tolerance_m: float
) -> None:
    along, height = spaced(len(heights), seed), np.array(heights)

    def reaches(start: int, end: int) -> bool:
        line = np.interp(along[start : end + 1], along[[start, end]], height[[start, end]])
        return bool((np.abs(line - height[start : end + 1]) <= tolerance_m + 1e-9).all())

    points = points_within(along, height, tolerance_m)
    for start, end in pairwise(points):
        farthest = max(k for k in range(start + 1, len(along)) if reaches(start, k))
        # a rounding error may decide where a line passes a sample exactly at the tolerance
        assert end == farthest or not all(
            np.abs(
                np.interp(along[start : farthest + 1], along[[start, farthest]], height[[start, farthest]])
                - height[start : farthest + 1]
            )
            < tolerance_m - 1e-9
        )


def test_long_straight_profiles_need_two_points() -> None:
    along = np.arange(20.0 * FIRST_WINDOW)
    assert points_within(along, 0.3 * along, 1.0) == [0, len(along) - 1]
    assert points_within(np.zeros(2), np.array([1.0, 1.0]), 1.0) == [0, 1]


@given(profiles, st.integers(0, 99), st.floats(0.01, 3), st.floats(0.01, 3))
@settings(max_examples=60)
def test_the_limited_profile_is_the_lowest_above_that_is_not_too_steep(
    heights: list[float], seed: int, climb: float, descent: float
) -> None:
    along, height = spaced(len(heights), seed), np.array(heights)
    limited = limit_slopes(along, height, climb, descent)
    slope = np.diff(limited) / np.diff(along)
    assert (limited >= height - 1e-9).all()
    assert (slope <= climb + 1e-6).all() and (slope >= -descent - 1e-6).all()
    ahead = along[None, :] - along[:, None]
    needed = height[None, :] - np.where(ahead > 0, climb * ahead, -descent * ahead)
    assert np.allclose(limited, needed.max(axis=1), atol=1e-6)
