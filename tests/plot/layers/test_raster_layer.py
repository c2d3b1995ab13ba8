"""Raster layer: grey where valid, coarse reads only."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from PIL import Image

from tests.plot.pictures import write
from uavseg.plot.preview import preview
from uavseg.raster.dataset import Dataset


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
    asked = []
    whole = Dataset.read_coarse

    def spy(self: Dataset, max_side: int) -> Any:
        asked.append(max_side)
        return whole(self, max_side)

    def refuse(*_: Any) -> Any:
        raise AssertionError("a full window was read")

    monkeypatch.setattr(Dataset, "read_coarse", spy)
    monkeypatch.setattr(Dataset, "read", refuse)
    preview(raster, tmp_path / "a.png", width_px=300)
    assert len(asked) == 1 and asked[0] < 1000
