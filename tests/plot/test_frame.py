"""Plot coordinates: equal units in x and y, degrees and map coordinates in the same position."""

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from pyproj import Geod

from tests.plot.pictures import NORTH_UP, UTM
from uavseg.plot.page.page import Frame
from uavseg.raster.grid.geobox import GeoBox


@pytest.mark.parametrize(
    "epsg, x, y, pixel", [(32618, 4e5, 4.9e6, 10), (4326, 12, 60, 1e-4), (3857, 1e6, 8.4e6, 10)]
)
def test_a_unit_across_is_as_long_as_on_the_ellipsoid(epsg: int, x: float, y: float, pixel: float) -> None:
    box = GeoBox((300, 200), Affine(pixel, 0, x, 0, -pixel, y), rasterio.crs.CRS.from_epsg(epsg))
    frame = Frame(box)
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(np.array([150, 150]), np.array([100, 101])))
    metres = Geod(ellps="WGS84").inv(lon[0], lat[0], lon[1], lat[1])[2]
    unit = float(
        np.hypot(*(np.array(frame.plot_from_pixel * (101, 150)) - frame.plot_from_pixel * (100, 150)))
    )
    assert frame.metres_per_unit == pytest.approx(metres / unit, rel=1e-3)


@settings(max_examples=30)
@given(st.floats(-180, 180), st.sampled_from([1, -1]), st.floats(0.01, 100))
def test_degrees_and_map_coordinates_have_one_position_in_the_plot(
    angle: float, flip: int, pixel: float
) -> None:
    turned = Affine.translation(4e5, 4.9e6) * Affine.rotation(angle) * Affine.scale(pixel, flip * pixel)
    box = GeoBox((50, 80), turned, UTM)
    frame = Frame(box)
    row, col = np.array([0.0, 50, 12, 25]), np.array([0.0, 80, 30, 40])
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(row, col))
    expected = [frame.plot_from_pixel * place for place in zip(col, row, strict=True)]
    assert np.allclose(frame.plot_from_lonlat(lon, lat), expected, atol=1e-3 * pixel + 1e-5)
    assert np.allclose(frame.plot_from_pixel * (40, 25), 0, atol=1e-6 * pixel)


def test_units_are_as_long_up_as_across_in_degrees() -> None:
    box = GeoBox((100, 100), Affine(1e-4, 0, 10, 0, -1e-4, 60), rasterio.crs.CRS.from_epsg(4326))
    frame = Frame(box)
    lon, lat = box.lonlat_from_xy(*box.xy_from_pixel(np.array([50, 50, 40]), np.array([50, 60, 50])))
    geod = Geod(ellps="WGS84")
    metres = [geod.inv(lon[0], lat[0], lon[n], lat[n])[2] for n in (1, 2)]
    units = [
        float(np.hypot(*(np.array(frame.plot_from_pixel * p) - frame.plot_from_pixel * (50, 50))))
        for p in ((60, 50), (50, 40))
    ]
    assert metres[0] / units[0] == pytest.approx(metres[1] / units[1], rel=0.01)


def test_north_is_up_on_a_map_and_down_on_one_of_the_south_pole() -> None:
    assert Frame(GeoBox((9, 9), NORTH_UP, UTM)).north == pytest.approx((0, 1), abs=0.05)
    polar = GeoBox((9, 9), Affine(10, 0, 0, 0, -10, -1e6), rasterio.crs.CRS.from_epsg(3031))
    assert Frame(polar).north == pytest.approx((0, -1), abs=0.01)
    assert Frame(GeoBox((9, 9), Affine.identity(), None)).north is None
