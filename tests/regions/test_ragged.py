"""Ragged arrays of polygons, and back to geometries."""

import numpy as np
import shapely
from hypothesis import given, strategies as st

from uavseg.regions.shapes import RaggedPolygons, as_multipolygons

HOLED = shapely.Polygon(
    shapely.box(0, 0, 9, 9).exterior, [shapely.box(1, 1, 2, 2).exterior, shapely.box(4, 4, 6, 6).exterior]
)
KINDS = [
    shapely.box(0, 0, 1, 2),
    HOLED,
    shapely.MultiPolygon([HOLED, shapely.box(20, 0, 21, 1), shapely.box(30, 0, 31, 1)]),
]
geometries = st.lists(st.sampled_from(KINDS), max_size=6).map(
    lambda some: np.array([*some, None], object)[:-1]
)


@given(geometries)
def test_geometries_survive_flattening(some):
    assert shapely.equals_exact(RaggedPolygons.from_geometries(some).to_geometries(), some).all()


@given(geometries, st.data())
def test_dropping_regions_keeps_the_others(some, data):
    dropped = np.array(data.draw(st.lists(st.booleans(), min_size=len(some), max_size=len(some))), bool)
    left = RaggedPolygons.from_geometries(some).without(dropped).to_geometries()
    assert shapely.is_empty(left[dropped]).all()
    assert shapely.equals_exact(left[~dropped], some[~dropped]).all()


@given(geometries)
def test_every_vertex_belongs_to_its_region(some):
    flat = RaggedPolygons.from_geometries(some)
    expected = np.repeat(np.arange(len(some)), shapely.get_num_coordinates(some))
    assert flat.region_of(np.arange(len(flat.vertices))).tolist() == expected.tolist()


@given(geometries, st.integers(0, 20))
def test_binary_is_that_of_shapely_after_its_header(some, size):
    headers = np.random.default_rng(size).integers(0, 256, (len(some), size)).astype(np.uint8)
    flat = RaggedPolygons.from_geometries(some)
    of_several = [bytes(one) for one in flat.to_wkb(headers, True)]
    multiple = shapely.to_wkb(as_multipolygons(some)) if len(some) else []
    assert of_several == [head.tobytes() + one for head, one in zip(headers, multiple, strict=True)]
    some = np.array([*some, shapely.Polygon()], object)
    flat, headers = RaggedPolygons.from_geometries(some), np.zeros((len(some), size), np.uint8)
    if all(one.geom_type == "Polygon" for one in some):
        singles = [bytes(one) for one in flat.to_wkb(headers, False)]
        assert singles == [head.tobytes() + one.wkb for head, one in zip(headers, some, strict=True)]


@given(geometries, st.data())
def test_bounds_are_those_of_shapely(some, data):
    dropped = np.array(data.draw(st.lists(st.booleans(), min_size=len(some), max_size=len(some))), bool)
    flat = RaggedPolygons.from_geometries(some).without(dropped)
    expected = shapely.bounds(flat.to_geometries()).reshape(-1, 4)
    assert np.array_equal(flat.bounds(), expected, equal_nan=True)
