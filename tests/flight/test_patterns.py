"""Flight patterns and their notes for the pilot."""

import numpy as np
import shapely

from tests.flight.small_regions import box, degrees, inside, planned, waypoints


def test_a_visit_goes_to_the_point_of_every_region_once() -> None:
    polygons = [box(x, y, 30, 30) for x, y in [(0, 900), (50, 0), (0, 300), (50, 600)]]
    found = np.array(sorted(waypoints(planned(polygons))))
    assert np.allclose(found, sorted(inside(polygons)), rtol=0, atol=1e-8)


def test_a_perimeter_is_the_outline_and_closed() -> None:
    polygons = [box(100, 100, 80, 60)]
    found = waypoints(planned(polygons, pattern="perimeter"))
    assert len(found) == 5 and found[0] == found[-1]
    assert shapely.Polygon(found).symmetric_difference(polygons[0]).area < 1e-3 * polygons[0].area
    assert "1 m" in planned(polygons, pattern="perimeter").warnings[0]


def test_legs_outside_of_a_region_and_uncovered_area_give_warnings() -> None:
    around = shapely.box(0, 0, 300, 200) - shapely.box(100, 50, 200, 150)
    said = planned([degrees(around)], pattern="survey", spacing_m=30, angle_deg=45).warnings
    assert any("outside of their regions" in warning for warning in said)
    arm = shapely.box(0, 0, 100, 120) | shapely.box(100, 55, 250, 65)  # between the lines, and no line in it
    said = planned([degrees(arm)], pattern="survey", spacing_m=60, angle_deg=90).warnings
    assert any("farther than half a spacing" in warning for warning in said)
    plain = planned([box(0, 0, 100, 100)], pattern="survey", spacing_m=20)
    assert plain.warnings == ()
