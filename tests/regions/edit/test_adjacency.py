"""Region adjacency: borders are counted in edges between pixels."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.edit.eliminate import border_lengths
from uavseg.regions.outline.trace import STRIP

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    side = int(rng.integers(1, 5))
    coarse = rng.integers(draw(st.integers(0, 1)), rng.integers(2, 7), tuple(rng.integers(1, 13, 2)))
    return np.kron(coarse, np.ones((side, side), int)).astype(np.uint32)


def borders(labels: Labels) -> dict[tuple[int, int], int]:
    pairs, lengths = border_lengths(labels)
    return dict(zip(map(tuple, pairs.tolist()), lengths.tolist(), strict=True))


@pytest.mark.slow
@given(label_images())
@settings(max_examples=80)
def test_lengths_count_the_edges_between_adjacent_pixels(labels: Labels) -> None:
    rows, cols = labels.shape
    steps = [(r, c, r + down, c + 1 - down) for r in range(rows) for c in range(cols) for down in (0, 1)]
    sides = [sorted((int(labels[r, c]), int(labels[s, d]))) for r, c, s, d in steps if s < rows and d < cols]
    assert borders(labels) == Counter((a, b) for a, b in sides if 0 < a < b)


@given(label_images(), st.permutations(range(1, 7)))
@settings(max_examples=40)
def test_a_transposed_and_relabelled_image_has_the_same_borders(labels: Labels, names: list[int]) -> None:
    new = np.array([0, *names], np.uint32)
    relabelled = borders(np.ascontiguousarray(new[labels].T))
    expected = {tuple(sorted((int(new[a]), int(new[b])))): n for (a, b), n in borders(labels).items()}
    assert relabelled == expected


def test_borders_along_and_across_the_strips_that_are_read_count_once() -> None:
    labels = (1 + np.arange(2 * STRIP + 9) % 2)[:, None].repeat(3, axis=1).astype(np.uint32)
    assert borders(labels) == {(1, 2): 3 * (len(labels) - 1)}
    assert borders(np.ascontiguousarray(labels.T)) == {(1, 2): 3 * (len(labels) - 1)}
    halves = np.repeat(np.array([[1, 2]], np.uint32), len(labels), axis=0)
    assert borders(halves) == {(1, 2): len(labels)}


def test_a_region_alone_and_corners_have_no_border() -> None:
    assert borders(np.array([[1, 0], [0, 2]], np.uint32)) == {}
    assert borders(np.zeros((3, 2), np.uint32)) == {}
