"""Lazy polygons: those built a few at a time are those made all at once."""

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from uavseg.regions.outline.trace import trace
from uavseg.regions.shapes import LazyPolygons, batch_slices, has_multipolygons, total_area

TRANSFORMS = [Affine(2, 0, 100, 0, -2, 900), Affine(2, 0, 0, 0, 2, 0), Affine(1, 0.5, 3, -0.5, 1, 4)]


def labelled(seed: int) -> NDArray[np.uint32]:
    return (
        np.unique(np.random.default_rng(seed).integers(0, 6, (9, 11)), return_inverse=True)[1]
        .reshape(9, 11)
        .astype(np.uint32)
    )


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from(TRANSFORMS), st.integers(0, 7), st.integers(0, 7))
def test_a_slice_equals_the_slice_of_all(seed: int, transform: Affine, first: int, last: int) -> None:
    shapes = LazyPolygons(trace(labelled(seed)), transform)
    together = np.asarray(shapes)
    assert len(together) == len(shapes)
    assert shapely.equals_identical(shapes[first:last], together[first:last]).all()
    assert shapes[-1] is not None and shapely.equals_identical(shapes[-1], together[-1])
    assert shapely.equals_identical(np.array(list(shapes)), together).all()
    assert shapes.vertex_counts().tolist() == shapely.get_num_coordinates(together).tolist()
    assert total_area(shapes) == pytest.approx(total_area(together))
    assert has_multipolygons(shapes) == has_multipolygons(together)


@given(arrays.arrays(np.uint32, (8, 8), elements=st.integers(0, 3)), st.integers(1, 60))
def test_batches_are_all_regions_in_order(image: NDArray[np.uint32], vertices: int) -> None:
    names = np.unique(image, return_inverse=True)[1].reshape(8, 8)
    shapes = LazyPolygons(trace((names + (image.min() > 0)).astype(np.uint32)), TRANSFORMS[0])
    slices = list(batch_slices(shapes, vertices))
    assert [k for part in slices for k in range(part.start, part.stop)] == list(range(len(shapes)))
    assert slices == list(batch_slices(np.asarray(shapes), vertices))
    counts = shapes.vertex_counts()
    for part in slices:
        assert counts[part].sum() <= vertices or part.stop == part.start + 1


def test_no_rings_give_no_polygons() -> None:
    shapes = LazyPolygons(trace(np.zeros((3, 3), np.uint32)), TRANSFORMS[0])
    assert len(shapes) == len(np.asarray(shapes)) == len(list(batch_slices(shapes))) == 0
    assert total_area(shapes) == 0 and not has_multipolygons(shapes)
