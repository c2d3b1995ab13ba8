"""Blocks that a sparse TIFF does not store have one value, which is known without decoding."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings, strategies as st
from rasterio.windows import Window as FileWindow

from uavseg.errors import RasterError, RasterReadError
from uavseg.raster.access.opening import quiet_open
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.tiff.directories import stored_blocks


def write_sparse(path: Path, side: int, stored: list[tuple[int, int]], **how: Any) -> Path:
    """A raster of blocks of 16 x 16, of which only the stored ones hold something."""
    profile = {"driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "uint8", "tiled": True}
    profile |= {"blockxsize": 16, "blockysize": 16, "SPARSE_OK": True} | how
    with warnings.catch_warnings(action="ignore"), rasterio.open(path, "w", **profile) as file:
        for i, j in stored:
            values = np.arange(1, 257).reshape(16, 16) % 251 + i
            pixels = np.broadcast_to(values, (profile["count"], 16, 16)).astype(profile["dtype"])
            file.write(pixels, window=FileWindow(16 * j, 16 * i, 16, 16))
    return path


def plain_read(path: Path, shape: tuple[int, int]) -> np.ndarray:
    with quiet_open(path) as file:
        return file.read(out_shape=(file.count, *shape))


blocks = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), max_size=6, unique=True)


@pytest.mark.slow
@settings(max_examples=60)
@given(
    blocks, st.sampled_from(["uint8", "int16", "float32"]), st.sampled_from([None, 0, 7]), st.integers(3, 80)
)
def test_pixels_are_those_that_gdal_reads(
    tmp_path_factory: pytest.TempPathFactory,
    stored: list[tuple[int, int]],
    dtype: str,
    nodata: int | None,
    side: int,
) -> None:
    path = write_sparse(tmp_path_factory.mktemp("sparse") / "a.tif", 80, stored, dtype=dtype, nodata=nodata)
    dataset = Dataset.open(path)
    expected = plain_read(path, (80, 80))
    values, valid = dataset.read(Window(0, 0, 80, 80))
    known = np.ones((80, 80), bool) if nodata is None else expected[0] != nodata
    assert np.array_equal(values[0][known], expected[0][known])
    assert np.array_equal(known, np.ones_like(known) if valid is None else valid)
    coarse, seen, _ = dataset.read_coarse(side)
    shape = coarse.shape[1:]
    assert np.array_equal(
        coarse[0] if seen is None else coarse[0][seen],
        plain_read(path, shape)[0][... if seen is None else seen],
    )


@pytest.mark.parametrize("interleave", ["pixel", "band"])
@pytest.mark.parametrize("bigtiff", ["YES", "NO"])
def test_the_index_tells_which_blocks_are_stored(tmp_path: Path, interleave: str, bigtiff: str) -> None:
    stored = [(0, 1), (3, 4), (4, 0)]
    path = write_sparse(tmp_path / "a.tif", 80, stored, count=3, interleave=interleave, bigtiff=bigtiff)
    with quiet_open(path) as file:
        found = stored_blocks(str(path), file)
    assert found is not None and len(found) == (1 if interleave == "pixel" else 3)
    assert [tuple(place) for place in np.argwhere(found[-1]).tolist()] == stored


def test_a_file_without_any_block_has_an_empty_index(tmp_path: Path) -> None:
    path = write_sparse(tmp_path / "a.tif", 80, [])
    with quiet_open(path) as file:
        found = stored_blocks(str(path), file)
    assert found is not None and not found.any()


def test_a_truncated_index_is_an_error_and_not_taken_for_a_sparse_file(tmp_path: Path) -> None:
    path = write_sparse(tmp_path / "a.tif", 800, [(0, 0)])
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 8])
    with pytest.raises(RasterReadError):
        dataset = Dataset.open(path)
        dataset.read(Window(0, 0, 800, 800))


@pytest.mark.parametrize("stored", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_huge_sparse_raster_is_seen_from_afar(tmp_path: Path, stored: bool) -> None:
    side, block = 1_000_000, 16384
    how = {"driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "uint8", "tiled": True}
    how |= {"blockxsize": block, "blockysize": block, "SPARSE_OK": True, "compress": "deflate", "nodata": 0}
    with warnings.catch_warnings(action="ignore"), rasterio.open(tmp_path / "a.tif", "w", **how) as file:
        if stored:
            file.write(np.full((1, 16384, 256), 9, np.uint8), window=FileWindow(0, 0, 256, 16384))
    dataset = Dataset.open(tmp_path / "a.tif")
    _, valid, _ = dataset.read_coarse(4096)
    assert valid is not None and valid.sum() == (67 if stored else 0)
    assert dataset.is_empty(Window(500_000, 500_000, 2048, 2048))


def test_a_block_larger_than_the_file_can_hold_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    how = {
        "driver": "GTiff",
        "width": 60_000,
        "height": 60_000,
        "count": 1,
        "dtype": "uint8",
        "compress": "zstd",
    }
    with warnings.catch_warnings(action="ignore"):
        with rasterio.open(tmp_path / "a.tif", "w", **how, blockysize=60_000, SPARSE_OK=True):
            pass
        assert Dataset.open(tmp_path / "a.tif").geobox.shape == (60_000, 60_000)  # nothing is stored
        with rasterio.open(tmp_path / "b.tif", "w", **{**how, "count": 5000, "width": 4, "height": 4}):
            pass
    with pytest.raises(RasterError, match="5,000 bands, and at most 4,096"):
        Dataset.open(tmp_path / "b.tif")
    damaged = bytearray(write_sparse(tmp_path / "c.tif", 160, [(0, 0)], compress="deflate").read_bytes())
    at = damaged.find(b"\x42\x01\x03\x00\x01\x00\x00\x00\x10\x00")  # TileWidth, 16
    damaged[at + 8 : at + 10] = damaged[at + 20 : at + 22] = b"\xf0\xff"
    (tmp_path / "c.tif").write_bytes(damaged)
    with pytest.raises(RasterError, match="blocks of 65,520 x 65,520 pixels"):
        Dataset.open(tmp_path / "c.tif")
