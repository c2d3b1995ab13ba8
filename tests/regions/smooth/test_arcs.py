"""Arcs: the same corners in the same order from both rings that share them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import shapely
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import trace
from uavseg.regions.smooth.arcs import (
    STEPS_PER_PIXEL,
    Nodes,
    edge_key,
    find_crossing,
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


@st.composite
def blobs(draw: st.DrawFn) -> Labels:
    """Regions of many corners, with holes and rings without nodes."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    noise = rng.random(tuple(rng.integers(4, 20, 2)))
    noise = noise + np.roll(noise, 1, axis=0) + np.roll(noise, 1, axis=1)
    edges = np.quantile(noise, np.linspace(0, 1, draw(st.integers(2, 4)) + 1)[1:-1])
    return np.digitize(noise, edges).astype(np.uint32)


def turned_to_first(ring: NDArray) -> list[list[int]]:
    return np.roll(ring, -int(np.lexsort(ring.T[::-1])[0]), axis=0).tolist()


@given(blobs())
@settings(max_examples=25)
def test_arcs_are_the_boundaries_once_and_make_the_same_rings(labels: Labels) -> None:
    rings = trace(labels)
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


@given(blobs(), st.integers(0, 10**6), st.sampled_from([100, 250, 600]))
@settings(max_examples=25, deadline=None)
def test_crossing_arcs_are_those_of_a_comparison_of_all_pairs(labels: Labels, seed: int, shift: int) -> None:
    """Some arcs have corners elsewhere, but for their ends."""
    rings = trace(labels)
    arcs, _ = split_arcs(rings, labels.shape)
    rng = np.random.default_rng(seed)
    changed = rng.random(len(arcs.counts)) < 0.5
    moved = changed.repeat(arcs.counts)
    moved[np.append(arcs.starts, arcs.starts + arcs.counts - 1)] = False
    offsets = rng.integers(-shift, shift + 1, arcs.corners.shape)
    arcs = replace(arcs, corners=arcs.corners + moved[:, None] * offsets)
    lines = [
        shapely.LineString(arcs.corners[start : start + count])
        for start, count in zip(arcs.starts, arcs.counts, strict=True)
    ]
    ends = [shapely.MultiPoint([line.coords[0], line.coords[-1]]) for line in lines]
    crossing = {k for k, line in enumerate(lines) if changed[k] and not line.is_simple}
    for one, other in combinations(range(len(lines)), 2):
        met = lines[one].intersection(lines[other])
        if (changed[one] or changed[other]) and not (ends[one].covers(met) and ends[other].covers(met)):
            crossing |= {one, other} if not met.is_empty else set()
    assert set(np.flatnonzero(find_crossing(arcs, changed)).tolist()) == crossing
