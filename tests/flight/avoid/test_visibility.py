"""Visibility: legs against shapely, shortest paths against scipy's, least sums against numpy's."""

import numpy as np
import shapely
from hypothesis import given, settings, strategies as st

from uavseg.flight.avoid.free_space import Edges, cheapest, shortest_paths


@given(st.integers(0, 10**6))
@settings(max_examples=60)
def test_a_leg_crosses_what_shapely_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 12, (4, 2, 2))
    boxes = [shapely.box(*low, *(low + 1 + size)) for low, size in corners]
    polygons = np.array([*boxes, shapely.box(0, 0, 9, 9) - shapely.box(2, 2, 5, 5)], object)
    starts, ends = rng.integers(-2, 15, (2, 300, 2)).astype(float)
    moved = (starts != ends).any(axis=1)
    starts, ends = starts[moved], ends[moved]
    found = Edges(polygons).crossed(starts, ends)
    legs = shapely.linestrings(np.stack([starts, ends], axis=1))
    outlines = shapely.union_all(shapely.boundary(polygons))
    assert np.array_equal(found, shapely.intersects(outlines, legs))


def test_nothing_blocks_where_there_are_no_edges() -> None:
    assert not Edges(shapely.MultiPolygon()).crossed(np.zeros((3, 2)), np.ones((3, 2))).any()


@given(st.integers(0, 10**6))
@settings(max_examples=40)
def test_paths_are_shortest_and_their_nodes_add_up(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights = np.where(rng.random((9, 9)) < 0.35, rng.random((9, 9)), np.inf)
    np.fill_diagonal(weights, 0)
    lengths, before = shortest_paths(weights)
    expected = weights.copy()
    for _ in range(9):  # paths of up to 512 edges, by squaring
        expected = (expected[:, :, None] + expected[None]).min(axis=1)
    assert np.allclose(lengths, expected)
    for start, end in np.argwhere(np.isfinite(lengths)).tolist():
        total, here = 0.0, end
        while here != start:
            total += weights[before[start, here], here]
            here = int(before[start, here])
        assert np.isclose(total, lengths[start, end])


@given(st.integers(0, 10**6))
@settings(max_examples=40)
def test_least_sums(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sparse = np.where(rng.random((5, 7)) < 0.5, rng.random((5, 7)), np.inf)
    matrix = rng.random((7, 4))
    lengths, through = cheapest(sparse, matrix)
    sums = sparse[:, :, None] + matrix[None]
    assert np.array_equal(lengths, sums.min(axis=1))
    finite = np.isfinite(lengths)
    assert np.array_equal(through[finite], sums.argmin(axis=1)[finite])
