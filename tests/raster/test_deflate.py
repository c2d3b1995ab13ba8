"""Deflate blocks whose stream goes beyond the block: no memory of the process becomes pixels."""

import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio

from uavseg.raster.dataset import Dataset
from uavseg.raster.tiling import Window

SIDE = 64
PIXELS = np.random.default_rng(0).integers(1, 255, (2 * SIDE, 2 * SIDE), np.uint8)
TILED = {"tiled": True, "blockxsize": SIDE, "blockysize": SIDE, "compress": "deflate"}
STORED = b"\x01" + struct.pack("<HH", 65535, 0)  # the head of a block of 65535 bytes as they are
TEXT = bytes(range(1, 201)) * 18
STREAMS = {
    "at once": (b"\x78\x9c" + STORED + TEXT, TEXT),
    "after some pixels": (
        (packed := zlib.compressobj(9)).compress(b"\7" * 100) + packed.flush(zlib.Z_FULL_FLUSH) + STORED + TEXT,
        b"\7" * 100 + TEXT,
    ),
}
READ = """
import sys
from uavseg.raster.dataset import Dataset
from uavseg.raster.tiling import Window
print(Dataset.open(sys.argv[1]).read(Window(0, 0, 128, 128))[0].tobytes().hex())
"""


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
def test_pixels_are_those_of_the_stream(write_raster: Callable[..., Path], case: str) -> None:
    stream, pixels = STREAMS[case]
    path = with_stream(write_raster(PIXELS, **TILED), stream)
    values, _ = Dataset.open(path).read(Window(0, 0, 2 * SIDE, 2 * SIDE))
    assert values[0, :SIDE, :SIDE].tobytes()[: len(pixels)] == pixels
    assert np.array_equal(values[0, SIDE:], PIXELS[SIDE:])


@pytest.mark.skipif(sys.platform != "linux", reason="the variable is one of glibc")
@pytest.mark.parametrize("case", STREAMS)
def test_what_memory_held_before_changes_nothing(write_raster: Callable[..., Path], case: str) -> None:
    path = with_stream(write_raster(PIXELS, **TILED), STREAMS[case][0])
    found = {
        subprocess.run(
            [sys.executable, "-c", READ, str(path)],
            env=os.environ | {"MALLOC_PERTURB_": str(byte)},
            capture_output=True,
            check=True,
        ).stdout
        for byte in (1, 77)
    }
    assert len(found) == 1
    assert found.pop().strip()
