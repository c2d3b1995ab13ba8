"""Candidate ranges have edges of few digits, none is empty, and no edge is a mean."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.segmentation.range_choice import edge_beside_means, propose_ranges

GREYS = 65536


@st.composite
def histograms(draw: st.DrawFn) -> np.ndarray:
    """Some greys, near each other or far apart."""
    first = draw(st.integers(0, GREYS - 1))
    reach = draw(st.sampled_from([3, 40, 300, 5000, GREYS]))
    steps = draw(st.lists(st.integers(0, reach), min_size=1, max_size=40))
    histogram = np.zeros(GREYS, np.int64)
    greys = np.minimum(first % max(GREYS - reach, 1) + np.array(steps), GREYS - 1)
    np.add.at(histogram, greys, draw(st.integers(1, 10**9)))
    return histogram


@pytest.mark.slow
@settings(max_examples=200)
@given(histograms(), st.sampled_from([None, 2, 3, 5, 8]))
def test_no_range_is_empty(histogram: np.ndarray, count: int | None) -> None:
    candidates = propose_ranges(histogram, count)
    bounds = (0.0, *candidates.edges, 1.0)
    assert len(candidates.edges) + 1 <= (count or 6)
    assert list(bounds) == sorted(set(bounds))
    v = np.flatnonzero(histogram) / (GREYS - 1)
    assert (
        len(set(np.searchsorted(candidates.edges, v).tolist())) == len(candidates.edges) + 1
        if candidates.edges
        else True
    )
    assert all(round(edge, 6) == edge for edge in candidates.edges)


def test_a_wide_gap_is_split_by_a_number_of_two_digits() -> None:
    histogram = np.zeros(GREYS, np.int64)
    histogram[[16448, 51400]] = 9, 3
    assert propose_ranges(histogram).edges == (0.52,)
    histogram[16448:51400] = 1
    [edge] = propose_ranges(histogram, 2).edges
    assert round(edge, 3) == edge and edge == pytest.approx((16448 + 51400) / 2 / 65535, abs=0.01)


def test_edges_lie_within_half_a_bin_of_the_optimum() -> None:
    v = np.random.default_rng(3).normal([0.3, 0.62], 0.05, (40000, 2)).ravel()
    histogram = np.bincount(np.round(np.clip(v, 0, 1) * 65535).astype(int), minlength=GREYS)
    [edge] = propose_ranges(histogram, 2).edges
    assert edge == pytest.approx(0.46, abs=0.004) and len(repr(edge)) <= 5


def test_one_mean_is_one_class() -> None:
    histogram = np.zeros(GREYS, np.int64)
    histogram[1234] = 50
    assert propose_ranges(histogram).edges == () and propose_ranges(histogram, 4).edges == ()


@given(st.integers(1, 999_999), st.integers(1, 4096), st.integers(-1, 1))
def test_a_number_beside_an_edge_cannot_be_a_mean(millionths: int, pixels: int, off: int) -> None:
    edge = millionths / 10**6
    beside = edge_beside_means(edge)
    assert edge < beside < edge + 2e-5
    total = round(Fraction(beside) * 65535 * pixels) + off
    assert total / (65535.0 * pixels) != beside
