"""Polygons in WGS 84: cut at the antimeridian and rounded, with their areas preserved."""

from dataclasses import replace

import numpy as np
import pyproj
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

from uavseg.errors import OutputError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.outline.trace import trace
from uavseg.regions.table import Regions, make_regions
from uavseg.regions.wgs84 import to_wgs84
from uavseg.segmentation.components import Sums

FIRSTS = np.empty((0, 2), np.int64)  # no measure depends on first pixels
ROTATED = "+proj=ob_tran +o_proj=longlat +o_lat_p={} +o_lon_p=0 +lon_0={} +ellps=WGS84"
PLACES = {
    "the south pole on a corner": (3031, Affine(50_000, 0, -300_000, 0, -50_000, 300_000)),
    "the south pole in a pixel": (3031, Affine(50_000, 0, -330_000, 0, -50_000, 310_000)),
    "the north pole": (3413, Affine(5000, 0, -33_000, 0, -5000, 31_000)),
    "the antimeridian in UTM": (32701, Affine(5000, 0, 150_000, 0, -5000, 8e6)),
    "the antimeridian in Mercator": (3832, Affine(10_000, 0, 3_279_584, 0, -10_000, 2e6)),
    "degrees past 180": (4326, Affine(1, 0, 174, 0, -1, 12)),
    "degrees from 0 to 360": (4326, Affine(30, 0, 0, 0, -15, 90)),
    "a globe that begins before -180": (4326, Affine(30, 0, -195, 0, -15, 90)),
    "pixels half beyond the poles": (4326, Affine(30, 0, -180, 0, -16, 96)),
    "degrees up to 180": (4326, Affine(1, 0, 168, 0, -1, 12)),
    "an older datum past 180": (4267, Affine(1, 0, 174, 0, -1, 60)),
    "grads of Paris": (4807, Affine(0.1, 0, 1, 0, -0.1, 50)),
    "a sphere, half beyond the poles": ("+proj=longlat +R=6371229", Affine(30, 0, -15, 0, -16, 96)),
    "south-up": (32660, Affine(5000, 0, 650_000, 0, 5000, 4e6)),
    "south for x and west for y": (5513, Affine(500, 0, 1_080_000, 0, -500, 706_000)),
    "a rotated pole": (ROTATED.format(39.25, 18), Affine(0.1, 0, -0.6, 0, -0.1, 0.6)),
    "the antimeridian and a rotated pole": (ROTATED.format(39.25, 180), Affine(0.1, 0, -0.6, 0, -0.1, 0.6)),
    "the north pole and a rotated pole": (ROTATED.format(0.1, 40), Affine(0.1, 0, -0.63, 0, -0.1, 0.62)),
    "west and south for x and y": (2053, Affine(500, 0, 9000, 0, -500, 3e6)),
}
pictures = st.integers(2, 4).flatmap(
    lambda classes: st.lists(
        st.lists(st.integers(0, classes - 1), min_size=12, max_size=12), min_size=12, max_size=12
    )
)
RING = np.ones((12, 12), np.uint32)
RING[3:9, 3:9] = 0
RING[5:7, 5:7] = 2


def regions_of(labels, transform, crs):
    names = np.unique(np.append(0, labels), return_inverse=True)[1][1:]
    labels = np.ascontiguousarray(names.reshape(np.shape(labels)), np.uint32)
    box = GeoBox(labels.shape, transform, None if crs is None else CRS.from_user_input(crs))
    rings, counts = trace(labels), np.bincount(labels.reshape(-1))[1:]
    return make_regions(rings, Sums(counts, counts, counts, FIRSTS), box, (0, 1), "picture.tif")


def ground(geometries):
    """Areas on the ellipsoid of geometries that are straight in longitude and latitude."""
    to_equal_area = pyproj.Transformer.from_crs(4326, 6933, always_xy=True)
    width = to_equal_area.transform(90, 0)[0] / 90

    def stretched(lonlat):
        return np.stack(
            [lonlat[:, 0] * width, to_equal_area.transform(lonlat[:, 0] * 0, lonlat[:, 1])[1]], axis=1
        )

    geometries = np.atleast_1d(geometries)
    # ring by ring: densifying a polygon whose hole touches its border, GEOS may lose the hole
    parts, owners = shapely.get_parts(geometries, return_index=True)
    rings, of_part = shapely.get_rings(parts, return_index=True)
    areas = shapely.area(
        shapely.polygons(shapely.transform(shapely.segmentize(rings, 0.05), stretched).tolist())
    )
    signs = np.where(np.diff(of_part, prepend=-1) > 0, 1, -1)  # the first ring of a polygon is its outer one
    return np.bincount(owners[of_part], areas * signs, len(geometries))


