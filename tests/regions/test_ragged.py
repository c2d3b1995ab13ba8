"""Ragged arrays of polygons, and back to geometries."""

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from uavseg.regions.shapes import RaggedPolygons

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
