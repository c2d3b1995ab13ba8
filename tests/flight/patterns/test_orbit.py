"""Orbits: never nearer to the centre than the radius, the region inside, photographs that overlap."""

import math

import numpy as np
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from uavseg.flight.camera.camera import Camera, Overlap, Photos
from uavseg.flight.patterns.candidates import (
    LARGEST_STEP_DEG,
    LATERAL_M_S2,
    MAX_SAGITTA_M,
    orbit,
    orbit_trigger_m,
)

CAMERA = Camera("wide", (13.2, 8.8), (5472, 3648), 8.8, 0.5)


@given(fields(), st.floats(0, 200), st.floats(1, 20))
@settings(max_examples=60)
def test_the_path_keeps_its_distance(field: shapely.Polygon, margin: float, speed: float) -> None:
    found = orbit(field, margin, speed)
    dense = shapely.get_coordinates(shapely.segmentize(shapely.LineString(found.ring), 1.0))
    distance = np.hypot(*(dense - found.centre).T)
    assert distance.min() >= found.radius_m - 1e-6
    assert distance.max() <= found.radius_m + min(0.02 * found.radius_m, MAX_SAGITTA_M) + 1e-6
    assert np.array_equal(found.ring[0], found.ring[-1])
    assert found.radius_m >= speed**2 / LATERAL_M_S2 - 1e-9
    assert shapely.distance(shapely.LineString(found.ring), field) >= margin - 1e-6
    assert shapely.covers(shapely.Polygon(found.ring), field)


def test_the_circle_is_the_smallest_around_the_region() -> None:
    field = shapely.Point(30, 40).buffer(50, quad_segs=64)
    found = orbit(field, 25, 5)
    assert np.allclose(found.centre, (30, 40), atol=0.1) and abs(found.radius_m - 75) < 0.1


@given(fields(), st.floats(0, 100), st.floats(10, 120), st.floats(0, 95))
@settings(max_examples=60)
def test_photographs_overlap_where_the_region_is_nearest(
    field: shapely.Polygon, margin: float, height: float, front: float
) -> None:
    photos, found = Photos(CAMERA, Overlap(front, 70)), orbit(field, margin, 5)
    trigger = orbit_trigger_m(photos, found, field, height)
    slant = math.hypot(shapely.distance(shapely.LineString(found.ring), field), height)
    assert 0 < trigger <= slant * 1.5 * (1 - front / 100) + 1e-6
    assert trigger / found.radius_m <= math.radians(LARGEST_STEP_DEG) + 1e-9