def check(regions):
    drawn = to_wgs84.wgs84_geometries(regions)
    west, south, east, north = shapely.total_bounds(drawn)
    assert west >= -180 and east <= 180 and south >= -90 and north <= 90
    assert shapely.is_valid(drawn).all()
    assert shapely.is_ccw(shapely.get_exterior_ring(shapely.get_parts(drawn))).all()
    assert shapely.intersects_xy(drawn, regions.columns["lon"], regions.columns["lat"]).all()
    assert ground(drawn) == pytest.approx(regions.columns["area_m2"], rel=1e-2)
    total = regions.columns["area_m2"].sum()
    assert ground(drawn).sum() == pytest.approx(total, rel=5e-3)
    assert ground(shapely.union_all(drawn))[0] == pytest.approx(total, rel=5e-3)
    return drawn


@pytest.mark.parametrize("place", PLACES)
def test_a_ring_around_an_island_keeps_its_ground(place):
    crs, transform = PLACES[place]
    assert len(check(regions_of(RING, transform, crs))) == 2


@pytest.mark.slow
@given(st.sampled_from(sorted(PLACES)), pictures)
@settings(max_examples=40)
def test_any_picture_keeps_its_ground(place, picture):
    crs, transform = PLACES[place]
    if np.any(picture):
        check(regions_of(picture, transform, crs))


def test_a_union_whose_hole_touches_its_border_keeps_its_ground():
    picture = np.zeros((12, 12), int)
    picture[2:10, 11] = picture[2, 9:] = picture[9, 9:] = picture[3, 8:10] = picture[3:7, 8] = 1
    picture[7, 8:10], picture[8:10, 9] = 2, 1
    crs, transform = PLACES["an older datum past 180"]
    check(regions_of(picture, transform, crs))


def test_a_region_that_crosses_the_antimeridian_is_cut_there():
    drawn = check(regions_of([[1, 1]], Affine(5, 0, 175, 0, -5, 10), 4326))
    assert drawn[0].equals(shapely.union(shapely.box(175, 5, 180, 10), shapely.box(-180, 5, -175, 10)))


def test_a_region_that_ends_at_the_antimeridian_is_not_cut():
    drawn = check(regions_of([[1, 2]], Affine(5, 0, 175, 0, -5, 10), 4326))
    assert drawn[0].equals(shapely.box(175, 5, 180, 10))
    assert drawn[1].equals(shapely.box(-180, 5, -175, 10))


def test_a_cap_over_the_pole_reaches_it_at_every_longitude():
    drawn = check(regions_of(np.ones((2, 2)), Affine(1e5, 0, -1e5, 0, -1e5, 1e5), 3413))
    assert shapely.contains_xy(drawn[0], [-179, -45, 0, 135], 89.9).all()
    assert drawn[0].bounds[0::2] == (-180, 180)


def test_long_edges_keep_their_course():
    regions = regions_of([[1] * 2000], Affine(100, 0, 1e5, 0, -100, 6e6), 32618)  # one pixel, 200 km wide
    one, other = (
        check(regions),
        to_wgs84.wgs84_geometries(regions_of([[1, 1]], Affine(1e5, 0, 1e5, 0, -100, 6e6), 32618)),
    )
    assert shapely.get_num_coordinates(one)[0] > shapely.get_num_coordinates(other)[0]
    assert ground(one) == pytest.approx(regions.columns["area_m2"], rel=2e-3)


