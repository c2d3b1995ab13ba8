"""Photographs drawn on the ground agree with the raster that they were drawn from."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer
from rasterio.warp import Resampling, reproject
from scipy.ndimage import gaussian_filter
from skimage.registration import phase_cross_correlation

from tests.photographs.make import draw_photograph, ground_lonlat
from uavseg.errors import PhotographError
from uavseg.execution.executors import threads
from uavseg.photographs.ground import Ground
from uavseg.photographs.orthophoto import COARSEST, TILE, Mosaic, View, mosaic_of
from uavseg.photographs.photograph import Photograph
from uavseg.raster.elevation.dem import Dem
from uavseg.raster.geodesy.globe import WGS84, transform_between, utm_crs

PLACE = 47.05, 8.31  # latitude and longitude of the middle of the scene
SIDE = 1500  # pixels of the scene
PIXEL_M = 0.2
IMAGE, FOCAL = (480, 360), 400.0
Array = np.ndarray[Any, Any]


def write(path: Path, bands: Array, place: tuple[float, float], pixel_m: float, epsg: int | None = None) -> Path:
    """Write a raster around a place, in its UTM zone."""
    lat, lon = place
    epsg = epsg or (32600 if lat >= 0 else 32700) + int((lon + 180) // 6) + 1
    x, y = Transformer.from_crs(4326, epsg, always_xy=True).transform(lon, lat)
    count, rows, cols = bands.shape
    transform = Affine(pixel_m, 0, x - cols * pixel_m / 2, 0, -pixel_m, y + rows * pixel_m / 2)
    profile = {"count": count, "height": rows, "width": cols, "dtype": bands.dtype.name}
    with rasterio.open(path, "w", "GTiff", crs=f"EPSG:{epsg}", transform=transform, **profile) as file:
        file.write(bands)
    return path


def texture(bands: int = 1, seed: int = 1, side: int = SIDE) -> Array:
    """Smooth noise that a photograph can show: structures of some pixels of the photograph."""
    noise = np.random.default_rng(seed).normal(size=(bands, side, side))
    smooth = np.stack([gaussian_filter(band, 5) for band in noise])
    return np.clip(128 + 45 * smooth / smooth.std(), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("scene") / "scene.tif", texture(), PLACE, PIXEL_M)


@pytest.fixture(scope="module")
def slope(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hillside that rises by a fifth to the east, with waves."""
    row, col = np.mgrid[:400, :400] * 2.0
    heights = 500 + 0.2 * (col - 400) + 4 * np.sin(row / 60)
    return write(tmp_path_factory.mktemp("slope") / "dem.tif", heights[None].astype("f4"), PLACE, 2.0)


def photograph(path: Path, **pose: Any) -> Photograph:
    given = {"lat": PLACE[0], "lon": PLACE[1], "relative_m": 60.0, "yaw_deg": 30.0} | pose
    return Photograph(path=str(path), **{"image_px": IMAGE, "focal_px": FOCAL} | given)


def drawn(mosaic: Mosaic, **how: Any) -> Array:
    return np.concatenate([strip for _, strip in mosaic.strips(**how)], axis=1)


def expected(scene: Path, mosaic: Mosaic) -> Array:
    """The scene on the grid of a mosaic, by GDAL."""
    with rasterio.open(scene) as source:
        result = np.zeros((source.count, *mosaic.geobox.shape), np.float32)
        reproject(
            rasterio.band(source, list(source.indexes)),
            result,
            dst_transform=mosaic.geobox.transform,
            dst_crs=mosaic.geobox.crs,
            resampling=Resampling.bilinear,
        )
    return result


def shifts_px(ours: Array, theirs: Array, valid: Array, side: int = 48) -> Array:
    """Distances by which patches that are drawn as a whole are apart."""
    found = []
    for row in range(0, valid.shape[0] - side, side):
        for col in range(0, valid.shape[1] - side, side):
            patch = slice(row, row + side), slice(col, col + side)
            if valid[patch].all():
                shift, *_ = phase_cross_correlation(theirs[patch], ours[patch], upsample_factor=20)
                found.append(math.hypot(*shift))
    return np.array(found)


def assert_agrees(mosaic: Mosaic, scene: Path, patches: int = 12, median_px: float = 0.5) -> Array:
    pixels = drawn(mosaic)
    theirs, valid = expected(scene, mosaic), pixels[-1] > 0
    shifts = shifts_px(pixels[0].astype(float), theirs[0], valid)
    assert len(shifts) >= patches, len(shifts)
    assert np.median(shifts) < median_px, np.median(shifts)
    assert np.quantile(shifts, 0.9) < 2 * median_px
    assert np.corrcoef(pixels[0][valid], theirs[0][valid])[0, 1] > 0.9
    return pixels


POSES: list[dict[str, Any]] = [
    {},
    {"yaw_deg": -140.0, "pitch_deg": -90.0},
    {"pitch_deg": -60.0},
    {"pitch_deg": -70.0, "roll_deg": 12.0, "yaw_deg": 200.0},
    {"pitch_deg": -50.0, "yaw_deg": 300.0},
]


@pytest.mark.parametrize("pose", POSES)
def test_on_flat_ground(pose: dict[str, Any], scene: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.jpg", **pose)
    draw_photograph(one.path, one, scene)
    assert_agrees(mosaic_of([one], Ground()), scene)


@pytest.mark.parametrize("pose", POSES[1:4])
def test_over_a_slope(pose: dict[str, Any], scene: Path, slope: Path, tmp_path: Path) -> None:
    one = photograph(tmp_path / "a.jpg", **pose | {"relative_m": None, "altitude_m": 560.0})
    draw_photograph(one.path, one, scene, slope)
    assert_agrees(mosaic_of([one], Ground(Dem.open(slope))), scene)
