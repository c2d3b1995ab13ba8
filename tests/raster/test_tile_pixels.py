"""Pixels below tiles of a web map are those that PROJ finds for every centre."""

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings, strategies as st
from pyproj import Transformer
from rasterio.crs import CRS

from uavseg.jobs.web_map.content import SIDE, TOLERANCE, tile_pixels
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground import ground_grid

# CRS, pixel in its units, where the raster begins
PLACES = [
    (32633, 0.05, (500_000.0, 5_000_000.0)),
    (32610, 30.0, (300_000.0, 7_000_000.0)),
    (4326, 1e-5, (14.0, 46.0)),
    (3035, 100.0, (2_700_000.0, 4_500_000.0)),
    (3857, 3.0, (-9e6, 5e6)),
]


def tile_at(lon: float, lat: float, zoom: int) -> tuple[int, int, int]:
    x = (lon + 180) / 360 * 2**zoom
    y = (1 - np.arcsinh(np.tan(np.radians(lat))) / np.pi) / 2 * 2**zoom
    return zoom, int(x), int(y)


@pytest.mark.slow
@settings(max_examples=20)
@given(
    st.sampled_from(PLACES),
    st.tuples(st.integers(65, 3000), st.integers(65, 3000)),
    st.floats(-180, 180),
    st.integers(0, 24),
    st.tuples(st.floats(0, 1), st.floats(0, 1)),
)
def test_the_pixel_below_each_centre_is_that_of_proj(
    place: tuple[int, float, tuple[float, float]],
    shape: tuple[int, int],
    angle: float,
    zoom: int,
    share: tuple[float, float],
) -> None:
    epsg, side, (x0, y0) = place
    transform = Affine.translation(x0, y0) * Affine.rotation(angle) * Affine.scale(side, -side)
    geobox = GeoBox(shape, transform, CRS.from_epsg(epsg))
    ground = ground_grid(geobox)
    bounds = ground.lon.min(), ground.lat.min(), ground.lon.max(), ground.lat.max()
    row, col = int(share[0] * (len(ground.lon) - 1)), int(share[1] * (len(ground.lon) - 1))
    tile = tile_at(ground.lon[row, col], ground.lat[row, col], zoom)

    centres = (np.arange(SIDE) + 0.5) / SIDE
    world = 2 * np.pi * 6378137
    x, y = np.meshgrid(
        (tile[1] + centres) / 2**zoom * world - world / 2, world / 2 - (tile[2] + centres) / 2**zoom * world
    )
    lon, lat = Transformer.from_crs(3857, 4326, always_xy=True).transform(x, y)
    x, y = Transformer.from_crs(4326, epsg, always_xy=True).transform(lon, lat)
    known = np.isfinite(x) & np.isfinite(y)
    cols, rows = ~transform * (np.where(known, x, 1e12), np.where(known, y, 1e12))
    near = (lon >= bounds[0]) & (lon <= bounds[2]) & (lat >= bounds[1]) & (lat <= bounds[3])
    inside = near & (rows >= 0) & (cols >= 0) & (rows < shape[0]) & (cols < shape[1])
    clear = ~near | (np.abs(rows - np.round(rows)) > TOLERANCE) & (np.abs(cols - np.round(cols)) > TOLERANCE)

    found = tile_pixels(geobox, tile)
    if found is None:
        assert not (inside & clear).any()
        return
    assert np.array_equal(found.inside[clear], inside[clear])
    both = clear & inside
    assert np.array_equal(found.rows[both], np.floor(rows[both]))
    assert np.array_equal(found.cols[both], np.floor(cols[both]))
    assert not found.rows[~found.inside].any()


@pytest.mark.parametrize("tile", [(0, 0, 0), (5, 3, 30), (26, 0, 0)])
def test_a_raster_far_away_or_too_small_has_no_pixel(tile: tuple[int, int, int]) -> None:
    geobox = GeoBox((70, 70), Affine(1, 0, 500_000, 0, -1, 5_000_000), CRS.from_epsg(32633))
    assert tile_pixels(geobox, tile) is None
