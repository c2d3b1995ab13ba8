"""Region tables: polygons and their measured attributes."""

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio import features
from rasterio.crs import CRS

from uavseg.raster.grid.geobox import GeoBox
from uavseg.regions.outline.trace import trace
from uavseg.regions.shapes import LazyPolygons
from uavseg.regions.table import COLUMNS, make_regions
from uavseg.segmentation.components import Sums

FIRSTS = np.empty((0, 2), np.int64)  # no measure depends on first pixels
ONE_PIXEL = Sums(np.ones(1), np.ones(1), np.ones(1), FIRSTS)
NORTH_UP = Affine(0.5, 0, 4e5, 0, -0.5, 5e6)
TRANSFORMS = {
    "north-up": NORTH_UP,
    "south-up": Affine(0.5, 0, 4e5, 0, 0.5, 5e6),
    "rotated": Affine(0.375, 0.5, 4e5, 0.5, -0.375, 5e6),
    "mirrored": Affine(-0.5, 0, 4e5, 0, -0.5, 5e6),
    "pixels": Affine.identity(),
}
HOLED = np.array([[1, 1, 1, 0, 2], [1, 0, 1, 0, 2], [1, 1, 1, 3, 3]], np.uint32)


@st.composite
def pictures(draw):
    rows, cols, most = draw(st.integers(1, 12)), draw(st.integers(1, 12)), draw(st.integers(1, 4))
    cells = draw(st.lists(st.integers(0, most), min_size=rows * cols, max_size=rows * cols))
    names = np.unique([0, *cells], return_inverse=True)[1][1:]
    return names.reshape(rows, cols).astype(np.uint32)


def made(labels, transform=NORTH_UP, crs=32618, grey=None):
    grey = np.full(labels.shape, 30_000) if grey is None else grey
    sums = [
        np.bincount(labels.reshape(-1), grey.reshape(-1).astype(float) ** k)[1:].astype(np.uint64)
        for k in range(3)
    ]
    box = GeoBox(labels.shape, transform, None if crs is None else CRS.from_epsg(crs))
    rings = trace(labels)
    return make_regions(rings, Sums(sums[0].astype(np.int64), *sums[1:], FIRSTS), box, (0.25, 0.75), "a.tif")


def by_rasterio(labels, transform):
    """One geometry for each label, the slow way."""
    found = features.shapes(labels.astype(np.int32), labels > 0, transform=transform)
    pieces = [(int(label), shapely.geometry.shape(geometry)) for geometry, label in found]
    return [
        shapely.union_all([piece for label, piece in pieces if label == n])
        for n in range(1, labels.max() + 1)
    ]


@pytest.mark.slow
@given(pictures(), st.sampled_from(sorted(TRANSFORMS)))
@settings(max_examples=60)
def test_polygons_are_those_of_rasterio(labels, name):
    built = np.asarray(LazyPolygons(trace(labels), TRANSFORMS[name]))
    expected = by_rasterio(labels, TRANSFORMS[name])
    assert len(built) == len(expected)
    assert shapely.is_valid(built).all()
    assert all(shapely.equals(*pair) for pair in zip(built, expected, strict=True))


@given(pictures(), st.sampled_from(sorted(TRANSFORMS)))
@settings(max_examples=30)
def test_exteriors_run_counter_clockwise_and_holes_clockwise(labels, name):
    for part in shapely.get_parts(LazyPolygons(trace(labels), TRANSFORMS[name])):
        exterior, *holes = shapely.get_rings(part)
        assert exterior.is_ccw and not any(hole.is_ccw for hole in holes)


@given(pictures(), st.sampled_from(sorted(TRANSFORMS)))
@settings(max_examples=30)
def test_without_a_crs_measures_are_those_of_the_polygons(labels, name):
    regions = made(labels, TRANSFORMS[name], None)
    assert regions.columns["area_m2"] == pytest.approx(shapely.area(regions.polygons))
    assert regions.columns["perimeter_m"] == pytest.approx(shapely.length(regions.polygons))
    parts, owners = shapely.get_parts(regions.polygons, return_index=True)
    holes = np.bincount(owners, shapely.get_num_interior_rings(parts), minlength=len(regions))
    assert regions.columns["holes"].tolist() == holes.tolist()
    assert np.isnan(regions.columns["lon"]).all() and np.isnan(regions.columns["lat"]).all()


