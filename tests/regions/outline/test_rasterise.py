"""Rasterising undoes tracing: any window of it, whole or from the edge table that a worker gets."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window, tiles
from uavseg.regions.outline.rings import LazyLabels, Rasteriser, edge_tables, rasterise
from uavseg.regions.outline.trace import trace

Labels = NDArray[np.uint32]


@st.composite
def label_images(draw: st.DrawFn) -> Labels:
    rows, cols = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    line = st.lists(st.integers(0, draw(st.integers(1, 3))), min_size=cols, max_size=cols)
    return np.array(draw(st.lists(line, min_size=rows, max_size=rows)), np.uint32)


def with_long_edges(seed: int) -> Labels:
    """873 x 184 pixels in blocks of 97 x 23: vertical edges longer than the limit of a piece."""
    blocks = np.random.default_rng(seed).integers(0, 4, (9, 8))
    return np.kron(blocks, np.ones((97, 23), np.int64)).astype(np.uint32)


@pytest.mark.slow
@settings(max_examples=60)
@given(label_images(), st.data())
def test_rasterising_undoes_tracing(labels: Labels, data: st.DataObject) -> None:
    rasteriser = Rasteriser(trace(labels))
    rows, cols = labels.shape
    assert np.array_equal(rasteriser(Window(0, 0, rows, cols)), labels)
    row, col = data.draw(st.integers(0, rows - 1)), data.draw(st.integers(0, cols - 1))
    part = Window(row, col, data.draw(st.integers(1, rows - row)), data.draw(st.integers(1, cols - col)))
    assert np.array_equal(rasteriser(part), labels[part.slices])


@pytest.mark.parametrize("seed", range(20))
def test_larger_images_are_rasterised_too(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, cols = [(*rng.integers(1, 30, 2),), (1, rng.integers(1, 30)), (rng.integers(1, 30), 1)][seed % 3]
    names = rng.integers(1, rng.integers(2, 6), (rows, cols))
    labels = np.where(rng.random((rows, cols)) < rng.choice([0.1, 0.4, 0.6, 0.95]), names, 0).astype(
        np.uint32
    )
    assert np.array_equal(rasterise(trace(labels), Window(0, 0, *labels.shape)), labels)


def test_the_largest_label_of_32_bits_is_rasterised() -> None:
    labels = np.array([[0, 2**32 - 1, 7], [3, 2**32 - 1, 2**31]], np.uint32)
    assert np.array_equal(rasterise(trace(labels), Window(0, 0, 2, 3)), labels)


@given(st.integers(0, 10**6), st.data())
@settings(max_examples=15)
def test_an_edge_table_holds_all_that_its_window_needs(seed: int, data: st.DataObject) -> None:
    labels = with_long_edges(seed)
    row, col = data.draw(st.integers(0, 800)), data.draw(st.integers(0, 180))
    window = Window(row, col, data.draw(st.integers(1, 873 - row)), data.draw(st.integers(1, 184 - col)))
    table = pickle.loads(pickle.dumps(Rasteriser(trace(labels)).edge_table(window)))
    assert np.array_equal(table.rasterise(), labels[window.slices])
    inside = (table.edges[:, 2] > 0) & (table.edges[:, 2] < window.cols)
    assert inside.all() and (table.edges[:, 0] < table.edges[:, 1]).all()


@pytest.mark.parametrize("seed", range(3))
def test_edge_tables_of_all_tiles_make_the_whole_image(seed: int) -> None:
    labels = with_long_edges(seed)
    windows = tiles(labels.shape, 128)
    made = np.zeros_like(labels)
    for table in edge_tables(trace(labels), windows):
        made[table.window.slices] = table.rasterise()
    assert np.array_equal(made, labels)


@given(label_images(), st.integers(0, 10), st.integers(0, 10))
def test_lazy_labels_give_the_rows_of_an_array(labels: Labels, first: int, last: int) -> None:
    lazy = LazyLabels(Rasteriser(trace(labels)), labels.shape)
    if min(first, labels.shape[0]) < min(last, labels.shape[0]):
        assert np.array_equal(lazy[first:last], labels[first:last])
