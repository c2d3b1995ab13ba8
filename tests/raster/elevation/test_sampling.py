"""Bilinear interpolation at positions: as slow plain ways do it, reading only tiles around them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from scipy.ndimage import map_coordinates

from uavseg.raster.elevation.dem import MAX_TILES, SIDE, BilinearSampler
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.read.dataset import Dataset


def sampler(values: Any) -> BilinearSampler:
    box = GeoBox(values.shape, Affine.identity(), None)
    return BilinearSampler(Dataset.of_values(np.asarray(values, np.float64), box, "heights"))


shapes = st.sampled_from(
    [(1, 1), (1, 5), (4, 1), (3, 7), (SIDE, SIDE + 1), (SIDE + 1, 9), (2 * SIDE + 3, 40)]
)


@given(shapes, st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_values_are_those_of_scipy_across_tiles(shape: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=shape)
    row, col = rng.uniform(0, shape[0], 300), rng.uniform(0, shape[1], 300)
    expected = map_coordinates(values, [row - 0.5, col - 0.5], order=1, mode="nearest")
    assert np.allclose(sampler(values).sample(row, col), expected, atol=1e-12)


def test_values_at_centres_are_those_that_rasterio_samples(tmp_path: Path) -> None:
    path, values = tmp_path / "a.tif", np.random.default_rng(1).normal(size=(300, 270)).astype("f4")
    transform = Affine(2, 0, 1000, 0, -2, 5000)
    profile = {"driver": "GTiff", "width": 270, "height": 300, "count": 1, "dtype": "float32"}
    with rasterio.open(path, "w", crs="EPSG:32632", transform=transform, **profile) as target:
        target.write(values, 1)
    row, col = np.array([0.5, 255.5, 256.5, 299.5]), np.array([0.5, 256.5, 10.5, 269.5])
    with rasterio.open(path) as source:
        x, y = transform * (col, row)
        expected = [value[0] for value in source.sample(zip(x, y, strict=True))]
    assert BilinearSampler(Dataset.open(str(path))).sample(row, col).tolist() == expected


def test_outside_and_beside_an_invalid_pixel_there_is_no_value() -> None:
    values = np.arange(25.0).reshape(5, 5)
    values[2, 2] = np.nan
    found = sampler(values).sample(
        np.array([-0.01, 5.01, 2.0, 2.5, 1.5, 3.49, np.inf, np.nan, 0.0, 5.0]),
        np.array([2.0, 2.0, 5.01, 2.51, 2.5, 3.4, 2.0, 2.0, 0.0, 5.0]),
    )
    assert np.isnan(found).tolist() == [True, True, True, True, False, True, True, True, False, False]
    assert found[4] == 7.0  # the centre of a pixel whose neighbour is invalid
    assert found[8:].tolist() == [0.0, 24.0]


def test_of_a_large_raster_only_the_tiles_around_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "large.tif"
    profile = {"driver": "GTiff", "width": 50_000, "height": 50_000, "count": 1, "dtype": "float32"}
    profile |= {"tiled": True, "SPARSE_OK": "TRUE", "crs": "EPSG:32632"}
    with rasterio.open(path, "w", transform=Affine(1, 0, 4e5, 0, -1, 5.2e6), **profile) as target:
        part = np.full((1, 512, 512), 7.0, "f4")
        target.write(part, window=rasterio.windows.Window(20_224, 30_208, 512, 512))
    windows, read = [], Dataset.read

    def recorded(self: Dataset, window: Any) -> Any:
        windows.append(window)
        return read(self, window)

    monkeypatch.setattr(Dataset, "read", recorded)
    heights = BilinearSampler(Dataset.open(str(path)))
    row, col = np.linspace(30_300, 30_600, 500), np.linspace(20_300, 20_600, 500)
    assert np.allclose(heights.sample(row, col), 7) and np.allclose(heights.sample(row, col), 7)
    assert 1 <= len(windows) <= 4
    assert max(window.rows * window.cols for window in windows) <= (SIDE + 1) ** 2


def test_few_tiles_are_kept() -> None:
    heights = sampler(np.zeros((SIDE * 3, SIDE * (MAX_TILES // 2))))
    row, col = np.mgrid[10 : SIDE * 3 : SIDE, 10 : SIDE * (MAX_TILES // 2) : SIDE].reshape(2, -1) + 0.0
    assert len(row) > MAX_TILES
    assert (heights.sample(row, col) == 0).all()
    assert len(heights._tiles) == MAX_TILES
