"""Elevation models: units, zeros, places; what is no elevation model is refused."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from pyproj import Transformer, datadir

from tests.flight.terrain.dems import EAST, HOME, NORTH, draw, hills, plane, write
from uavseg.errors import MosaicError, ParameterError, RasterError, RasterReadError
from uavseg.raster.elevation import dem
from uavseg.raster.elevation.dem import Dem

LEVEL = Affine(1e-3, 0, 8.9, 0, -1e-3, 47.1)  # of a geographic raster around home
FLAT = np.full((200, 200), 100.0)


def at_home(dem: Dem) -> float:
    return float(dem.heights_m([HOME[1]], [HOME[0]])[0])


def test_heights_are_those_of_the_drawn_plane(tmp_path: Path) -> None:
    dem = Dem.open(draw(tmp_path / "a.tif", plane(0.2, -0.1), pixel_m=7.0))
    x, y = np.random.default_rng(2).uniform(-1000, 1000, (2, 200))
    lon, lat = Transformer.from_crs(32632, 4326, always_xy=True).transform(EAST + x, NORTH + y)
    assert np.allclose(dem.heights_m(lon, lat), 400 + 0.2 * x - 0.1 * y, atol=1e-3)


def test_a_geographic_and_a_rotated_model_have_the_same_heights(tmp_path: Path) -> None:
    surface = hills(100)
    projected = Dem.open(draw(tmp_path / "a.tif", surface, pixel_m=5.0))
    turned = Affine.translation(EAST, NORTH) * Affine.rotation(30) * Affine.scale(5, -5)
    turned *= Affine.translation(-200, -200)
    col, row = np.meshgrid(np.arange(400) + 0.5, np.arange(400) + 0.5)
    x, y = turned * (col, row)
    rotated = Dem.open(write(tmp_path / "b.tif", surface(x - EAST, y - NORTH), turned, 32632))
    degrees = Affine(5e-5, 0, 8.99, 0, -5e-5, 47.01)
    lon, lat = degrees * (col, row)
    x, y = Transformer.from_crs(4326, 32632, always_xy=True).transform(lon, lat)
    geographic = Dem.open(write(tmp_path / "c.tif", surface(x - EAST, y - NORTH), degrees, 4326))
    lon, lat = np.random.default_rng(3).uniform(-0.004, 0.004, (2, 100)) + np.array([[9.0], [47.0021]])
    expected = projected.heights_m(lon, lat)
    assert np.isfinite(expected).all() and np.ptp(expected) > 10
    assert np.allclose(rotated.heights_m(lon, lat), expected, atol=0.3)
    assert np.allclose(geographic.heights_m(lon, lat), expected, atol=0.3)


@pytest.mark.parametrize(
    ("crs", "how", "metres"),
    [
        ("EPSG:4326", {}, 100.0),
        ("EPSG:4326", {"unit": "m"}, 100.0),
        ("EPSG:4326", {"unit": "ft"}, 30.48),
        ("EPSG:4326", {"unit": "US survey foot"}, 100 * 1200 / 3937),
        ("EPSG:4326", {"scale": 0.1}, 10.0),
        ("EPSG:4326", {"scale": 0.5, "unit": "cm"}, 0.5),
        ("EPSG:4269+6360", {}, 100 * 1200 / 3937),
        ("EPSG:4269+8228", {}, 30.48),
        ("EPSG:4326+5773", {}, 100.0),
        ("EPSG:4326+3855", {"dtype": "int16"}, 100.0),
    ],
)
def test_units_become_metres(tmp_path: Path, crs: str, how: dict[str, Any], metres: float) -> None:
    dem = Dem.open(write(tmp_path / "a.tif", FLAT, LEVEL, crs, **how))
    assert at_home(dem) == pytest.approx(metres, rel=1e-9)
    assert dem.heights.has_unit == ("unit" in how or "+" in crs)
    assert dem.heights.reference.zero == ("sea" if "+" in crs else "unknown")
    assert [("unit" in note, "above the sea" in note) for note in dem.notes()] == (
        [] if "+" in crs else [("unit" not in how, True)]
    )


def test_an_older_file_tells_its_vertical_crs_too(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif", FLAT, LEVEL, "EPSG:4269+6360", GEOTIFF_VERSION="1.0")
    with rasterio.open(path) as source:
        assert len(source.crs.to_wkt()) and "NAVD88" not in source.crs.to_wkt()
    assert Dem.open(path).heights.reference.name == "NAVD88 height (ftUS)"


@pytest.mark.parametrize(
    ("values", "crs", "how", "words"),
    [
        (FLAT, None, {}, "no coordinate reference system"),
        (np.stack([FLAT, FLAT]), "EPSG:4326", {}, "2 bands"),
        (np.stack([FLAT] * 3), "EPSG:4326", {"dtype": "uint8", "nodata": None}, "3 bands"),
        (FLAT, "EPSG:4326", {"dtype": "uint8", "nodata": None}, "picture"),
        (FLAT, "EPSG:4326", {"unit": "fathom"}, "'fathom', a unit that is not known"),
        (FLAT, "EPSG:2263", {}, "feet or metres"),
        (FLAT, "EPSG:4326+5831", {}, "depths"),
        (FLAT, "IAU_2015:30100", {}, "not one of the Earth"),
    ],
)
def test_what_is_no_elevation_model_is_refused(
    tmp_path: Path, values: Any, crs: Any, how: dict[str, Any], words: str
) -> None:
    path = write(tmp_path / "a.tif", values, LEVEL, crs, **how)
    with pytest.raises(RasterError, match=words):
        Dem.open(path)


def test_a_file_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    source = write(tmp_path / "a.tif", FLAT, LEVEL, "EPSG:4326+5773")
    vrt = tmp_path / "a.vrt"
    with rasterio.open(source) as found:
        wkt = found.crs.to_wkt().replace('"', "&quot;")
    vrt.write_text(
        f'<VRTDataset rasterXSize="200" rasterYSize="200"><SRS>{wkt}</SRS>'
        "<GeoTransform>8.9, 1e-3, 0, 47.1, 0, -1e-3</GeoTransform>"
        '<VRTRasterBand dataType="Float32" band="1"><UnitType>ft</UnitType>'
        '<SimpleSource><SourceFilename relativeToVRT="1">a.tif</SourceFilename></SimpleSource>'
        "</VRTRasterBand></VRTDataset>"
    )
    with pytest.raises(RasterError, match="contradicts itself"):
        Dem.open(vrt)
    vrt.write_text(vrt.read_text().replace("<UnitType>ft", "<UnitType>m"))
    assert at_home(Dem.open(vrt)) == 100


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(RasterReadError, match=r"no file nothing\.tif"):
        Dem.open("nothing.tif")
    with pytest.raises(ParameterError, match="at least one"):
        Dem.open([])


def test_files_that_agree_are_one_model(tmp_path: Path) -> None:
    surface = plane(0.1, 0.0)
    whole = draw(tmp_path / "whole.tif", surface)
    parts = []
    with rasterio.open(whole) as source:
        for side, cols in (("west", (0, 150)), ("east", (150, 300))):
            window = rasterio.windows.Window(cols[0], 0, 150, 300)
            values = source.read(1, window=window)
            transform = source.window_transform(window)
            parts.append(write(tmp_path / f"{side}.tif", values, transform, 32632))
    lon, lat = np.random.default_rng(3).uniform(-0.01, 0.01, (2, 300)) + np.array([[9.0], [47.0021]])
    both = Dem.open(parts)
    assert np.array_equal(both.heights_m(lon, lat), Dem.open(whole).heights_m(lon, lat))
    assert np.isnan(Dem.open(parts[0]).heights_m(lon, lat)).any()
    assert both.name == "west.tif and 1 more"
    feet = write(tmp_path / "feet.tif", values, transform, 32632, unit="ft")
    with pytest.raises(RasterError, match=r"feet.tif differs from .*west.tif"):
        Dem.open([parts[0], feet])
    coarse = draw(tmp_path / "coarse.tif", surface, pixel_m=20)
    with pytest.raises(MosaicError):
        Dem.open([parts[0], coarse])


@pytest.mark.parametrize("west", [179.9, -180.1, 539.9])
def test_a_model_at_the_antimeridian_has_both_sides(tmp_path: Path, west: float) -> None:
    lon = west + (np.arange(200) + 0.5) * 1e-3
    path = write(
        tmp_path / "a.tif", np.tile(1000 * (lon - west), (200, 1)), Affine(1e-3, 0, west, 0, -1e-3, 10), 4326
    )
    dem = Dem.open(path)
    found = dem.heights_m([179.95, 180.0, -180.0, -179.95, 179.8, -179.8], [9.9] * 6)
    assert np.allclose(found, [50, 100, 100, 150, np.nan, np.nan], atol=1e-3, equal_nan=True)


@pytest.mark.parametrize("value", [-32768.0, -9999.0, 32767.0, 3.4e38, np.nan])
def test_voids_that_are_not_marked_are_no_heights(tmp_path: Path, value: float) -> None:
    values = FLAT.copy()
    values[:, :100] = value
    dem = Dem.open(write(tmp_path / "a.tif", values, LEVEL, 4326, nodata=None))
    assert np.isnan(dem.heights_m([8.95, 8.9996, 9.05], [47.0] * 3)).tolist() == [True, True, False]


def test_what_a_model_covers_is_named_in_degrees(tmp_path: Path) -> None:
    dem = Dem.open(write(tmp_path / "a.tif", FLAT, LEVEL, 4326))
    assert dem.covered() == "lat 46.900000 to 47.100000, lon 8.900000 to 9.100000"


def test_heights_above_the_ellipsoid_are_recognised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "a.tif", FLAT, LEVEL, 4979, GEOTIFF_VERSION="1.1")
    monkeypatch.setattr("uavseg.raster.elevation.dem.sea_from_ellipsoid", lambda: None)
    dem = Dem.open(path)
    assert dem.heights.reference.zero == "ellipsoid" and not dem.is_above_sea
    assert at_home(dem) == 100 and "only their differences" in dem.notes()[0]
    monkeypatch.setattr("uavseg.raster.elevation.dem.sea_from_ellipsoid", lambda: lambda lon, lat, h: h - 48)
    dem = Dem.open(path)
    assert dem.is_above_sea and at_home(dem) == 52 and "converted" in dem.notes()[0]


def test_without_a_grid_of_the_geoid_nothing_is_converted(monkeypatch: pytest.MonkeyPatch) -> None:
    from pyproj import network

    if (Path(datadir.get_data_dir()) / "us_nga_egm96_15.tif").exists():
        pytest.skip("PROJ has the grid of EGM96 here")
    before = network.is_network_enabled()
    network.set_network_enabled(True)
    try:
        assert dem.sea_from_ellipsoid() is None
        assert network.is_network_enabled()
    finally:
        network.set_network_enabled(before)


@pytest.mark.slow
def test_a_grid_of_the_geoid_that_is_there_is_used(tmp_path: Path) -> None:
    grid = Affine(1.0, 0, -180.5, 0, -1.0, 90.5)
    profile = {
        "driver": "GTX",
        "width": 361,
        "height": 181,
        "count": 1,
        "dtype": "float32",
        "transform": grid,
    }
    with rasterio.open(tmp_path / "egm96_15.gtx", "w", **profile) as target:
        target.write(np.full((1, 181, 361), 31.5, "f4"))
    script = (
        "import numpy as np, pyproj; pyproj.datadir.append_data_dir(r'%s')\n"
        "from uavseg.raster.elevation.dem import sea_from_ellipsoid\n"
        "print(sea_from_ellipsoid()(np.array([9.0]), np.array([47.0]), np.array([400.0]))[0])"
    )
    run = subprocess.run(
        [sys.executable, "-c", script % tmp_path],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert run.returncode == 0, run.stderr
    assert float(run.stdout) == pytest.approx(368.5)
