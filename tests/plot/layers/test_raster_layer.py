"""Raster layer: grey where valid, coarse reads only."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from PIL import Image

from tests.plot.pictures import write
from uavseg.plot.layers.raster_layers import mean_of_four
from uavseg.plot.preview import preview
from uavseg.raster.read.dataset import Dataset


def test_a_south_up_raster_looks_like_the_same_ground_north_up(tmp_path: Path) -> None:
    pixels = np.zeros((80, 120), np.uint8)
    pixels[:30, :50] = 250
    flipped = Affine(1, 0, 380_000, 0, 1, 4_897_000 - 80)
    north = preview(write(tmp_path / "a.tif", pixels), tmp_path / "a.png", width_px=400)
    south = preview(write(tmp_path / "b.tif", pixels[::-1], flipped), tmp_path / "b.png", width_px=400)
    body = [np.asarray(Image.open(p).convert("L")).astype(int)[70:-30] for p in (north, south)]
    assert np.abs(body[0] - body[1]).mean() < 1


def test_invalid_pixels_are_hatched_paper_and_the_rest_is_grey(tmp_path: Path) -> None:
    pixels = np.full((100, 100), 60, np.uint8)
    pixels[:, :50] = 0
    raster = write(tmp_path / "a.tif", pixels, nodata=0)
    grey = np.asarray(Image.open(preview(raster, tmp_path / "a.png", width_px=400)).convert("L"))
    middle = grey[len(grey) // 2]
    assert (middle[60:180] > 190).all() and (np.abs(middle[230:350].astype(int) - 60) <= 2).all()


def test_a_large_raster_is_never_read_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    raster = write(tmp_path / "a.tif", np.zeros((3000, 2000), np.uint8), tiled=True, compress="deflate")
    requested = []
    whole = Dataset.read_coarse

    def spy(self: Dataset, max_side: int) -> Any:
        requested.append(max_side)
        return whole(self, max_side)

    def refuse(*_: Any) -> Any:
        raise AssertionError("a full window was read")

    monkeypatch.setattr(Dataset, "read_coarse", spy)
    monkeypatch.setattr(Dataset, "read", refuse)
    preview(raster, tmp_path / "a.png", width_px=300)
    assert len(requested) == 1 and requested[0] < 1000


def test_memory_follows_the_picture_and_not_the_raster(tmp_path: Path) -> None:
    raster = write(
        tmp_path / "a.tif", np.arange(2000, dtype=np.uint8)[:, None] + np.zeros((1, 2000), np.uint8)
    )
    preview(raster, tmp_path / "a.png", width_px=400)  # modules are loaded
    tracemalloc.start()
    preview(raster, tmp_path / "b.png", width_px=400)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100 * 400**2


@pytest.mark.parametrize("shape", [(6, 8), (5, 7), (1, 1)])
def test_four_pixels_become_the_mean_of_those_that_are_there(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    picture, there = rng.integers(0, 256, (*shape, 4)).astype(np.uint8), rng.random(shape) < 0.5
    picture[..., 3] = np.where(there, 255, 0)
    mean = mean_of_four(picture)
    assert mean.shape == (-(-shape[0] // 2), -(-shape[1] // 2), 4)
    for row, col in np.ndindex(mean.shape[:2]):
        four = np.s_[2 * row : 2 * row + 2, 2 * col : 2 * col + 2]
        assert mean[row, col, 3] == 255 * there[four].sum() // 4
        for band in range(3):
            here = picture[four][there[four], band]
            assert not there[four].any() or mean[row, col, band] == here.mean() // 1


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_three_bands_are_drawn_in_their_colours(tmp_path: Path, dtype: type) -> None:
    colours = np.array([[230, 20, 40], [30, 210, 60], [10, 40, 220], [128, 128, 128]], np.uint8)
    planes = np.repeat(np.repeat(colours.T.reshape(3, 2, 2), 40, axis=1), 40, axis=2)
    scaled = {
        np.uint8: planes,
        np.uint16: planes.astype(np.uint16) * 257,
        np.float32: planes / np.float32(255),
    }
    raster = write(tmp_path / "a.tif", scaled[dtype].astype(dtype))
    stretch = {np.uint8: "auto", np.uint16: "dtype", np.float32: "0,1"}[dtype]
    drawn = np.asarray(
        Image.open(preview(raster, tmp_path / "a.png", width_px=400, stretch=stretch)).convert("RGB")
    )
    for colour in colours:
        alike = (np.abs(drawn.astype(int) - colour) <= 1).all(axis=-1).mean()
        assert 0.02 < alike < 0.6


def test_one_band_and_a_formula_are_drawn_in_grey(tmp_path: Path) -> None:
    ramp = np.linspace(0, 255, 80).astype(np.uint8)
    colours = write(
        tmp_path / "a.tif",
        np.stack([np.tile(ramp, (80, 1)), np.tile(ramp[:, None], (1, 80)), np.full((80, 80), 9, np.uint8)]),
    )
    drawn = np.asarray(
        Image.open(preview(Dataset.open(colours, band=1), tmp_path / "a.png", width_px=400)).convert("RGB")
    )
    inner = drawn[120:200, 150:250].astype(int)
    assert np.ptp(inner, axis=-1).max() <= 2 and np.ptp(inner) > 20


def test_the_ground_lies_in_its_place_however_fine_the_raster_is(tmp_path: Path) -> None:
    bodies = []
    for side in (300, 900):  # drawn as it is, and four pixels as one
        pixels = np.full((side, side), 40, np.uint8)
        pixels[side // 3 : side // 2, side // 6 : side // 3] = 220
        place = Affine(900 / side, 0, 380_000, 0, -900 / side, 4_897_000)
        drawn = preview(
            write(tmp_path / f"{side}.tif", pixels, place), tmp_path / f"{side}.png", width_px=400
        )
        bodies.append(np.asarray(Image.open(drawn).convert("L")).astype(int)[70:-40] > 130)
    assert (bodies[0] != bodies[1]).mean() < 0.01
