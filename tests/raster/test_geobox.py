import numpy as np
import pytest
from affine import Affine
from hypothesis import given, strategies as st
from rasterio.crs import CRS
from rasterio.transform import xy

from uavseg.errors import ParameterError, RasterError
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.tiling import Window

TRANSFORMS = [
    Affine(0.5, 0, 3e5, 0, -0.5, 4e6),
    Affine(0.25, 0, -180, 0, 0.25, -90),  # south-up
    Affine(17.3, 5, 100, 10, -8.66, 200),  # rotated
]
BOXES = st.builds(
    GeoBox, st.tuples(st.integers(1, 99), st.integers(1, 99)), st.sampled_from(TRANSFORMS), st.none()
)


@given(BOXES, st.integers(0, 99), st.integers(0, 99))
def test_pixel_positions_are_those_of_rasterio(box, row, col):
    expected = xy(box.transform, row, col, offset="ul")
    assert np.allclose(box.xy_from_pixel(row, col), expected, rtol=1e-14)


@given(BOXES, st.integers(0, 50), st.integers(0, 50), st.integers(0, 20), st.integers(0, 20))
def test_pixels_of_a_window_keep_their_positions(box, row, col, inner_row, inner_col):
    part = box.window(Window(row, col, 30, 40))
    assert part.shape == (30, 40)
    there = box.xy_from_pixel(row + inner_row, col + inner_col)
    assert np.allclose(part.xy_from_pixel(inner_row, inner_col), there, rtol=1e-12)


@given(BOXES, st.sampled_from([2, 8, 64]))
def test_coarse_cells_are_blocks_of_pixels(box, side):
    coarse = box.coarsen(side)
    assert all(
        (cells - 1) * side < pixels <= cells * side
        for cells, pixels in zip(coarse.shape, box.shape, strict=True)
    )
    assert np.allclose(coarse.xy_from_pixel(3, 5), box.xy_from_pixel(3 * side, 5 * side), rtol=1e-12)


def test_the_middle_of_a_utm_zone_has_its_meridian():
    box = GeoBox((10, 10), TRANSFORMS[0], CRS.from_epsg(32618))
    lon, lat = box.lonlat_from_xy([500000.0, 500000.0], [0.0, 4000000.0])
    assert np.allclose(lon, -75, atol=1e-9)
    assert lat[0] == pytest.approx(0, abs=1e-9)
    assert 36 < lat[1] < 37


def test_longitude_comes_first_whatever_the_crs_says():
    box = GeoBox((10, 10), TRANSFORMS[1], CRS.from_epsg(4326))
    assert [float(v[0]) for v in box.lonlat_from_xy([12.5], [-33.0])] == [12.5, -33.0]


def test_europa_has_longitudes_of_its_own(shared_data):
    from uavseg.raster.read.dataset import Dataset

    box = Dataset.open(shared_data / "odd" / "riotiler_cog_nonearth.tif").geobox
    lon, lat = box.lonlat_from_xy([0.0], [1560800.0 * np.pi / 180])
    assert abs(lon[0]) == pytest.approx(180)
    assert lat[0] == pytest.approx(1)


def test_without_a_crs_there_is_no_longitude():
    with pytest.raises(RasterError, match="no coordinate reference system"):
        GeoBox((1, 1), TRANSFORMS[0], None).lonlat_from_xy([0.0], [0.0])


def test_a_site_grid_has_no_longitude():
    crs = CRS.from_wkt('LOCAL_CS["site",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]')
    with pytest.raises(RasterError, match="no transformation to longitude"):
        GeoBox((1, 1), TRANSFORMS[0], crs).lonlat_from_xy([0.0], [0.0])


def test_wkt_round_trips_to_the_same_crs():
    box = GeoBox((1, 1), TRANSFORMS[0], CRS.from_epsg(32618))
    assert CRS.from_wkt(box.wkt) == box.crs
    assert GeoBox((1, 1), TRANSFORMS[0], None).wkt is None


@pytest.mark.parametrize(
    ("transform", "said"),
    [
        (Affine(np.nan, 0, 0, 0, -1, 0), "is not finite"),
        (Affine(1, 0, np.inf, 0, -1, 0), "is not finite"),
        (Affine(1, 0, 0, 0, -1, np.nan), "is not finite"),
        (Affine(1e300, 0, 0, 0, -1, 0), "too large"),
        (Affine(0, 0, 5, 0, -1, 5), "lines or points"),
        (Affine(1, 1, 0, 1, 1, 0), "lines or points"),
        (Affine(1e-3, 0, 1e14, 0, -1e-3, 0), "too small"),
    ],
)
def test_a_transform_that_gives_pixels_no_place_is_refused(transform: Affine, said: str) -> None:
    with pytest.raises(RasterError, match=said):
        GeoBox((10, 20), transform, None)


def test_positions_that_do_not_belong_together_are_refused() -> None:
    box = GeoBox((10, 20), Affine(1, 0, 0, 0, -1, 0), None)
    with pytest.raises(ParameterError, match="one shape"):
        box.xy_from_pixel([1, 2], [1, 2, 3])
    with pytest.raises(ParameterError, match="at least 1 pixel"):
        box.coarsen(0)
