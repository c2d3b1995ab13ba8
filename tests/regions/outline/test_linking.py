"""Linking: chains of tiles become the rings of the whole, and rings that touch themselves are split."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline import trace as tracing
from uavseg.regions.outline.chains import pack_chains, trace_tile
from uavseg.regions.outline.rings import Rings
from uavseg.regions.outline.trace import link_chains, link_rings, split_simple_rings, trace
from uavseg.segmentation.components import label_equal_values

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rows, cols = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    line = st.lists(st.integers(0, draw(st.integers(1, 3))), min_size=cols, max_size=cols)
    return np.array(draw(st.lists(line, min_size=rows, max_size=rows)), np.uint32)


def equal(one: Rings, other: Rings) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("vertices", "starts", "labels", "parts")
    )


@pytest.mark.slow
@settings(max_examples=60)
@given(label_images(), st.integers(1, 5), st.integers(1, 5), st.randoms())
def test_tiles_of_any_size_in_any_order_link_to_the_same_rings(
    labels: Labels, tile_rows: int, tile_cols: int, random: object
) -> None:
    pieces, names = pieces_of(labels)
    image = np.pad(labels, 1)
    windows = [
        Window(row, col, tile_rows, tile_cols).clipped(labels.shape)
        for row in range(0, labels.shape[0], tile_rows)
        for col in range(0, labels.shape[1], tile_cols)
    ]
    random.shuffle(windows)  # type: ignore[attr-defined]
    chains = [
        trace_tile(
            np.ascontiguousarray(image[w.row : w.row + w.rows + 2, w.col : w.col + w.cols + 2]),
            np.ascontiguousarray(pieces[w.slices]),
            1,
            (w.row, w.col),
            labels.shape[1],
        )
        for w in windows
    ]
    assert equal(
        link_rings([pack_chains(part) for part in chains], names, np.arange(len(names))), trace(labels)
    )


def pieces_of(labels: Labels) -> tuple[Labels, NDArray[np.int64]]:
    """4-connected pieces of one label, 1..n in raster order, and the label of each (0 for piece 0)."""
    pieces, names = np.zeros(labels.shape, np.uint32), [0]
    for start in map(tuple, np.argwhere(labels > 0)):
        if pieces[start]:
            continue
        waiting, label = [start], labels[start]
        pieces[start] = len(names)
        while waiting:
            r, c = waiting.pop()
            for near in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                within = 0 <= near[0] < labels.shape[0] and 0 <= near[1] < labels.shape[1]
                if within and labels[near] == label and not pieces[near]:
                    pieces[near] = len(names)
                    waiting.append(near)
        names.append(int(label))
    return pieces, np.array(names, np.int64)


def signed_areas(vertices: NDArray[np.int32], starts: NDArray[np.int64]) -> list[int]:
    """Twice the area of each ring (shoelace formula), positive for exteriors."""
    found = []
    for k in range(len(starts) - 1):
        row, col = vertices[starts[k] : starts[k + 1]].T.astype(int)
        found.append(int((col * np.roll(row, -1) - row * np.roll(col, -1)).sum()))
    return found


@settings(max_examples=60)
@given(label_images())
def test_splitting_keeps_areas_and_leaves_no_vertex_twice(labels: Labels) -> None:
    components, _ = label_equal_values(labels)
    chains = trace_tile(np.pad(labels, 1), components, 1, (0, 0), labels.shape[1])
    vertices, pinched, starts, owners = link_chains(chains.vertices, chains.pinched, chains.table)
    simple, simple_starts, simple_owners, hole = split_simple_rings(vertices, pinched, starts, owners)
    before, after = signed_areas(vertices, starts), signed_areas(simple, simple_starts)
    for owner in np.unique(owners):
        assert sum(np.array(before)[owners == owner]) == sum(np.array(after)[simple_owners == owner])
    assert [area < 0 for area in after] == hole.astype(bool).tolist()
    for k in range(len(hole)):
        ring = simple[simple_starts[k] : simple_starts[k + 1]].tolist()
        assert ring[0] == min(ring) and len({tuple(vertex) for vertex in ring}) == len(ring)
    assert sorted(simple.tolist()) == sorted(vertices.tolist())


def test_a_ring_that_touches_itself_is_an_exterior_and_a_hole() -> None:
    labels = np.array([[1, 1, 0], [1, 0, 1], [1, 1, 1]], np.uint32)
    components, _ = label_equal_values(labels)
    chains = trace_tile(np.pad(labels, 1), components, 1, (0, 0), 3)
    linked = link_chains(chains.vertices, chains.pinched, chains.table)
    assert len(linked[3]) == 1  # one ring, which passes the corner (1, 2) twice
    *_, hole = split_simple_rings(*linked)
    assert hole.tolist() == [0, 1] or hole.tolist() == [1, 0]


@pytest.mark.slow
@given(label_images(), st.sampled_from([1, 9, 40, 300]))
@settings(max_examples=40)
def test_packed_chains_are_the_chains(labels: Labels, side: int) -> None:
    large = np.kron(labels[:4, :4], np.ones((side, side), np.uint32))  # steps of one byte and of five
    components, _ = label_equal_values(large)
    chains = trace_tile(np.pad(large, 1), components, 1, (5, 70_000), 200_000)
    packed = pack_chains(chains)
    again = packed.unpacked(np.arange(len(chains.table)))
    for name in ("vertices", "pinched", "table"):
        assert np.array_equal(getattr(again, name), getattr(chains, name))
    some = np.arange(len(chains.table))[::-2].copy()
    ends = np.append(chains.table[1:, 1], len(chains.vertices))
    picked = [chains.vertices[chains.table[k, 1] : ends[k]] for k in some]
    assert np.array_equal(packed.unpacked(some).vertices, np.concatenate([chains.vertices[:0], *picked]))


@given(label_images(), st.integers(1, 40))
@settings(max_examples=40)
def test_how_many_regions_are_linked_at_a_time_changes_nothing(labels: Labels, batch: int) -> None:
    whole = trace(labels)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracing, "BATCH", batch)
        assert equal(trace(labels), whole)


def test_beside_the_rings_little_memory_is_needed_to_link_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracing, "BATCH", 1 << 12)
    jitter = np.random.default_rng(1).integers(0, 12, 1024)
    labels = (1 + (np.arange(1024)[:, None] + jitter) // 16).astype(np.uint32)  # bands with ragged borders
    strips = tracing.trace_strips(labels)
    tracemalloc.start()
    rings = tracing.link_strips(strips)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1.5 * sum(part.nbytes for part in (rings.vertices, rings.starts, rings.labels, rings.parts))
