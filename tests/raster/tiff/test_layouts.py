"""TIFFs of any layout of blocks: their pixels are those that were written, and no block counts as damaged."""

import itertools
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil

from uavseg.errors import RasterReadError
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.bad_blocks import BadBlock, recording_bad_blocks
from uavseg.raster.read.dataset import Dataset

# Block (rows, cols), or the rows of a strip; the sides of a raster are around multiples of them.
BLOCKS: dict[str, tuple[int, int] | int | None] = {
    "square tiles": (32, 32),
    "wide tiles": (16, 64),
    "tall tiles": (64, 16),
    "strips": 24,
    "one strip": None,
}
COMPRESSIONS: list[dict[str, Any]] = [
    {},
    {"compress": "deflate"},
    {"compress": "deflate", "predictor": 2},
    {"compress": "lzw", "predictor": 2},
    {"compress": "zstd"},
    {"compress": "jpeg"},
]


def sides(block: int) -> list[int]:
    return [block, 2 * block, 2 * block + 5, 3 * block - 1]


def drawn(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(1, 255, shape, np.uint8)


def read(path: Path, skip_bad_tiles: bool) -> tuple[np.ndarray, np.ndarray]:
    """Pixels and which are valid; no block may be bad."""
    found: set[BadBlock] = set()
    with recording_bad_blocks(found):
        dataset = Dataset.open(path, skip_bad_tiles=skip_bad_tiles)
        values, valid = dataset.read(Window(0, 0, *dataset.geobox.shape))
    assert not found
    return values, np.ones(dataset.geobox.shape, bool) if valid is None else valid


@pytest.mark.parametrize(
    "number", range(len(COMPRESSIONS)), ids=lambda n: " ".join(map(str, COMPRESSIONS[n].values()))
)
@pytest.mark.parametrize("blocks", BLOCKS)
def test_pixels_and_mask_of_any_layout(write_raster: Callable[..., Path], blocks: str, number: int) -> None:
    compression = COMPRESSIONS[number]
    match BLOCKS[blocks]:
        case (rows, cols):
            how: dict[str, Any] = {"tiled": True, "blockxsize": cols, "blockysize": rows}
        case strip:
            rows, cols, how = 24, 40, {"blockysize": strip}
    cases = itertools.product(sides(rows), (cols, cols + 7), ("pixel", "band"), (False, True))
    for height, width, interleave, masked in itertools.islice(cases, number % 5, None, 5):
        pixels = drawn((3, height, width))
        mask = np.random.default_rng(1).random((height, width)) < 0.7 if masked else None
        options = {"blockysize": height} if how == {"blockysize": None} else how
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True):
            path = write_raster(pixels, mask=mask, interleave=interleave, **options, **compression)
        if masked:
            with rasterio.open(path, "r+") as file:
                file.build_overviews([2])
        with rasterio.open(path) as file:
            stored = file.read()
        assert compression.get("compress") == "jpeg" or np.array_equal(stored, pixels)
        for skip_bad_tiles in (False, True):
            values, valid = read(path, skip_bad_tiles)
            assert np.array_equal(valid, np.ones((height, width), bool) if mask is None else mask)
            assert np.array_equal(values[:, valid], stored[:, valid]), (height, width, interleave)


@pytest.mark.parametrize("shape", [(60, 128), (200, 128), (300, 256)])
@pytest.mark.parametrize("compress", ["deflate", "lzw", "jpeg"])
def test_a_cloud_optimized_file_whose_tile_is_as_wide_as_itself(
    write_raster: Callable[..., Path], tmp_path: Path, shape: tuple[int, int], compress: str
) -> None:
    pixels = drawn((3, *shape))
    plain = write_raster(pixels, nodata=None)
    with warnings.catch_warnings(action="ignore"):
        rasterio.shutil.copy(plain, tmp_path / "cog.tif", driver="COG", compress=compress, blocksize=128)
    values, valid = read(tmp_path / "cog.tif", skip_bad_tiles=False)
    assert valid.all()
    assert compress == "jpeg" or np.array_equal(values, pixels)


@pytest.mark.parametrize("compress", ["deflate", "lzw", "packbits"])
def test_a_raster_of_many_rows_in_one_strip(write_raster: Callable[..., Path], compress: str) -> None:
    # GDAL shows such a strip as blocks of one row.
    pixels = drawn((2100, 12))
    path = write_raster(pixels, blockysize=2100, compress=compress)
    values, valid = read(path, skip_bad_tiles=False)
    assert valid.all() and np.array_equal(values[0], pixels)


def test_a_block_is_bad_too_where_a_tile_is_as_wide_as_the_raster(write_raster: Callable[..., Path]) -> None:
    pixels = np.full((100, 64), 7, np.uint8)
    path = write_raster(pixels, tiled=True, blockxsize=64, blockysize=64, compress="deflate", zlevel=1)
    with rasterio.open(path) as file:
        offset, size = (int(file.get_tag_item("BLOCK_OFFSET_0_1", "TIFF", bidx=1)), file.block_size(1, 1, 0))
    stream = zlib.compress(bytes(36 * 64), 9)  # the rows of the raster, where a tile has 64
    assert len(stream) <= size
    data = bytearray(path.read_bytes())
    data[offset : offset + len(stream)] = stream
    path.write_bytes(data)
    with pytest.raises(RasterReadError, match="rows 64 to 100"):
        read(path, skip_bad_tiles=False)
