"""Tests of the contrast of components across their borders."""

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, strategies as st

from uavseg.segmentation.components import border_steps, label_equal_values


def plain_steps(image, labels, margin, grey, valid, large):
    """Edge by edge."""
    found = defaultdict(lambda: [0, 0, 0])
    for r, c in zip(*np.nonzero(labels), strict=True):
        row, col = r + margin, c + margin
        for there in ((row - 1, col), (row + 1, col), (row, col - 1), (row, col + 1)):
            if not (0 <= there[0] < image.shape[0] and 0 <= there[1] < image.shape[1]):
                continue
            if image[there] != image[row, col] and valid[there]:
                found[int(labels[r, c])][0] += abs(int(grey[row, col]) - int(grey[there]))
                found[int(labels[r, c])][1] += 1
                found[int(labels[r, c])][2] += abs(int(grey[row, col]) - int(grey[there])) > large
    return [found[k] for k in range(1, labels.max(initial=0) + 1)]


@st.composite
def pictures(draw):
    margin = draw(st.sampled_from([0, 1, 2, 8]))
    rows, cols = draw(st.integers(1, 12)), draw(st.sampled_from([3, 8, 16, 24]))
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    shape = rows + 2 * margin, cols + 2 * margin
    image = np.repeat(rng.integers(0, draw(st.integers(2, 4)), shape), draw(st.sampled_from([1, 8])), 1)
    image = np.ascontiguousarray(image[:, : shape[1]]).astype(draw(st.sampled_from([np.uint8, np.uint32])))
    grey = rng.integers(0, 65536, shape).astype(np.uint16)
    valid = (rng.random(shape) < 0.9).astype(np.uint8)
    return np.where(valid, image, 0).astype(image.dtype), grey, valid, margin


@given(pictures(), st.integers(0, 65535))
def test_steps_are_those_of_all_edges(drawn, large):
    image, grey, valid, margin = drawn
    labels, count = label_equal_values(image, margin)
    found = border_steps(image, labels, count, grey, valid, large)
    assert found.tolist() == plain_steps(image, labels, margin, grey, valid, large)


def test_large_differences_do_not_wrap():
    image = np.zeros((3, 3), np.uint8)
    image[1, 1] = 1
    grey = np.where(image, 0, 65535).astype(np.uint16)
    found = border_steps(image, image.astype(np.uint32), 1, grey, np.ones_like(image), 65534)
    assert found.tolist() == [[4 * 65535, 4, 4]]


@pytest.mark.parametrize("kind", [np.uint8, np.uint32])
def test_nothing_has_no_steps(kind):
    image = np.zeros((8, 8), kind)
    assert border_steps(
        image, image.astype(np.uint32), 0, image.astype(np.uint16), image.astype(np.uint8), 9
    ).shape == (0, 3)
