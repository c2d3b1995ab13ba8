"""Polygons around the antimeridian and the poles, small enough to see."""

import numpy as np
import pytest
import shapely

from uavseg.errors import OutputError
from uavseg.regions.wgs84.to_wgs84 import cut_at_antimeridian


def box(west, south, east, north):
    """A closed ring, counter-clockwise, with longitudes as they come from a projection."""
    ring = np.array([[west, south], [east, south], [east, north], [west, north], [west, south]], float)
    ring[:, 0] = np.remainder(ring[:, 0] + 180, 360) - 180
    return ring


def parts(*boxes):
    return shapely.union_all([shapely.box(*each) for each in boxes])


def around(lat):
    """A closed ring around a pole, eastwards."""
    return np.array([[lon, lat] for lon in (-180, -90, 0, 90, -180)], float)


def test_a_polygon_that_does_not_cross_stays():
    assert cut_at_antimeridian([box(10, 0, 20, 5)], jumping=True).equals(shapely.box(10, 0, 20, 5))


def test_a_polygon_that_crosses_is_cut_in_two():
    assert cut_at_antimeridian([box(170, 0, 195, 5)], jumping=True).equals(
        parts((170, 0, 180, 5), (-180, 0, -165, 5))
    )


def test_a_hole_that_crosses_is_cut_too():
    folded = cut_at_antimeridian([box(170, 0, 190, 9), box(175, 3, 185, 6)[::-1]], jumping=True)
    whole = parts((170, 0, 180, 9), (-180, 0, -170, 9))
    assert folded.equals(shapely.difference(whole, parts((175, 3, 180, 6), (-180, 3, -175, 6))))
    assert shapely.get_num_geometries(folded) == 2


def test_longitudes_may_continue_past_180():
    ring = np.array([[170, 0], [530, 0], [530, 5], [170, 5], [170, 0]], float)
    assert cut_at_antimeridian([ring], jumping=False).equals(shapely.box(-180, 0, 180, 5))


def test_a_ring_eastwards_holds_the_north_pole_and_westwards_the_south_pole():
    assert cut_at_antimeridian([around(80)], jumping=True).equals(shapely.box(-180, 80, 180, 90))
    assert cut_at_antimeridian([around(-80)[::-1]], jumping=True).equals(shapely.box(-180, -90, 180, -80))


def test_a_hole_around_the_pole_leaves_a_ring():
    assert cut_at_antimeridian([around(70), around(80)[::-1]], jumping=True).equals(
        shapely.box(-180, 70, 180, 80)
    )


def test_a_ring_that_meanders_around_the_pole_keeps_its_shape():
    there_and_back = np.array(
        [[-170, 70], [-60, 75], [-90, 80], [0, 70], [120, 72], [90, 85], [170, 75]], float
    )
    folded = cut_at_antimeridian([np.concatenate([there_and_back, there_and_back[:1]])], jumping=True)
    assert folded.is_valid
    assert shapely.contains_xy(folded, [0, -179, 179, -75, 100, 100], [89, 89, 89, 74, 74, 86]).tolist() == [
        True,
        True,
        True,
        False,
        True,
        True,
    ]


def test_a_corner_at_the_pole_has_every_longitude_between_its_sides():
    quarter = np.array([[0, 80], [45, 80], [90, 80], [-123, 90], [0, 80]], float)
    assert cut_at_antimeridian([quarter], jumping=True).equals(shapely.box(0, 80, 90, 90))
    begins_there = np.roll(quarter[:-1], 1, axis=0)
    assert cut_at_antimeridian([np.concatenate([begins_there, begins_there[:1]])], jumping=True).equals(
        shapely.box(0, 80, 90, 90)
    )


def test_three_quarters_around_the_pole_leave_one_out():
    ring = np.array([[90, 80], [180, 80], [-90, 80], [0, 80], [33, 90], [90, 80]], float)
    assert cut_at_antimeridian([ring], jumping=True).equals(parts((90, 80, 180, 90), (-180, 80, 0, 90)))


def test_nothing_reaches_beyond_a_pole():
    ring = np.array([[0, 85], [10, 85], [10, 95], [0, 95], [0, 85]], float)
    assert cut_at_antimeridian([ring], jumping=False).equals(shapely.box(0, 85, 10, 90))


def test_a_polygon_of_many_turns_is_refused():
    ring = np.array([[0, 0], [1e11, 0], [1e11, 10], [0, 10], [0, 0]])
    with pytest.raises(OutputError, match=r"a region is 1e\+11 degrees wide; the georeference .* is damaged"):
        cut_at_antimeridian([ring], jumping=False)
