"""Places on valid pixels, and a home that is one of them."""

from pathlib import Path

import geopandas
import numpy as np
import pytest
import rasterio
import shapely
from rasterio.transform import from_origin

import uavseg
from uavseg.errors import MissionError
from uavseg.jobs.flights.under_raster import valid_ground
from uavseg.jobs.source.open_source import open_source
from uavseg.raster.geodesy.globe import WGS84, transform_between

BOX = from_origin(500_000, 5_200_000, 2, 2)


def draw(path: Path, valid: np.ndarray, crs: str | None = "EPSG:32632") -> Path:
    pixels = np.where(valid, 100, 0).astype(np.uint8)
    shape = {"height": valid.shape[0], "width": valid.shape[1]}
    with rasterio.open(
        path, "w", "GTiff", count=1, dtype="uint8", crs=crs, transform=BOX, nodata=0, **shape
    ) as out:
        out.write(pixels, 1)
    return path


@pytest.mark.slow
def test_a_place_is_ground_where_its_pixel_is_valid(tmp_path: Path) -> None:
    valid = np.random.default_rng(0).random((40, 60)) < 0.5
    is_ground = valid_ground(open_source(draw(tmp_path / "a.tif", valid)))
    assert is_ground is not None
    row, col = np.mgrid[-3:43, -3:63].reshape(2, -1)
    to_degrees = transform_between("EPSG:32632", WGS84)
    lon, lat = to_degrees(*(BOX * (col + 0.5, row + 0.5)))
    inside = (row >= 0) & (row < 40) & (col >= 0) & (col < 60)
    expected = [bool(ok and valid[r, c]) for ok, r, c in zip(inside, row, col, strict=True)]
    assert [is_ground(*place) for place in zip(lat.tolist(), lon.tolist(), strict=True)] == expected


def test_where_places_are_not_known_there_is_nothing_to_ask(tmp_path: Path) -> None:
    assert valid_ground(open_source(draw(tmp_path / "a.tif", np.ones((9, 9), bool), crs=None))) is None


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_home_is_a_valid_place_of_the_raster(tmp_path: Path) -> None:
    valid = np.ones((100, 100), bool)
    valid[:, :70] = False  # the nearest places west of the region
    raster = draw(tmp_path / "a.tif", valid)
    region = shapely.box(500_130, 5_199_890, 500_150, 5_199_910)
    regions = geopandas.GeoDataFrame(geometry=[region], crs="EPSG:32632")
    there = uavseg.plan(regions, altitude=60, home="auto", raster=raster).missions[0].home
    x, y = transform_between(WGS84, "EPSG:32632")(there.lon, there.lat)
    assert 500_140 <= x < 500_200 and 5_199_800 < y <= 5_200_000
    with pytest.raises(MissionError, match="no place for home"):
        blank = draw(tmp_path / "b.tif", np.arange(100)[None] * np.ones((100, 1)) < 1)
        uavseg.plan(regions, altitude=60, home="auto", raster=blank)
