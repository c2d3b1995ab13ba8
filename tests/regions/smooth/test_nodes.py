"""Nodes are the pixel corners where three or four boundaries meet."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.outline.trace import trace
from uavseg.regions.smooth.arcs import find_nodes

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    """Noise or blocks of several labels, with background or without."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    grain = draw(st.sampled_from([1, 2, 5]))
    coarse = rng.integers(draw(st.integers(0, 1)), rng.integers(2, 6), tuple(rng.integers(1, 20, 2)))
    return np.kron(coarse, np.ones((grain, grain), int)).astype(np.uint32)


def nodes_by_force(labels: Labels) -> list[int]:
    """Corners at which three or four of the edges between adjacent pixels differ."""
    framed = np.pad(labels, 1)
    a, b, c, d = framed[:-1, :-1], framed[:-1, 1:], framed[1:, :-1], framed[1:, 1:]
    edges = (a != b).astype(int) + (c != d) + (a != c) + (b != d)
    return np.flatnonzero(edges > 2).tolist()


@given(label_images())
@settings(max_examples=80)
def test_nodes_are_where_boundaries_meet(labels: Labels) -> None:
    nodes = find_nodes(trace(labels), labels.shape)
    assert nodes.by_row.tolist() == nodes_by_force(labels)
    assert nodes.by_col.tolist() == nodes_by_force(labels.T)


def test_a_region_alone_has_no_node() -> None:
    labels = np.array([[0, 1, 0], [1, 1, 1]], np.uint32)
    assert len(find_nodes(trace(labels), labels.shape).by_row) == 0
