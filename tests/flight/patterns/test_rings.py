"""Rings at a distance from an outline: the distance, the shortest leg, holes and what is too narrow."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from tests.flight.cover.cover_fields import fields
from uavseg.flight.params.plan import PerimeterParams
from uavseg.flight.patterns.perimeter import _hausdorff, _offset, long_legs, offset_rings

NOTCHED = [
    (28.47, 21.48),
    (-72.5, -58.1),
    (5.75, 22.2),
    (6.7, 22.65),
    (7.71, 23.25),
    (8.65, 23.95),
    (9.52, 24.74),
]
NOTCHED += [(10.31, 25.61), (11, 26.55), (11.61, 27.55), (12.11, 28.61), (12.17, 28.79), (35.64, 52.88)]


def legs(ring: np.ndarray) -> np.ndarray:
    return np.hypot(*np.diff(ring, axis=0).T)


@pytest.mark.slow
@given(fields(), st.floats(-15, 60), st.floats(0.2, 5), st.sampled_from(["skip", "fly"]))
@settings(max_examples=80)
def test_rings_lie_at_the_offset_within_the_tolerance(
    field: shapely.Polygon, offset: float, tolerance: float, holes: str
) -> None:
    found = offset_rings(field, PerimeterParams(offset, holes=holes), tolerance, 0.0)
    for ring in found.rings:
        assert np.array_equal(ring[0], ring[-1])
        dense = shapely.get_coordinates(shapely.segmentize(shapely.LineString(ring), 1.0))
        distance = shapely.distance(field.boundary, shapely.points(dense))
        assert np.abs(distance - abs(offset)).max() <= tolerance + 0.06
        inside = shapely.contains_xy(field, *dense.T)
        if abs(offset) > tolerance + 0.06:
            assert (inside == (offset < 0)).all()
    assert found.moved_m == 0 and (holes == "skip" or found.holes == 0)


@given(fields(), st.floats(1, 25))
@settings(max_examples=80)
def test_no_leg_is_shorter_or_it_is_reported(field: shapely.Polygon, min_leg: float) -> None:
    found = offset_rings(field, PerimeterParams(), 0.5, min_leg)
    [ring] = found.rings
    is_sliver = field.area < 0.5 * field.length  # thinner than the tolerance: flown there and back
    assert len(ring) >= (3 if is_sliver else 4) and np.array_equal(ring[0], ring[-1])
    assert found.has_short_legs == bool(legs(ring).min() < min_leg)
    assert not found.has_short_legs or len(ring) <= 4
    beside = shapely.hausdorff_distance(shapely.LineString(ring), field.exterior, densify=0.05)
    assert beside <= max(found.moved_m, 0.5) * 1.05 + 1e-6


def test_long_rings_keep_their_corners() -> None:
    ring = np.array([[0, 0], [100, 0], [100, 3], [103, 3], [103, 80], [0, 80], [0, 0.0]])
    kept = long_legs(ring, 10)
    assert legs(kept).min() >= 10 and len(kept) == 5
    assert np.array_equal(long_legs(ring, 3), ring)


def plain_long_legs(ring: np.ndarray, min_leg: float) -> np.ndarray:
    """Of the shortest leg, again and again, the end whose loss moves the ring less."""
    corners = ring[:-1].tolist()
    while len(corners) > 3:
        lengths = legs(np.array([*corners, corners[0]]))
        k = int(np.argmin(lengths))
        if lengths[k] >= min_leg:
            break
        ends = (k, (k + 1) % len(corners))
        moved = []
        for end in ends:
            line = shapely.LineString([corners[end - 1], corners[(end + 1) % len(corners)]])
            moved.append(shapely.distance(line, shapely.Point(corners[end])))
        corners.pop(ends[1] if moved[1] <= moved[0] else ends[0])
    return np.array([*corners, corners[0]])


@given(st.integers(3, 40), st.integers(0, 10**6), st.floats(0.5, 12))
def test_long_legs_are_those_of_the_plain_version(count: int, seed: int, min_leg: float) -> None:
    corners = np.random.default_rng(seed).integers(0, 20, (count, 2)).astype(float)  # many legs are equal
    ring = np.concatenate([corners, corners[:1]])
    assert np.array_equal(long_legs(ring, min_leg), plain_long_legs(ring, min_leg))


@given(fields(), st.floats(2, 25))
@settings(max_examples=30)
def test_how_far_rings_are_apart_is_what_geos_measures(field: shapely.Polygon, min_leg: float) -> None:
    exact = shapely.get_coordinates(field.exterior)
    kept = long_legs(exact, min_leg)
    found = max(_hausdorff(kept, exact), _hausdorff(exact, kept))
    expected = shapely.hausdorff_distance(shapely.LineString(kept), field.exterior, densify=0.02)
    assert found == pytest.approx(expected, rel=0.05, abs=1e-9)


def test_holes_are_counted_or_flown() -> None:
    field = shapely.box(0, 0, 200, 100) - shapely.box(20, 20, 60, 60) - shapely.box(100, 20, 140, 60)
    skipped, flown = (offset_rings(field, PerimeterParams(holes=one), 1, 5) for one in ("skip", "fly"))
    assert (len(skipped.rings), skipped.holes) == (1, 2)
    assert (len(flown.rings), flown.holes) == (3, 0)


@pytest.mark.parametrize(("offset", "rings"), [(-6, 0), (-4, 1), (0, 1), (6, 1)])
def test_what_is_too_narrow_has_no_ring(offset: float, rings: int) -> None:
    assert len(offset_rings(shapely.box(0, 0, 90, 10), PerimeterParams(offset), 0.1, 0).rings) == rings


def test_tiny_holes_that_geos_leaves_in_a_buffer_are_no_rings() -> None:
    field = shapely.Polygon(NOTCHED)
    assert len(_offset(field, 21.7).interiors) == 1
    found = offset_rings(field, PerimeterParams(21.7, holes="fly"), 1, 0)
    assert (len(found.rings), found.holes) == (1, 0)


def test_an_offset_may_divide_a_region() -> None:
    dumb_bell = shapely.union_all(
        [shapely.box(0, 0, 50, 50), shapely.box(50, 22, 90, 28), shapely.box(90, 0, 140, 50)]
    )
    assert len(offset_rings(dumb_bell, PerimeterParams(-5), 0.1, 0).rings) == 2
