"""Perimeters: within the tolerance, without the stairs of pixels."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st
from shapely.affinity import rotate, scale

from uavseg.flight.patterns.perimeter import default_tolerance_m, perimeter

PIXELS = np.hypot(*np.indices((40, 40)) - 19.5) < 17
DISC = shapely.union_all([shapely.box(x, y, x + 1, y + 1) for y, x in np.argwhere(PIXELS).tolist()])
TEETH = [shapely.box(x, 0, x + 30, 150) for x in range(0, 260, 57)]
COMB = shapely.union_all([shapely.box(0, 0, 260, 40), *TEETH])


@given(st.floats(0.1, 10), st.floats(0, 360), st.floats(0.2, 5))
@settings(max_examples=40)
def test_no_point_of_the_ring_moves_farther_than_the_tolerance(
    tolerance_m: float, turn_deg: float, pixel_m: float
) -> None:
    region = rotate(scale(DISC, pixel_m, pixel_m), turn_deg)
    ring = perimeter(region, tolerance_m)
    assert np.array_equal(ring[0], ring[-1])
    moved_m = shapely.hausdorff_distance(shapely.LineString(ring), region.exterior, densify=0.05)
    assert moved_m <= tolerance_m + 1e-6


@pytest.mark.parametrize("turn_deg", [0, 3, 45])
def test_the_stairs_of_pixels_are_gone_by_default(turn_deg: float) -> None:
    region = rotate(scale(DISC, 4, 4), turn_deg)
    tolerance_m = default_tolerance_m(region)
    assert tolerance_m == pytest.approx(4)
    assert len(perimeter(region, tolerance_m)) < len(region.exterior.coords) / 4


def test_pixels_that_are_not_square_count_with_their_longer_side() -> None:
    assert default_tolerance_m(scale(DISC, 2, 3)) == pytest.approx(3)


@pytest.mark.parametrize(
    "region", [shapely.box(0, 0, 900, 400), COMB, scale(DISC, 0.5, 0.5), shapely.Point(0, 0).buffer(70)]
)
def test_other_outlines_are_kept_to_a_metre(region: shapely.Polygon) -> None:
    assert default_tolerance_m(region) == 1


def test_holes_are_not_flown_around() -> None:
    region = shapely.box(0, 0, 100, 100) - shapely.box(20, 20, 60, 60)
    assert len(perimeter(region, 1)) == 5
