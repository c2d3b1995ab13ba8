"""Components are those of scipy, sums are those of plain loops, and unions are those of graphs."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skimage import measure

from uavseg.segmentation.components import (
    label_components,
    label_equal_values,
    union_roots,
    view_as_words,
)

seeds = st.integers(0, 100_000)
shapes = st.tuples(st.integers(1, 45), st.integers(1, 45))


def blots(seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    side = int(rng.choice([1, 1, 2, 7]))
    coarse = rng.random((shape[0] // side + 1, shape[1] // side + 1)) < rng.choice([0.3, 0.5, 0.6, 0.9])
    return coarse.repeat(side, 0).repeat(side, 1)[: shape[0], : shape[1]].astype(np.uint8)


def picture(text: str) -> NDArray[np.uint32]:
    """Digits are labels, a point is nothing."""
    return np.array([[0 if char == "." else int(char) for char in line] for line in text.split()], np.uint32)


@settings(max_examples=150)
@given(seeds, shapes, st.booleans())
def test_components_are_those_of_scipy(seed: int, shape: tuple[int, int], diagonally: bool) -> None:
    inside = blots(seed, shape)
    labels, count = label_components(inside, diagonally=diagonally)
    expected, number = ndimage.label(inside, np.ones((3, 3)) if diagonally else None)
    assert count == number
    assert np.array_equal(labels, expected)


@settings(max_examples=40)
@given(seeds, shapes, st.integers(0, 9))
def test_a_margin_is_left_out_as_if_it_were_not_there(seed: int, shape: tuple[int, int], margin: int) -> None:
    inside = blots(seed, (shape[0] + 2 * margin, shape[1] + 2 * margin))
    core = np.ascontiguousarray(inside[margin : margin + shape[0], margin : margin + shape[1]])
    labels, count = label_components(inside, margin)
    expected, number = label_components(core)
    assert count == number and np.array_equal(labels, expected)


@settings(max_examples=60)
@given(seeds, st.integers(1, 30), st.integers(1, 9), st.sampled_from([0, 8, 16]))
def test_eight_pixels_at_once_are_as_one_by_one(seed: int, rows: int, words: int, margin: int) -> None:
    inside = blots(seed, (rows + 2 * margin, 8 * words + 2 * margin))
    assert view_as_words(inside).size == inside.size // 8
    labels, count = label_components(inside, margin)
    core = np.ascontiguousarray(inside[margin : margin + rows, margin : margin + 8 * words])
    expected, number = ndimage.label(core)
    assert count == number and np.array_equal(labels, expected)


@settings(max_examples=60)
@given(seeds, shapes)
def test_components_of_equal_value_are_those_of_scikit_image(seed: int, shape: tuple[int, int]) -> None:
    image = (blots(seed, shape) + 2 * blots(seed + 1, shape) * blots(seed + 2, shape)).astype(np.uint32)
    labels, count = label_equal_values(image)
    expected, number = measure.label(image, connectivity=1, background=0, return_num=True)
    assert count == number
    assert np.array_equal(labels, in_raster_order(expected))


def in_raster_order(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same components, numbered by their first pixels."""
    names, firsts = np.unique(labels, return_index=True)
    number = np.zeros(labels.max() + 1, np.int64)
    named = names > 0
    number[names[named][np.argsort(firsts[named])]] = np.arange(1, named.sum() + 1)
    return number[labels]


@pytest.mark.parametrize(
    "drawing",
    [
        "1.2.3 1.2.3 1.2.3",
        "1.2 .3.",  # corners do not connect
        "1.1.1 11111",
        "..1 1.1 111",  # a J
        "11111 1...1 1.2.1 1...1 11111",
        "1111. ...1. 2.11. 2.1.. 2.111",
        "1.2.2 1.222 11.2. .1.2.",
    ],
)
def test_components_are_as_drawn(drawing: str) -> None:
    expected = picture(drawing)
    labels, count = label_components((expected > 0).astype(np.uint8))
    assert np.array_equal(labels, expected) and count == expected.max()


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (3, 3), (5, 8), (64, 64), (65, 63)])
def test_a_checkerboard_has_as_many_components_as_there_can_be(shape: tuple[int, int]) -> None:
    board = (np.indices(shape).sum(axis=0) % 2 == 0).astype(np.uint8)
    labels, count = label_components(board)
    assert count == board.sum() == labels.max()


@pytest.mark.slow
@settings(max_examples=100)
@given(
    st.integers(1, 40).flatmap(
        lambda n: st.tuples(st.just(n), st.lists(st.tuples(*[st.integers(0, n - 1)] * 2)))
    )
)
def test_unions_are_the_components_of_the_graph(graph: tuple[int, list[tuple[int, int]]]) -> None:
    count, pairs = graph
    links = np.array(pairs, np.int64).reshape(-1, 2)
    matrix = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    _, group = connected_components(matrix, directed=False)
    smallest = [int(np.flatnonzero(group == group[item])[0]) for item in range(count)]
    assert union_roots(links, count).tolist() == smallest


def test_a_long_chain_is_one_union_in_whatever_order_it_comes() -> None:
    links = np.stack([np.arange(5000), np.arange(1, 5001)], axis=1)
    for order in (slice(None), slice(None, None, -1)):
        assert not union_roots(links[order], 5001).any()
    assert not union_roots(np.random.default_rng(0).permutation(links), 5001).any()