@given(pictures(), st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_mean_and_deviation_are_those_of_the_pixels(labels, seed):
    grey = np.random.default_rng(seed).integers(0, 65536, labels.shape)
    columns = made(labels, grey=grey).columns
    for n in range(1, labels.max() + 1):
        assert columns["mean"][n - 1] == pytest.approx((grey[labels == n] / 65535).mean())
        assert columns["std"][n - 1] == pytest.approx((grey[labels == n] / 65535).std(), abs=1e-7)


def test_a_flat_region_of_billions_of_pixels_has_no_deviation():
    rings = trace(np.array([[1]], np.uint32))
    n, g = 4_000_000_000, 54_321
    sums = [np.array([n * g**k], np.uint64) for k in range(3)]
    regions = make_regions(rings, Sums(*sums, FIRSTS), GeoBox((1, 1), NORTH_UP, None), (0, 1), "")
    assert regions.columns["mean"][0] == g / 65535
    assert regions.columns["std"][0] < 1e-6


def test_columns_come_in_their_order_and_kinds():
    columns = made(HOLED).columns
    assert list(columns) == list(COLUMNS)
    assert [column.dtype for column in columns.values()] == [np.dtype(kind) for kind in COLUMNS.values()]
    assert columns["id"].tolist() == [1, 2, 3]
    assert columns["pixels"].tolist() == [8, 2, 2]
    assert columns["holes"].tolist() == [1, 0, 0]
    assert columns["range_low"].tolist() == [0.25] * 3 and columns["range_high"].tolist() == [0.75] * 3
    assert columns["source"].tolist() == ["a.tif"] * 3


@given(pictures())
@settings(max_examples=30)
def test_the_point_lies_inside(labels):
    regions = made(labels, Affine(1e-5, 0, 10, 0, -1e-5, 50), 4326)
    points = shapely.points(regions.columns["lon"], regions.columns["lat"])
    assert shapely.contains_properly(regions.polygons, points).all()


def test_longitudes_of_points_are_within_a_turn():
    regions = made(HOLED, Affine(1, 0, 300, 0, -1, 50), 4326)
    assert ((regions.columns["lon"] > -60) & (regions.columns["lon"] < -55)).all()


def test_a_point_outside_of_the_projection_is_nan():
    regions = made(np.eye(2, dtype=np.uint32)[::-1].copy() * 1, Affine(18e6, 0, -18e6, 0, -9e6, 9e6), None)
    beyond = GeoBox((2, 2), Affine(1e7, 0, -9e7, 0, -1e7, 9e7), CRS.from_string("ESRI:54009"))
    rings = trace(np.ones((2, 2), np.uint32))
    lost = make_regions(rings, ONE_PIXEL, beyond, (0, 1), "")
    assert len(regions) == 1 and np.isnan(lost.columns["lon"][0])


def test_a_local_crs_has_no_longitude_and_latitude():
    site = CRS.from_wkt('LOCAL_CS["site",UNIT["metre",1]]')
    rings = trace(np.ones((2, 2), np.uint32))
    regions = make_regions(rings, ONE_PIXEL, GeoBox((2, 2), NORTH_UP, site), (0, 1), "")
    assert np.isnan(regions.columns["lat"][0]) and regions.columns["area_m2"][0] == pytest.approx(1)


def test_no_regions_have_all_columns():
    regions = made(np.zeros((3, 4), np.uint32))
    assert len(regions) == 0
    assert {len(column) for column in regions.columns.values()} == {0}


def test_regions_are_selected_with_their_attributes():
    chosen = made(HOLED).select(np.array([2, 0]))
    assert chosen.columns["id"].tolist() == [3, 1]
    assert shapely.area(chosen.polygons).tolist() == [0.5, 2]


def test_a_frame_has_all_columns_and_the_crs():
    regions = made(HOLED)
    frame = regions.frame()
    assert list(frame.columns) == [*COLUMNS, "geometry"]
    assert frame.crs == 32618
    assert frame.area.tolist() == [2, 0.5, 0.5]
    assert made(np.zeros((3, 4), np.uint32)).frame().crs == 32618