@pytest.mark.parametrize("side", [0.0005, 0.003, 0.01, 0.05, 0.5, 5])
@given(pictures)
@settings(max_examples=15)
def test_vertices_stay_within_a_hundredth_of_a_pixel(side, picture):
    if not np.any(picture):
        return
    regions = regions_of(picture, Affine(side, 0, 4e5, 0, -side, 5e6), 32618)
    drawn = to_wgs84.wgs84_geometries(regions)
    assert shapely.is_valid(drawn).all()
    to_map = pyproj.Transformer.from_crs(4326, 32618, always_xy=True).transform
    x, y = to_map(*shapely.get_coordinates(drawn).T)
    corners = np.stack([(x - 4e5) / side, (y - 5e6) / side], axis=1)
    assert np.abs(corners - np.rint(corners)).max() < 0.0105


def test_decimals_are_no_more_than_the_pixels_need():
    texts = {}
    for side in (0.003, 0.05, 0.6, 30):
        regions = regions_of([[1]], Affine(side, 0, 4e5, 0, -side, 5e6), 32618)
        lon = shapely.get_coordinates(to_wgs84.wgs84_geometries(regions))[:, 0]
        texts[side] = max(len(repr(x).partition(".")[2]) for x in lon.tolist())
    assert list(texts.values()) == [10, 9, 7, 7]


def test_batches_change_nothing():
    rng = np.random.default_rng(1)
    regions = regions_of(
        np.arange(1, 145).reshape(12, 12) * rng.integers(0, 2, (12, 12)),
        *PLACES["a globe that begins before -180"][::-1],
    )
    whole = to_wgs84.wgs84_geometries(regions)
    pieces = list(to_wgs84.wgs84_batches(regions, vertices=1))
    assert len(pieces) == len(regions) and len(whole) == len(regions)
    assert sum(len(batch.others) for batch in pieces) == (shapely.get_type_id(whole) == 6).sum() > 0


@pytest.mark.parametrize("azimuth", [20, 75, 108, 140, 200, 250])
@pytest.mark.parametrize("left_m", [1e-5, 1e-4, 1e-3])
def test_notches_that_nearly_cut_a_region_leave_it_valid(azimuth, left_m):
    """It is valid in the map; in degrees, tips of notches may lie across the edge that they come near to."""
    tips = [(x, left_m) for x in (5700, 3700, 1200)]
    notches = [corner for x, y in tips for corner in ((x + 300, 600), (x, y), (x - 300, 600))]
    shape = [(0, 0), (8000, 0), (8000, 600), *notches, (0, 600)]
    turn = np.radians(azimuth)
    matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    region = shapely.Polygon(np.array(shape) @ matrix + [600_000, 5_200_000])
    assert region.is_valid
    wkt = CRS.from_epsg(32632).to_wkt()
    table = Regions(
        {"id": np.array([1]), "area_m2": np.array([region.area])}, np.array([region], object), wkt
    )
    (found,) = to_wgs84.wgs84_geometries(table)
    assert found.is_valid and found.geom_type in {"Polygon", "MultiPolygon"}
    area_m2 = abs(pyproj.Geod(ellps="WGS84").geometry_area_perimeter(found)[0])
    assert area_m2 == pytest.approx(region.area, rel=1e-3)  # the scale of UTM


def test_another_celestial_body_is_refused():
    europa = pyproj.CRS.from_proj4("+proj=eqc +R=1560800 +units=m +no_defs").to_wkt()
    with pytest.raises(OutputError, match="not on the Earth"):
        to_wgs84.wgs84_geometries(replace(regions_of([[1]], Affine(1, 0, 0, 0, -1, 0), None), wkt=europa))


def test_a_local_crs_is_refused():
    regions = regions_of([[1]], Affine(1, 0, 0, 0, -1, 0), CRS.from_wkt('LOCAL_CS["site",UNIT["metre",1]]'))
    with pytest.raises(OutputError, match="no place on the globe"):
        to_wgs84.wgs84_geometries(regions)


@pytest.mark.slow
def test_the_edge_of_a_projection_is_refused():
    regions = regions_of([[1]], Affine(36e6, 0, -18e6, 0, -18e6, 9e6), "ESRI:54009")
    with pytest.raises(OutputError, match="past the edge"):
        to_wgs84.wgs84_geometries(regions)


def test_no_regions_have_no_geometries():
    assert len(to_wgs84.wgs84_geometries(regions_of([[0]], Affine(1, 0, 0, 0, -1, 0), 4326))) == 0
