"""Ground areas and lengths, against geodesics and by laws."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pyproj
import pytest
from affine import Affine
from hypothesis import given, settings as checked, strategies as st
from rasterio.crs import CRS

from uavseg.raster.grid import ground
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import (
    ground_resolution,
    ground_steps,
    line_length,
    ring_areas,
    ring_perimeters,
)

ANGLE = np.array([[0, 0], [0, 10], [4, 10], [4, 5], [10, 5], [10, 0]])  # an L, clockwise on the picture
turned = Affine.translation(4e5, 5e6) * Affine.rotation(30) * Affine.scale(100, -100)

ROTATED = "+proj=ob_tran +o_proj=longlat +o_lat_p=39.25 +o_lon_p=0 +lon_0=18 +ellps=WGS84"
PLACES = {
    "utm": (32618, Affine(20, 0, 4e5, 0, -20, 5e6)),
    "utm far from its meridian": (32618, Affine(100, 0, 9e5, 0, -100, 7e6)),
    "utm south-up": (32618, Affine(20, 0, 4e5, 0, 20, 5e6)),
    "utm rotated": (32618, turned),
    "lambert": (2154, Affine(20, 0, 7e5, 0, -20, 6.6e6)),
    "equal area": (3035, Affine(50, 0, 4e6, 0, -50, 3.2e6)),
    "over the south pole": (3031, Affine(1000, 0, -6e5, 0, -1000, 4e5)),
    "arctic": (3413, Affine(100, 0, -6e4, 0, -100, -9e5)),
    "feet": (2263, Affine(30, 0, 9e5, 0, -30, 2e5)),
    "web mercator at 60 north": (3857, Affine(10, 0, 1e6, 0, -10, 8.4e6)),
    "degrees at 50 north": (4326, Affine(1e-4, 0, 10, 0, -1e-4, 50)),
    "degrees at the equator, south-up": (4326, Affine(1e-4, 0, 10, 0, 1e-4, -0.05)),
    "degrees at 80 south": (4326, Affine(1e-4, 0, -170, 0, -1e-4, -80)),
    "degrees rotated": (4326, Affine.translation(10, 50) * Affine.rotation(30) * Affine.scale(1e-4, -1e-4)),
    "grads of Paris": (4807, Affine(1e-4, 0, 1, 0, -1e-4, 50)),
    "a rotated pole": (ROTATED, Affine(1e-3, 0, -1, 0, -1e-3, 1.5)),
    "a rotated pole, turned": (ROTATED, Affine.rotation(30) * Affine.scale(1e-3, -1e-3)),
}


def box_of(crs, transform, shape=(1000, 1000)):
    return GeoBox(shape, transform, CRS.from_user_input(crs))


def measured(box, *rings):
    starts = np.cumsum([0] + [len(ring) for ring in rings])
    vertices = np.concatenate(rings)
    return ring_areas(box, vertices, starts), ring_perimeters(box, vertices, starts)


def geodesic(box, ring, steps=500):
    """Area and perimeter of a ring whose edges follow the map, by geodesics between many points."""
    after = np.roll(ring, -1, axis=0)
    along = np.arange(steps)[None, :, None] / steps
    row, col = (ring[:, None] + (after - ring)[:, None] * along).reshape(-1, 2).T
    crs = pyproj.CRS.from_wkt(box.wkt)
    angles = crs.source_crs if crs.geodetic_crs.is_derived else crs.geodetic_crs
    to_angles = pyproj.Transformer.from_crs(crs, angles, always_xy=True)
    unit = np.degrees(angles.axis_info[0].unit_conversion_factor)
    lon, lat = to_angles.transform(*box.xy_from_pixel(row, col))
    area, perimeter = crs.get_geod().polygon_area_perimeter(lon * unit, lat * unit)
    return abs(area), perimeter


@pytest.mark.parametrize("place", PLACES)
def test_areas_and_perimeters_are_geodesic(place):
    box, ring = box_of(*PLACES[place]), ANGLE * 100
    (area,), (perimeter,) = measured(box, ring)
    assert (area, perimeter) == pytest.approx(geodesic(box, ring), rel=2e-8)


@pytest.mark.parametrize("crs, transform", [PLACES["utm"], PLACES["degrees at 50 north"]])
def test_a_pixel_anywhere_is_as_exact_as_the_whole(crs, transform):
    box = box_of(crs, transform, (60_000, 60_000))
    pixel = np.array([[0, 0], [0, 1], [1, 1], [1, 0]]) + np.array([59_000, 41_000])
    (area,), _ = measured(box, pixel)
    (alone,), _ = measured(
        GeoBox((1, 1), transform * Affine.translation(41_000, 59_000), box.crs), pixel - pixel[0]
    )
    assert area == pytest.approx(alone, rel=1e-9)


def test_metres_of_web_mercator_are_not_ground_metres():
    box = box_of(*PLACES["web mercator at 60 north"])
    (area,), _ = measured(box, ANGLE)
    assert 70 * 100 / area == pytest.approx(4, rel=0.01)


def test_feet_are_not_metres():
    (area,), (perimeter,) = measured(box_of(*PLACES["feet"]), ANGLE)
    assert area == pytest.approx(70 * (30 * 0.3048) ** 2, rel=1e-3)
    assert perimeter == pytest.approx(40 * 30 * 0.3048, rel=1e-3)


def test_the_whole_globe_has_the_area_of_its_ellipsoid():
    box = box_of(4326, Affine(0.5, 0, -180, 0, -0.5, 90), (360, 720))
    (area,), _ = measured(box, np.array([[0, 0], [0, 720], [360, 720], [360, 0]]))
    assert area == pytest.approx(510_065_621_724_088, rel=1e-12)


def test_there_is_no_ground_beyond_a_pole():
    beyond = box_of(4326, Affine(1, 0, 0, 0, -1, 90.5), (181, 360))
    (cap, half), _ = measured(
        beyond, *(np.array([[0, 0], [0, 4], [rows, 4], [rows, 0]]) for rows in (1, 181))
    )
    (expected,), _ = measured(
        box_of(4326, Affine(4, 0, 0, 0, -0.5, 90), (1, 1)), np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    )
    assert cap == pytest.approx(expected, rel=1e-12)
    assert half == pytest.approx(510_065_621_724_088 / 90, rel=1e-12)


@pytest.mark.slow
def test_a_raster_larger_than_its_projection_is_measured_where_there_is_ground():
    box = GeoBox((1000, 1000), Affine(36_000, 0, -18e6, 0, -18_000, 9e6), CRS.from_string("ESRI:54009"))
    ring = np.array([[400, 400], [400, 600], [600, 600], [600, 400]])
    (area,), (perimeter,) = measured(box, ring)
    expected = geodesic(box, ring, 5000)
    assert area == pytest.approx(expected[0], rel=1e-4)
    assert perimeter == pytest.approx(expected[1], rel=1e-2)


@pytest.mark.parametrize("crs", [None, CRS.from_wkt('LOCAL_CS["site",UNIT["metre",1]]')])
def test_without_an_ellipsoid_the_plane_is_measured(crs):
    box = GeoBox((20, 20), Affine.rotation(20) * Affine.scale(2, -3), crs)
    (area,), (perimeter,) = measured(box, ANGLE)
    assert area == pytest.approx(70 * 6)
    assert perimeter == pytest.approx(20 * 2 + 20 * 3)
    assert ground_resolution(box) == pytest.approx((2, 3))


@pytest.mark.parametrize("place", PLACES)
def test_a_hole_has_the_negative_area_of_the_region_that_fills_it(place):
    box = box_of(*PLACES[place])
    areas, perimeters = measured(box, ANGLE, ANGLE[::-1])
    assert areas[0] > 0
    assert areas[1] == pytest.approx(-areas[0], rel=1e-12)
    assert perimeters[1] == pytest.approx(perimeters[0], rel=1e-12)


@pytest.mark.parametrize("place", PLACES)
def test_resolution_is_the_length_of_a_pixel_at_the_centre(place):
    box = box_of(*PLACES[place], shape=(21, 41))
    _, perimeters = measured(
        box,
        *(np.array([[10, 20], [10, 20 + c], [10 + r, 20 + c], [10 + r, 20]]) for r, c in ((1, 1), (1, 2))),
    )
    across = (perimeters[1] - perimeters[0]) / 2
    assert ground_resolution(box) == pytest.approx((across, perimeters[0] / 2 - across), rel=1e-3)


@given(
    st.sampled_from(sorted(PLACES)),
    st.lists(st.integers(1, 999), max_size=4, unique=True),
    st.lists(st.integers(1, 999), max_size=4, unique=True),
)
@checked(max_examples=30)
def test_parts_sum_to_the_whole(place, rows, cols):
    box = box_of(*PLACES[place])
    rows, cols = [0, *sorted(rows), 1000], [0, *sorted(cols), 1000]
    parts = [
        np.array([[top, left], [top, right], [bottom, right], [bottom, left]])
        for top, bottom in pairwise(rows)
        for left, right in pairwise(cols)
    ]
    areas, _ = measured(box, *parts)
    (whole,), _ = measured(box, np.array([[0, 0], [0, 1000], [1000, 1000], [1000, 0]]))
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(whole, rel=1e-11)


def test_many_rings_are_measured_in_chunks_with_the_same_result(monkeypatch):
    box = box_of(*PLACES["utm"])
    rings = [ANGLE + np.array([7 * i, 3 * i]) for i in range(50)]
    whole = measured(box, *rings)
    monkeypatch.setattr(ground, "_CHUNK", 20)
    np.testing.assert_array_equal(measured(box, *rings), whole)


def test_an_empty_set_of_rings_is_measured():
    areas, perimeters = (
        f(box_of(*PLACES["utm"]), np.zeros((0, 2), np.int32), np.zeros(1, np.int64))
        for f in (ring_areas, ring_perimeters)
    )
    assert len(areas) == len(perimeters) == 0


def test_south_up_covers_the_same_ground():
    up = box_of(32618, Affine(20, 0, 4e5, 0, -20, 5e6))
    down = replace(up, transform=Affine(20, 0, 4e5, 0, 20, 5e6 - 20_000))
    flipped = (ANGLE * [-1, 1] + [1000, 0])[::-1]
    assert measured(down, flipped)[0] == pytest.approx(measured(up, ANGLE)[0], rel=1e-11)


@pytest.mark.parametrize("place", PLACES)
def test_a_line_is_as_long_as_the_geodesics_between_its_pixels(place: str) -> None:
    crs, transform = PLACES[place]
    box = GeoBox((100, 100), transform, CRS.from_user_input(crs))
    rows, cols = np.array([3.5, 60.5, 60.5, 11.0]), np.array([2.5, 90.5, 4.5, 4.5])
    dense = np.linspace(0, 3, 301)
    lon, lat = box.lonlat_from_xy(
        *box.xy_from_pixel(np.interp(dense, range(4), rows), np.interp(dense, range(4), cols))
    )
    expected = pyproj.Geod(ellps="WGS84").line_length(lon, lat)
    assert line_length(box, rows, cols) == pytest.approx(
        expected, rel=1e-4
    )  # older ellipsoids differ so much


def test_steps_at_the_centre_are_the_resolution_and_a_point_has_no_length() -> None:
    box = GeoBox((100, 60), PLACES["utm"][1], CRS.from_epsg(32618))
    assert ground_steps(box, 50, 30) == ground_resolution(box)
    assert line_length(box, np.array([4.5]), np.array([7.5])) == 0
    assert line_length(box, np.array([4.5, 4.5]), np.array([7.5, 8.5])) == pytest.approx(
        ground_steps(box, 4.5, 8)[0], rel=1e-6
    )
