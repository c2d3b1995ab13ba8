"""Deflate blocks whose stream goes beyond the block: no memory of the process becomes pixels."""

import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from uavseg.errors import RasterReadError
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.bad_blocks import BadBlock, recording_bad_blocks
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.tiff import damaged_blocks

SIDE = 64
PIXELS = np.random.default_rng(0).integers(1, 255, (2 * SIDE, 2 * SIDE), np.uint8)
TILED = {"tiled": True, "blockxsize": SIDE, "blockysize": SIDE, "compress": "deflate"}
STORED = b"\x01" + struct.pack("<HH", 65535, 0)  # the head of a block of 65535 bytes as they are
TEXT = bytes(range(1, 201)) * 18
STREAMS = {
    "at once": b"\x78\x9c" + STORED + TEXT,
    "after some pixels": (packed := zlib.compressobj(9)).compress(b"\7" * 100)
    + packed.flush(zlib.Z_FULL_FLUSH)
    + STORED
    + TEXT,
    "by one byte": zlib.compress(bytes(SIDE * SIDE + 1)),
    "by a whole row": zlib.compress(bytes(SIDE * SIDE + SIDE)),
}
WHOLE = Window(0, 0, 2 * SIDE, 2 * SIDE)


def with_stream(path: Path, stream: bytes) -> Path:
    """Put a stream in the place of that of the first block."""
    with rasterio.open(path) as file:
        offset = int(file.get_tag_item("BLOCK_OFFSET_0_0", "TIFF", bidx=1))
        assert len(stream) <= file.block_size(1, 0, 0)
    data = bytearray(path.read_bytes())
    data[offset : offset + len(stream)] = stream
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("case", STREAMS)
def test_a_stream_that_goes_on_beyond_its_block_makes_it_bad(
    write_raster: Callable[..., Path], case: str
) -> None:
    path = with_stream(write_raster(PIXELS, **TILED), STREAMS[case])
    with pytest.raises(RasterReadError, match=r"rows 0 to 64, columns 0 to 64 \(the stream of the block"):
        Dataset.open(path).read(WHOLE)
    with recording_bad_blocks(found := set()):
        values, valid = Dataset.open(path, skip_bad_tiles=True).read(WHOLE)
    assert found == {BadBlock(str(path), 0, 0, SIDE, SIDE)} and valid is not None
    assert not valid[:SIDE, :SIDE].any() and valid[SIDE:].all() and valid[:, SIDE:].all()
    assert np.array_equal(values[0][valid], PIXELS[valid])


@pytest.mark.parametrize("predictor", [1, 2])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint32", "float32"])
@pytest.mark.parametrize("how", [TILED, {"compress": "deflate", "blockysize": 24}], ids=["tiles", "strips"])
@pytest.mark.parametrize("interleave", ["pixel", "band"])
@pytest.mark.parametrize("endian", ["little", "big"])
def test_blocks_of_any_layout_are_right(
    write_raster: Callable[..., Path],
    predictor: int,
    dtype: str,
    how: dict[str, Any],
    interleave: str,
    endian: str,
) -> None:
    predictor = 3 if dtype == "float32" and predictor == 2 else predictor
    pixels = np.random.default_rng(1).integers(0, 200, (3, 150, 170)).astype(dtype)
    layout = {"predictor": predictor, "interleave": interleave, "endianness": endian}
    path = write_raster(pixels, **how, **layout, colors="red green blue")
    dataset = Dataset.open(path, band=None if dtype == "uint8" else 2)
    for window in (Window(0, 0, 150, 170), Window(10, 70, 60, 60), Window(128, 128, 22, 42)):
        values, valid = dataset.read(window)
        expected = pixels if len(values) == 3 else pixels[1:2]
        assert np.array_equal(values, expected[:, *window.slices]) and valid is None


def test_each_block_is_compared_only_once(
    write_raster: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[int, int]] = []
    of = damaged_blocks.BlockStream.of

    def note(path: str, source: Any, band: int, place: tuple[int, int]) -> Any:
        seen.append(place)
        return of(path, source, band, place)

    monkeypatch.setattr(damaged_blocks.BlockStream, "of", note)
    dataset = Dataset.open(write_raster(PIXELS, **TILED))
    for _ in range(2):
        dataset.read(WHOLE)
        dataset.read(Window(0, 0, 9, 9))
    assert sorted(seen) == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_a_raster_in_an_archive_is_read(write_raster: Callable[..., Path], tmp_path: Path) -> None:
    path = write_raster(PIXELS, **TILED)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(path, "a.tif")
    values, _ = Dataset.open(f"/vsizip/{tmp_path}/a.zip/a.tif").read(WHOLE)
    assert np.array_equal(values[0], PIXELS)
