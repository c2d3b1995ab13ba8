"""Legs between the pieces of a survey: their lengths outside of the region."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate

from tests.flight.survey_regions import HOLES, RING, U
from uavseg.flight.legs import leaving_hull, outside_m


@given(
    st.lists(st.tuples(*[st.integers(-120_000, 320_000)] * 4), min_size=1, max_size=8),
    st.sampled_from([U, RING, HOLES]),
)
@settings(max_examples=40, deadline=None)
def test_metres_outside_agree_with_geos(
    ends: list[tuple[int, int, int, int]], region: shapely.Polygon
) -> None:
    legs = np.array(ends).reshape(-1, 2, 2) / 1000  # GEOS loses lines whose ends are 1e-222 m from a corner
    lines = shapely.linestrings(legs)
    ours = outside_m(region, legs)
    assert (ours <= shapely.length(shapely.difference(lines, region)) + 1e-6).all()
    assert (ours >= shapely.length(shapely.difference(lines, region.buffer(0.02))) - 1e-6).all()


def test_a_leg_along_an_edge_is_not_outside() -> None:
    turned = rotate(U, 33.3, origin=(0, 0))
    edges = shapely.get_coordinates(turned.exterior)
    assert outside_m(turned, np.stack((edges[:-1], edges[1:]), axis=1)).sum() == 0


def test_a_leg_out_of_the_hull_is_found() -> None:
    legs = np.array([[[0.0, 0], [200, 200]], [[0, 0], [-20, 0]]])
    assert np.array_equal(leaving_hull(U, legs, 15), legs[1:])
