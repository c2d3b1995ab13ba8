"""Thin lines of `extract`: the same for any tiles, whole across them, refused where they do not fit."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray
from rasterio.features import rasterize

import uavseg
from tests.jobs.test_flatten import run, write
from uavseg.errors import ParameterError

DARK = (0, 0.5)


def cracked(seed: int, shape: tuple[int, int] = (200, 230)) -> NDArray[np.uint8]:
    """A dark patch, a dark line of two pixels across the picture, and noise."""
    rng = np.random.default_rng(seed)
    rows, cols = np.indices(shape)
    v = 150 + rng.normal(0, 9, shape)
    v[abs(rows - 0.7 * cols - rng.uniform(0, 40)) < 1.3] -= 40
    v[20:60, 150:200] -= 40
    return np.clip(v, 1, 255).astype(np.uint8)


def mask_of(regions: object, shape: tuple[int, int]) -> NDArray[np.bool_]:
    return np.asarray(rasterize(regions.geometry, shape, dtype="uint8"), bool)  # type: ignore[attr-defined]


@pytest.mark.slow
@given(st.integers(0, 1000), st.sampled_from([64, 128]), st.sampled_from([None, "64px"]))
def test_tiles_and_threads_change_nothing(seed: int, tile: int, flatten: str | None) -> None:
    image = cracked(seed, (150, 170))
    whole = uavseg.extract(image, DARK, thin_lines=True, flatten=flatten)
    parts = uavseg.extract(image, DARK, thin_lines=True, flatten=flatten, tile=tile, threads=2)
    assert parts.equals(whole)


@pytest.mark.parametrize("refine", ["tv", "scan", "smooth"])
def test_a_line_is_added_to_what_was_refined(refine: str) -> None:
    image = cracked(1)
    before = mask_of(uavseg.extract(image, DARK, refine=refine), image.shape)
    after = uavseg.extract(image, DARK, refine=refine, thin_lines=True)
    found = mask_of(after, image.shape)
    assert not (before & ~found).any()
    longest = after.total_bounds
    assert longest[2] - longest[0] > 200
    assert after.geometry.apply(lambda one: one.bounds[2] - one.bounds[0]).max() > 150


@pytest.mark.slow
def test_a_tile_without_cells_in_range_has_its_lines_too() -> None:
    image = np.full((320, 320), 150, np.uint8)
    image[200, 130:310] = 90
    [line] = uavseg.extract(image, DARK, thin_lines=True, tile=64).to_dict("records")
    assert 165 <= line["pixels"] <= 185 and line["mean"] == pytest.approx(90 / 255, abs=0.02)


@pytest.mark.slow
def test_regions_say_it_and_a_block_map_finds_the_same(tmp_path: Path) -> None:
    raster, out = write(tmp_path / "a.tif", cracked(2)), str(tmp_path / "r.geojson")
    run("extract", raster, "--range", "0,0.5", "--thin-lines", "-o", out, "-q")
    assert "thin_lines" in Path(out).read_text()
    blocks = str(tmp_path / "b.tif")
    run("divide", raster, "-o", blocks, "-q")
    columns = ["pixels", "mean", "geometry"]
    direct = uavseg.extract(raster, DARK, thin_lines=True)
    assert uavseg.extract(blocks, DARK, thin_lines=True)[columns].equals(direct[columns])
    Path(raster).unlink()
    with pytest.raises(ParameterError, match="regions from this block map end at block edges"):
        uavseg.extract(blocks, DARK, thin_lines=True)


@pytest.mark.parametrize(
    "words, said",
    [
        ({"detail": "5px"}, "a detail leaves out the lines"),
        ({"refine": "none"}, "these regions end at block edges"),
        ({"range": None, "classes": {"a": (0, 0.5)}}, "for one range, not for classes"),
    ],
)
def test_what_does_not_fit_is_refused(words: dict[str, object], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        uavseg.extract(cracked(0), **({"range": DARK, "thin_lines": True} | words))  # type: ignore[arg-type]
