"""Arcs: the same corners in the same order from both rings that share them."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import trace
from uavseg.regions.smooth.arcs import (
    STEPS_PER_PIXEL,
    Nodes,
    edge_key,
    find_nodes,
    is_reversed,
    join_arcs,
    load_arc,
    split_arcs,
    unit_corners,
)

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    return rng.integers(draw(st.integers(0, 1)), 4, tuple(rng.integers(1, 9, 2))).astype(np.uint32)


def corners_of(rings: Rings, ring: int, nodes: Nodes, shape: tuple[int, ...]) -> tuple[NDArray, NDArray]:
    begin, end = rings.starts[ring], rings.starts[ring + 1]
    corners, fixed = np.zeros((500, 2), np.int64), np.zeros(500, np.uint8)
    count = unit_corners(rings.vertices, begin, end, nodes.by_row, nodes.by_col, *shape, corners, fixed)
    return corners[:count], fixed[:count]


@given(label_images())
@settings(max_examples=60)
def test_corners_follow_a_ring_in_unit_steps(labels: Labels) -> None:
    rings = trace(labels)
    nodes = find_nodes(rings, labels.shape)
    keys = set(nodes.by_row.tolist())
    for ring in range(len(rings.labels)):
        corners, fixed = corners_of(rings, ring, nodes, labels.shape)
        assert (np.abs(corners - np.roll(corners, -1, axis=0)).sum(axis=1) == 1).all()
        vertices = rings.vertices[rings.starts[ring] : rings.starts[ring + 1]]
        assert {*map(tuple, vertices.tolist())} <= {*map(tuple, corners.tolist())}
        on_node = [row * (labels.shape[1] + 1) + col in keys for row, col in corners.tolist()]
        assert (fixed[on_node] == 1).all()
        inside = ((corners > 0) & (corners < labels.shape)).all(axis=1)
        assert (fixed[inside & ~np.array(on_node, bool)] == 0).all()


@given(label_images())
@settings(max_examples=60)
def test_an_arc_has_the_same_corners_in_both_directions(labels: Labels) -> None:
    rings = trace(labels)
    nodes = find_nodes(rings, labels.shape)
    for ring in range(len(rings.labels)):
        corners, fixed = corners_of(rings, ring, nodes, labels.shape)
        total = len(corners)
        ends = np.flatnonzero(fixed)
        for first, last in zip(ends, np.roll(ends, -1), strict=True):
            n = int(last - first) % total or total
            backwards = np.ascontiguousarray(corners[::-1])
            arcs = []
            for own, start in ((corners, int(first)), (backwards, total - 1 - int(last))):
                base = np.zeros((2, n + 1))
                reverse = is_reversed(own, total, start, n)
                origin = load_arc(own, total, start, n, reverse, base)
                second = (origin - 1 if reverse else origin + 1) % total
                arcs.append((base.tolist(), edge_key(own, origin, second, labels.shape[1])))
            assert arcs[0] == arcs[1]


def turned_to_first(ring: NDArray) -> list[list[int]]:
    return np.roll(ring, -int(np.lexsort(ring.T[::-1])[0]), axis=0).tolist()


@given(label_images())
@settings(max_examples=60)
def test_arcs_are_the_boundaries_once_and_make_the_same_rings(labels: Labels) -> None:
    rings = trace(labels)
    if not len(rings.labels):
        return
    arcs, fixed = split_arcs(rings, labels.shape)
    padded = np.pad(labels, 1).astype(np.int64)
    boundaries = sum(np.count_nonzero(np.diff(padded, axis=axis)) for axis in (0, 1))
    length = 0
    for k, (start, count) in enumerate(zip(arcs.starts, arcs.counts, strict=True)):
        corners = arcs.corners[start : start + count] // STEPS_PER_PIXEL
        length += int(np.abs(np.diff(corners, axis=0)).sum())
        (row, col), (down, right) = corners[0], np.sign(corners[1] - corners[0])
        beside = padded[row + (down > 0), col : col + 2] if down else padded[row : row + 2, col + (right > 0)]
        assert sorted(arcs.sides[k]) == sorted(beside)
        assert not fixed[start + 1 : start + count - 1].any()
    assert length == boundaries
    made = join_arcs(rings, arcs)
    for ring in range(len(rings.labels)):
        before, after = (one.vertices[one.starts[ring] : one.starts[ring + 1]] for one in (rings, made))
        assert turned_to_first(after // STEPS_PER_PIXEL) == turned_to_first(before)
