"""Summary: statistics agree with numpy, and are marked where not every pixel was counted."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st

from uavseg.execution.executors import threads
from uavseg.jobs.info import info, open_to_describe
from uavseg.plot.summary_text import _EIGHTHS, summary_text, text_bar
from uavseg.raster import summary
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.summary import summarize

UTM = rasterio.crs.CRS.from_epsg(32618)
NORTH_UP = Affine(2, 0, 380_000, 0, -2, 4_897_000)
DICE = np.random.default_rng(7)


def opened(path: Path, pixels: np.ndarray, **more: Any) -> Dataset:
    pixels = pixels if pixels.ndim == 3 else pixels[None]
    shape = {"count": pixels.shape[0], "height": pixels.shape[1], "width": pixels.shape[2]}
    place = {"transform": NORTH_UP, "crs": UTM} | more
    with rasterio.open(path, "w", driver="GTiff", dtype=pixels.dtype, **shape, **place) as file:
        file.write(pixels)
    return Dataset.open(path)


def v_of(intensity: np.ndarray, low: float, high: float) -> np.ndarray:
    """v from its definition: 16-bit grey levels divided by that of white."""
    return np.floor(65535 * np.clip((intensity - low) / (high - low), 0, 1) + 0.5) / 65535


def test_statistics_of_8_bits_are_those_of_numpy(tmp_path: Path) -> None:
    pixels = DICE.integers(0, 256, (150, 200), dtype=np.uint8)
    found = summarize(opened(tmp_path / "a.tif", pixels, nodata=0))
    v = v_of(pixels[pixels > 0].astype(float), 0, 255)
    assert (found.counted, found.valid) == (30_000, v.size)
    assert found.nodata_share == pytest.approx((pixels == 0).mean())
    assert (found.mean, found.std) == (pytest.approx(v.mean()), pytest.approx(v.std()))
    assert found.histogram == tuple(np.histogram(v, np.arange(21) / 20)[0])
    assert found.exact and found.stretch.startswith("dtype")


def test_statistics_of_floats_with_nan_are_those_of_numpy(tmp_path: Path) -> None:
    pixels = DICE.normal(300, 20, (90, 130)).astype(np.float32)
    pixels[:30, :40] = np.nan
    found = summarize(opened(tmp_path / "a.tif", pixels), "250,350")
    v = v_of(pixels[np.isfinite(pixels)].astype(float), 250, 350)
    assert found.valid == v.size == 130 * 90 - 1200
    assert (found.mean, found.std) == (pytest.approx(v.mean()), pytest.approx(v.std()))
    assert sum(found.histogram) == v.size


def test_intensities_that_float32_cannot_hold_leave_values_that_json_can(tmp_path: Path) -> None:
    pixels = np.where(np.arange(300).reshape(15, 20) % 2, 3e307, -3e307)
    values = summarize(opened(tmp_path / "a.tif", pixels)).as_dict()["values"]
    assert json.loads(json.dumps(values, allow_nan=False))["low"] is None


def test_bounds_and_centre_are_those_of_the_raster(tmp_path: Path) -> None:
    found = summarize(opened(tmp_path / "a.tif", np.ones((100, 50), np.uint8)))
    assert (found.rows, found.cols, found.epsg, found.driver) == (100, 50, 32618, "GTiff")
    assert found.bounds == (380_000, 4_896_800, 380_100, 4_897_000)
    assert found.resolution == pytest.approx((2, 2), rel=1e-3)
    lonlat = pyproj.Transformer.from_crs(32618, 4326, always_xy=True).transform(380_050, 4_896_900)
    assert found.center == pytest.approx(lonlat, abs=1e-9)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_raster_without_georeferencing_has_no_crs_and_no_centre(tmp_path: Path) -> None:
    dataset = opened(tmp_path / "a.tif", np.ones((10, 10), np.uint8), crs=None, transform=Affine.identity())
    text = summary_text(summarize(dataset))
    assert "coordinates are pixels" in text and "centre" not in text


def test_workers_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = opened(tmp_path / "a.tif", DICE.integers(0, 4000, (300, 200), dtype=np.uint16))
    whole = summarize(dataset)
    monkeypatch.setattr(summary, "tile_side", lambda *_: 64)
    assert summarize(dataset, map=threads(2)) == whole


def test_a_large_raster_is_downsampled_and_marked_as_inexact(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(summary, "EXACT_PIXELS", 1000)
    monkeypatch.setattr(summary, "COARSE_SIDE", 40)
    dataset = opened(tmp_path / "a.tif", np.full((400, 200), 102, np.uint8))
    monkeypatch.setattr(Dataset, "read", None)
    found = summarize(dataset)
    assert not found.exact and found.counted == 40 * 20 and found.mean == pytest.approx(0.4)
    assert (found.rows, found.cols) == (400, 200)
    assert "800 pixels of 80000" in summary_text(found)


@settings(max_examples=40)
@given(st.lists(st.integers(0, 1000), min_size=20, max_size=20).filter(any))
def test_the_threshold_has_the_largest_between_class_variance(counts: list[int]) -> None:
    greys = np.zeros(1 << 16, np.int64)
    middles = (np.arange(20) + 0.5) / 20
    greys[np.round(middles * 65535).astype(int)] = counts
    cut = summary._otsu_threshold(greys)
    values = np.repeat(middles, counts)

    def between(edge: float) -> float:
        dark, bright = values[values < edge], values[values >= edge]
        if not len(dark) or not len(bright):
            return 0.0
        return float(len(dark) * len(bright) * (dark.mean() - bright.mean()) ** 2)

    edges = np.arange(1, 20) / 20
    assert between(cut) == pytest.approx(max(between(edge) for edge in edges), rel=1e-6)


def test_of_two_modes_the_rarer_is_suggested(tmp_path: Path) -> None:
    pixels = np.full((100, 100), 40, np.uint8)
    pixels[:30] = 200
    bright = summarize(opened(tmp_path / "a b.tif", pixels))
    dark = summarize(opened(tmp_path / "dark.tif", 255 - pixels))
    assert bright.interval == "0.47,1"
    assert dark.interval == "0,0.53"


def test_of_one_mode_the_rarer_of_dark_and_bright_is_suggested(tmp_path: Path) -> None:
    pixels = np.clip(DICE.exponential(40, (100, 100)), 0, 255).astype(np.uint8)
    found = summarize(opened(tmp_path / "a.tif", pixels))
    assert found.interval == f"{found.cut:g},1"
    assert summarize(opened(tmp_path / "dark.tif", 255 - pixels)).interval == f"0,{1 - found.cut:g}"


@given(st.floats(0, 1), st.integers(1, 60))
def test_a_bar_is_as_long_as_its_share(share: float, width: int) -> None:
    eighths = sum(_EIGHTHS.index(letter) for letter in text_bar(share, width))
    assert abs(eighths - 8 * share * width) <= 0.5


def test_a_raster_without_valid_pixels_has_a_summary(tmp_path: Path) -> None:
    found = summarize(opened(tmp_path / "a.tif", np.zeros((20, 20), np.uint16), nodata=0))
    assert found.valid == 0 and found.nodata_share == 1
    assert json.loads(json.dumps(found.as_dict(), allow_nan=False))["mean"] is None
    text = summary_text(found)
    assert "there is no valid pixel\n" in text and "0.95-1.00" not in text
    assert "no valid pixel among those looked at" in summary_text(replace(found, exact=False))
    [raster] = found.paths
    assert info(open_to_describe(raster), named=[raster]).command == ""


def test_a_nodata_value_of_infinity_is_no_number_of_json(tmp_path: Path) -> None:
    pixels = np.full((20, 20), 0.5, np.float32)
    pixels[0] = -np.inf
    found = summarize(opened(tmp_path / "a.tif", pixels, nodata=-np.inf))
    assert json.loads(json.dumps(found.as_dict(), allow_nan=False))["bands"][0]["nodata"] is None
    assert found.valid == 19 * 20


def test_many_rasters_are_one_mosaic(tmp_path: Path) -> None:
    opened(tmp_path / "a.tif", np.full((20, 30), 51, np.uint8))
    opened(
        tmp_path / "b.tif", np.full((20, 30), 153, np.uint8), transform=NORTH_UP * Affine.translation(30, 0)
    )
    found = summarize(Dataset.open([tmp_path / "a.tif", tmp_path / "b.tif"]))
    assert (found.rows, found.cols, found.mean) == (20, 60, pytest.approx(0.4))
    assert "1 more" in summary_text(found)
