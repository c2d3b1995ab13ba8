"""Smooth rings: arcs have keys, and may be left on the pixel edges one by one."""

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.outline.trace import trace
from uavseg.regions.smooth.arcs import STEPS_PER_PIXEL, find_nodes
from uavseg.regions.smooth.smooth_outlines import smooth_rings

Labels = NDArray[np.uint32]
NONE = np.empty(0, np.int64)


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    grain = draw(st.sampled_from([1, 3]))
    coarse = rng.integers(draw(st.integers(0, 1)), 4, tuple(rng.integers(1, 9, 2)))
    return np.kron(coarse, np.ones((grain, grain), int)).astype(np.uint32)


@given(label_images())
@settings(max_examples=60)
def test_every_arc_belongs_to_one_ring_or_to_two(labels: Labels) -> None:
    rings = trace(labels)
    smooth = smooth_rings(rings, find_nodes(rings, labels.shape), labels.shape, NONE)
    _, counts = np.unique(smooth.arcs, return_counts=True)
    assert set(counts.tolist()) <= {1, 2}
    assert set(smooth.owners.tolist()) == set(range(len(rings.labels)))


@given(label_images())
@settings(max_examples=60)
def test_rings_of_which_no_arc_is_smoothed_stay_on_their_pixel_edges(labels: Labels) -> None:
    rings = trace(labels)
    nodes = find_nodes(rings, labels.shape)
    every = np.unique(smooth_rings(rings, nodes, labels.shape, NONE).arcs)
    same = smooth_rings(rings, nodes, labels.shape, every).rings
    assert (same.pixel_areas() == rings.pixel_areas() * STEPS_PER_PIXEL**2).all()
    for k in range(len(rings.labels)):
        steps = same.vertices[same.starts[k] : same.starts[k + 1]]
        before = rings.vertices[rings.starts[k] : rings.starts[k + 1]] * STEPS_PER_PIXEL
        assert {*map(tuple, before.tolist())} <= {*map(tuple, steps.tolist())}
        assert ((steps == np.roll(steps, -1, axis=0)).sum(axis=1) == 1).all()  # only right angles


@given(label_images(), st.integers(0, 10**6))
@settings(max_examples=40)
def test_arcs_do_not_depend_on_the_other_arcs(labels: Labels, seed: int) -> None:
    rings = trace(labels)
    nodes = find_nodes(rings, labels.shape)
    smooth = smooth_rings(rings, nodes, labels.shape, NONE)
    arcs = np.unique(smooth.arcs)
    some = arcs[np.random.default_rng(seed).random(len(arcs)) < 0.5]
    mixed = smooth_rings(rings, nodes, labels.shape, some)
    untouched = np.setdiff1d(np.arange(len(rings.labels)), mixed.owners[np.isin(mixed.arcs, some)])
    for k in untouched:
        one, other = (r.rings.vertices[r.rings.starts[k] : r.rings.starts[k + 1]] for r in (smooth, mixed))
        assert np.array_equal(one, other)
