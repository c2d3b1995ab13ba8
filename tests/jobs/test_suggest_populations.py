"""Ranges that are suggested find rows, grids and small things, and show the share that extracting gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from click.testing import CliRunner
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import uavseg
from uavseg.cli import main
from uavseg.jobs.source.open_source import open_source
from uavseg.jobs.suggest import suggest
from uavseg.plot.suggestions import draw_suggestions, range_colors
from uavseg.raster.read.dataset import Dataset

SIDE = 192
ROW, COL = np.indices((SIDE, SIDE))


def rows(width: int, period: int, angle: float) -> np.ndarray:
    turned = COL * np.cos(np.deg2rad(angle)) + ROW * np.sin(np.deg2rad(angle))
    return np.asarray(turned % period < width)


def squares(side: int, period: int) -> np.ndarray:
    return np.asarray((ROW % period < side) & (COL % period < side))


PATTERNS = {
    "rows": rows(4, 8, 0),
    "slanted rows": rows(3, 8, 17),
    "dense rows": rows(3, 5, 45),
    "sparse rows": rows(5, 40, 71),
    "a grid": squares(4, 8),
    "lone squares": squares(6, 48),
    "a checker": np.asarray((ROW // 6 + COL // 6) % 2 == 0),
    "a half": np.asarray(COL >= SIDE // 2),
}


def drawn(
    mask: np.ndarray, noise: float, step: float = 120, low: float = 64, kind: str = "uint8"
) -> np.ndarray:
    """Two materials with noise; the other kinds hold other values of the same picture."""
    image = low + step * mask + np.random.default_rng(1).normal(0, noise, mask.shape)
    if kind == "uint8":
        return np.asarray(np.clip(np.rint(image), 1, 255).astype(kind))
    return np.asarray((40 * image + 5000 if kind == "uint16" else image / 100 - 2).astype(kind))


def written(folder: Path, image: np.ndarray, nodata: float | None = None) -> str:
    path = folder / "a.tif"
    place = {"crs": "EPSG:32618", "transform": Affine(0.25, 0, 4e5, 0, -0.25, 5e6), "nodata": nodata}
    with rasterio.open(path, "w", "GTiff", *image.shape[::-1], 1, dtype=image.dtype.name, **place) as file:
        file.write(image, 1)
    return str(path)


def check(path: str, truths: list[np.ndarray], valid: np.ndarray | None = None, **how: Any) -> None:
    """Shares are those of extracting; each material is a range, the first is one, and `info` agrees."""
    with rasterio.open(path) as file:
        image = file.read(1)
    valid = np.ones(image.shape, bool) if valid is None else valid
    overlaps = []
    ranges = uavseg.suggest(path, **how)
    for one in ranges:
        regions = uavseg.extract(path, one.range, **how)
        assert (one.regions, one.pixels) == (len(regions), regions["pixels"].sum())
        low, high = (
            end if value is None else value
            for end, value in ((-np.inf, one.value_low), (np.inf, one.value_high))
        )
        inside = (image >= low) & (image <= high) & valid
        assert one.share == pytest.approx(one.pixels / valid.sum())
        assert one.share == pytest.approx(inside.sum() / valid.sum(), abs=0.01)
        found = [(inside & truth).sum() / (inside | truth & valid).sum() for truth in truths]
        overlaps.append(found)
    assert (np.max(overlaps, axis=0) >= 0.9).all() and max(overlaps[0]) >= 0.9
    assert uavseg.info(path, **how).interval in map(str, ranges)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [2, 17])
@pytest.mark.parametrize("name", PATTERNS)
def test_both_materials_are_suggested_whatever_their_pattern(tmp_path: Path, name: str, noise: float) -> None:
    mask = PATTERNS[name]
    check(written(tmp_path, drawn(mask, noise)), [mask, ~mask])
    check(written(tmp_path, drawn(mask, noise, -120, 190)), [mask, ~mask])


@pytest.mark.parametrize("kind", ["uint16", "float32"])
@pytest.mark.parametrize("name", ["rows", "lone squares"])
def test_other_types_and_nodata(tmp_path: Path, name: str, kind: str) -> None:
    mask, valid = PATTERNS[name], np.hypot(ROW - 90, COL - 60) > 40
    image = np.where(valid, drawn(mask, 7, kind=kind), drawn(mask, 7, kind=kind).dtype.type(0))
    assert (image[valid] != 0).all()
    check(written(tmp_path, image, nodata=0), [mask, ~mask], valid, stretch="minmax")


@pytest.mark.slow
@pytest.mark.parametrize("noise", [2, 10])
def test_three_materials(tmp_path: Path, noise: float) -> None:
    """Two grounds, and rows or squares on both of them."""
    left = COL < 80
    for name in ("slanted rows", "lone squares"):
        mask = PATTERNS[name]
        image = drawn(mask, noise, 150, 40) + (60 * (left & ~mask)).astype(np.uint8)
        check(written(tmp_path, image), [mask, left & ~mask, ~left & ~mask])


def test_a_vineyard(tmp_path: Path) -> None:
    """Ground of 60 to 67, bars of 180 to 187 that are 4 pixels wide every 8: half of the pixels."""
    rng = np.random.default_rng(0)
    bars = np.indices((512, 512))[1] % 8 < 4
    image = np.where(bars, rng.integers(180, 188, bars.shape), rng.integers(60, 68, bars.shape))
    path = written(tmp_path, image.astype(np.uint8))
    first = uavseg.suggest(path)[0]
    assert str(first) == uavseg.info(path).interval and first.high == 1
    assert first.share == 0.5 and uavseg.extract(path, first.range)["pixels"].sum() == bars.sum()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rows", "lone squares"])
def test_tiles_threads_and_a_block_map_beside_its_raster_change_nothing(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, drawn(PATTERNS[name], 7))
    wanted = uavseg.suggest(path)
    assert uavseg.suggest(path, tile=64, threads=2) == wanted == uavseg.suggest(path, tile=128, threads=1)
    done = CliRunner().invoke(main, ["divide", path, "-o", str(tmp_path / "blocks.tif")])
    assert done.exit_code == 0, done.output
    assert uavseg.suggest(tmp_path / "blocks.tif") == wanted


def test_two_grounds_that_only_means_part_stay_two_ranges_beside_small_things(tmp_path: Path) -> None:
    """Noise hides their difference from pixels; the things are too small for the means of cells."""
    mask, left = squares(3, 24), COL < 96
    image = drawn(mask, 10, 150, 60) + (20 * (left & ~mask)).astype(np.uint8)
    ranges = sorted(one.range for one in uavseg.suggest(written(tmp_path, image)))
    assert len(ranges) == 3 and ranges[0][1] * 255 == pytest.approx(70, abs=4)
    assert 120 < ranges[2][0] * 255 < 190


@pytest.mark.slow
def test_pictures_show_the_rows(tmp_path: Path) -> None:
    """Cells of 8 x 8 pixels would show one colour."""
    path = written(tmp_path, drawn(PATTERNS["rows"], 2))
    picture = imread(draw_suggestions(suggest(open_source(path)), tmp_path / "look.png", Dataset.open(path)))
    half = picture[:, : picture.shape[1] // 2, :3]
    shares = [
        (np.abs(half - (0.42 * np.array(to_rgb(color)) + 0.58 * v)).max(axis=-1) < 0.03).mean()
        for color, v in zip(range_colors(2), (64 / 255, 184 / 255), strict=True)
    ]
    assert min(shares) > 0.3
