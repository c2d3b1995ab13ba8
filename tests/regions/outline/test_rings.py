"""Rings: their areas, their selection and their order."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.regions.outline.rings import Rings, reorder_rings
from uavseg.regions.outline.trace import trace

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rows, cols = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    line = st.lists(st.integers(0, draw(st.integers(1, 3))), min_size=cols, max_size=cols)
    return np.array(draw(st.lists(line, min_size=rows, max_size=rows)), np.uint32)


def equal(one: Rings, other: Rings) -> bool:
    names = ("vertices", "starts", "labels", "parts")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def without_nodes(rings: Rings) -> Rings:
    """Rings of their turns alone: a region keeps the vertices where the borders of others end."""
    turns = []
    for k in range(len(rings.labels)):
        ring = rings.vertices[rings.starts[k] : rings.starts[k + 1]]
        before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
        turns.append(((before != ring) & (ring != after)).sum(axis=1) == 0)
    keep = np.concatenate([np.zeros(0, bool), *turns])
    starts = np.concatenate([[0], np.cumsum(keep)])[rings.starts]
    return replace(rings, vertices=rings.vertices[keep], starts=starts)


@pytest.mark.parametrize("seed", range(20))
def test_areas_sum_to_the_pixels_of_each_label(seed: int) -> None:
    rng = np.random.default_rng(seed)
    labels = np.where(rng.random((17, 23)) < 0.6, rng.integers(1, 6, (17, 23)), 0).astype(np.uint32)
    rings = trace(labels)
    sums = np.bincount(rings.labels, rings.pixel_areas(), 6)
    assert sums[1:].tolist() == np.bincount(labels.reshape(-1), minlength=6)[1:].tolist()


@settings(max_examples=40)
@given(label_images(), st.permutations([1, 2, 3]))
def test_selected_rings_are_those_of_an_image_with_the_selected_labels(
    labels: Labels, names: list[int]
) -> None:
    rings = trace(labels)
    kept = rings.labels > 1
    new = np.array([0, *names])
    selected = rings.select(kept, new[rings.labels[kept]])
    expected = trace(np.where(labels > 1, new[labels], 0).astype(np.uint32))
    assert equal(without_nodes(selected), without_nodes(expected))


@pytest.mark.slow
@settings(max_examples=40)
@given(label_images())
def test_selecting_all_rings_changes_nothing(labels: Labels) -> None:
    rings = trace(labels)
    assert equal(rings.select(np.ones(len(rings.labels), bool)), rings)


@settings(max_examples=40)
@given(label_images(), st.randoms(use_true_random=False))
def test_reordering_back_and_forth_changes_nothing(labels: Labels, random: object) -> None:
    rings = trace(labels)
    order = list(range(len(rings.labels)))
    random.shuffle(order)  # type: ignore[attr-defined]
    back = np.argsort(order).astype(np.int64)
    vertices, starts = reorder_rings(rings.vertices, rings.starts, np.array(order, np.int64))
    assert sorted(np.diff(starts)) == sorted(np.diff(rings.starts))
    vertices, starts = reorder_rings(vertices, starts, back)
    assert np.array_equal(vertices, rings.vertices) and np.array_equal(starts, rings.starts)


@pytest.mark.slow
@pytest.mark.parametrize("module", ["outline.rings", "shapes", "table", "formats.read", "formats.export"])
def test_rings_tables_and_files_of_regions_load_no_tracer(module: str) -> None:
    program = f"import sys, uavseg.regions.{module}; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert f"uavseg.regions.{module}" in loaded
    tracer = ("trace", "chains", "linking", "stitch", "rasterise")
    assert not loaded & {f"uavseg.regions.outline.{name}" for name in tracer}
