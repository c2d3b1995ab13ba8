"""Regions at the edge of a raster, against pixels of a drawn one."""

import numpy as np
import pytest
import rioxarray  # noqa: F401 - DataArray.rio
import shapely
import xarray
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.crs import CRS

import uavseg
from uavseg.errors import RegionError
from uavseg.jobs.flights.under_raster import touches_edge
from uavseg.raster.grid.geobox import GeoBox

ROWS, COLS = 80, 120
PLACES = [
    ("EPSG:32618", Affine(2, 0, 4e5, 0, -2, 5e6)),
    ("EPSG:32618", Affine(2, 0, 4e5, 0, -2, 5e6) @ Affine.rotation(33)),
    ("EPSG:4326", Affine(1e-5, 0, 8, 0, -1e-5, 47)),
]


@pytest.mark.parametrize(("crs", "transform"), PLACES)
@given(st.integers(0, ROWS - 2), st.integers(0, COLS - 2), st.integers(1, 40), st.integers(1, 40))
@settings(max_examples=30)
def test_a_box_of_pixels_touches_where_its_outline_is_within_a_pixel_of_the_edge(
    crs: str, transform: Affine, row: int, col: int, height: int, width: int
) -> None:
    geobox = GeoBox((ROWS, COLS), transform, CRS.from_user_input(crs))
    bottom, right = min(row + height, ROWS), min(col + width, COLS)
    corners = np.array([(row, col), (row, right), (bottom, right), (bottom, col)], float)
    lon, lat = geobox.lonlat_from_xy(*geobox.xy_from_pixel(*corners.T))
    polygon = shapely.Polygon(np.column_stack([lon, lat]))
    away = min(row, col, ROWS - bottom, COLS - right)
    if away != 1:  # on the bound itself, rounding decides
        assert touches_edge([polygon], geobox).tolist() == [away < 1]


def test_regions_at_the_edge_are_left_out_refused_or_flown_on_request() -> None:
    image = np.full((128, 128), 20, np.uint8)
    image[:32, 32:64] = image[64:96, 64:96] = 220
    steps = 2.0 * np.arange(128)
    drawn = xarray.DataArray(image, dims=("y", "x"), coords={"y": 5e6 - steps, "x": 4e5 + steps})
    raster = drawn.rio.write_crs("EPSG:32618")
    regions = uavseg.extract(raster, range=(0.6, 1))
    how = {"altitude": 60, "home": "auto", "raster": raster}
    assert len(regions) == 2
    edge = int(regions.sort_values("lat")["id"].iloc[-1])
    with pytest.warns(UserWarning) as said:
        assert uavseg.plan(regions, **how).regions == 1
    assert any(f"region {edge} touches the edge" in str(one.message) for one in said)
    with pytest.warns(UserWarning) as said:
        assert uavseg.plan(regions, allow_edge=True, **how).regions == 2
        assert uavseg.plan(regions, ids=[3 - edge], **how).regions == 1
    assert not any("edge" in str(one.message) for one in said)
    with pytest.raises(RegionError, match=f"region {edge} touches the edge .*--allow-edge"):
        uavseg.plan(regions, ids=[edge], **how)
