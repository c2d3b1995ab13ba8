"""Distances over blocks of cells, beside those over single cells."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.ndimage import label

from uavseg.occupancy.explore.block_graph import block_graph
from uavseg.occupancy.paths.astar import shortest_path


def drawn(seed: int, rows: int, cols: int, share: float) -> np.ndarray:
    return np.random.default_rng(seed).random((rows, cols)) < share


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 40), st.integers(1, 9), st.floats(0.3, 1))
def test_nodes_are_connected_as_the_cells_are(
    seed: int, rows: int, cols: int, side: int, share: float
) -> None:
    mask = drawn(seed, rows, cols, share)
    graph = block_graph(mask, side)
    assert np.array_equal(graph.node_of >= 0, mask)
    labels, _ = label(mask)
    for node, place in enumerate(graph.places[:5]):
        reached = np.isfinite(graph.distances(node))
        assert np.array_equal(reached, labels[tuple(graph.places.T)] == labels[tuple(place)])


@pytest.mark.parametrize("seed", range(6))
def test_distances_are_those_over_cells_but_for_a_few_per_cent(seed: int) -> None:
    from scipy.ndimage import gaussian_filter

    mask = gaussian_filter(np.random.default_rng(seed).normal(size=(120, 150)), 4) < 0.05
    graph = block_graph(mask, 4)
    start = int(graph.node_of[tuple(graph.places[len(graph.places) // 2])])
    away = graph.distances(start)
    for node in np.flatnonzero(np.isfinite(away))[::40]:
        exact = shortest_path(mask, tuple(graph.places[start]), tuple(graph.places[node])).cost
        assert away[node] <= 1.15 * exact + 6 and away[node] >= 0.9 * exact - 6


def test_each_node_belongs_to_its_nearest_source() -> None:
    graph = block_graph(drawn(1, 60, 60, 0.8), 4)
    sources = np.array([3, 50, 120])
    away, owners = graph.nearest(sources)
    each = np.stack([graph.distances(int(source)) for source in sources])
    assert np.array_equal(away, each.min(axis=0))
    reached = np.isfinite(away)
    assert np.array_equal(each[owners[reached], np.flatnonzero(reached)], away[reached])
    assert (owners[~reached] == -1).all()
