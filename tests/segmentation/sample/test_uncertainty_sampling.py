"""Cells around which a raster is undecided: the same as a plain search over all discs."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.sample import similarity
from uavseg.regions.sample.similarity import half_widths, most_uncertain_cells
from uavseg.units import GREY_MAX


def drawn(seed: int) -> tuple[NDArray[np.uint32], NDArray[np.uint8], NDArray[np.bool_]]:
    """Sums, counts and taken cells of some blocks; many are equal."""
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(1, 5)) * 8, int(rng.integers(1, 5)) * 8)
    sums = (rng.integers(0, 9, shape) * GREY_MAX * 8).astype(np.uint32)
    counts = np.where(rng.random(shape) < 0.02, 63, 64).astype(np.uint8)
    return sums, counts, rng.random(shape) < 0.02


def plainly(
    sums: NDArray[np.uint32], counts: NDArray[np.uint8], taken: NDArray[np.bool_], radius: float, least: float
) -> list[tuple[float, int, int]]:
    """Every disc by how decided it is, then by row and column."""
    found = []
    allowed = (counts == 64) & ~taken
    for row, col in np.ndindex(sums.shape):
        doubts = []
        for away in np.ndindex(9, 9):
            r, c = row + away[0] - 4, col + away[1] - 4
            gaps = [max(abs(a - b) * 8 - 4, 0) for a, b in ((r, row), (c, col))]
            if np.hypot(*gaps) >= radius:
                continue
            inside = 0 <= r < sums.shape[0] and 0 <= c < sums.shape[1]
            total = int(sums[r, c]) if inside and allowed[r, c] else None
            doubts.append(None if total is None else 64 * GREY_MAX - abs(2 * total - 64 * GREY_MAX))
        if None not in doubts:
            known = [doubt for doubt in doubts if doubt is not None]
            if sum(known) >= least * 64 * GREY_MAX * len(known):
                found.append((-sum(known), row, col))
    return sorted(found)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.sampled_from([8.0, 12.0, 16.0, 23.5]), st.sampled_from([0.0, 0.4]))
@settings(max_examples=8)
def test_a_plain_search_finds_the_same(seed: int, radius: float, least: float) -> None:
    sums, counts, taken = (values[:16, :16] for values in drawn(seed))
    expected = [list(found[1:]) for found in plainly(sums, counts, taken, radius, least)]
    assert most_uncertain_cells(sums, counts, taken, radius, 10_000, least).tolist() == expected
    assert most_uncertain_cells(sums, counts, taken, radius, 5, least).tolist() == expected[:5]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_the_height_of_a_strip_changes_nothing(seed: int) -> None:
    expected = most_uncertain_cells(*drawn(seed), 12.0, 7, 0.1).tolist()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(similarity, "_STRIP", 50)
        assert most_uncertain_cells(*drawn(seed), 12.0, 7, 0.1).tolist() == expected


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_what_is_likely_and_what_is_unlikely_are_equally_decided(seed: int) -> None:
    sums, counts, taken = drawn(seed)
    turned = np.uint32(GREY_MAX * 64) - sums
    one, other = (most_uncertain_cells(part, counts, taken, 8.0, 50, 0.0) for part in (sums, turned))
    assert one.tolist() == other.tolist()


@pytest.mark.parametrize("radius", [4.5, 8, 11.9, 12, 12.1, 16, 31, 32, 60.5])
def test_a_disc_lies_within_the_cells_that_it_touches(radius: float) -> None:
    widths = half_widths(radius)
    size = 8 * len(widths)
    row, col = np.indices((size, size)) + 0.5 - size / 2
    touched = (row**2 + col**2 < radius**2).reshape(len(widths), 8, len(widths), 8).any((1, 3))
    reach = len(widths) // 2
    allowed = np.abs(np.arange(-reach, reach + 1)) <= widths[:, None]
    assert not (touched & ~allowed).any() and allowed.sum() <= np.pi * (radius + 12) ** 2 / 64


def test_nothing_decided_is_found() -> None:
    sums = np.zeros((8, 8), np.uint32)
    full, free = np.full((8, 8), 64, np.uint8), np.zeros((8, 8), bool)
    assert len(most_uncertain_cells(sums, full, free, 8.0, 16, 0.5)) == 0
