"""JPEG blocks whose image is smaller than the block: no memory of the process becomes pixels."""

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

SIDE = 64
PIXELS = np.random.default_rng(0).integers(1, 255, (2 * SIDE, 2 * SIDE), np.uint8)
TILED = {"tiled": True, "blockxsize": SIDE, "blockysize": SIDE, "compress": "jpeg"}
WHOLE = Window(0, 0, 2 * SIDE, 2 * SIDE)


def with_size(path: Path, rows: int, cols: int) -> Path:
    """Write another size into the frame header of the second block."""
    with rasterio.open(path) as file:
        start = int(file.get_tag_item("BLOCK_OFFSET_1_0", "TIFF", bidx=1))
    data = bytearray(path.read_bytes())
    frame = data.index(b"\xff\xc0", start)
    data[frame + 5 : frame + 9] = rows.to_bytes(2, "big") + cols.to_bytes(2, "big")
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(("rows", "cols"), [(SIDE - 1, SIDE), (SIDE, SIDE - 8), (8, 8), (0, SIDE)])
def test_an_image_that_is_smaller_than_its_block_makes_it_bad(
    write_raster: Callable[..., Path], rows: int, cols: int
) -> None:
    path = with_size(write_raster(PIXELS, **TILED), rows, cols)
    with pytest.raises(RasterReadError, match=r"rows 0 to 64, columns 64 to 128"):
        Dataset.open(path).read(WHOLE)
    with recording_bad_blocks(found := set()):
        _, valid = Dataset.open(path, skip_bad_tiles=True).read(WHOLE)
    assert found == {BadBlock(str(path), 0, SIDE, SIDE, SIDE)} and valid is not None
    assert not valid[:SIDE, SIDE:].any() and valid[SIDE:].all() and valid[:, :SIDE].all()


@pytest.mark.parametrize("how", [TILED, {"compress": "jpeg", "blockysize": 32}], ids=["tiles", "strips"])
@pytest.mark.parametrize(
    "layout",
    [{"interleave": "pixel", "photometric": "ycbcr"}, {"interleave": "pixel"}, {"interleave": "band"}],
)
def test_blocks_of_any_layout_are_right(
    write_raster: Callable[..., Path], how: dict[str, Any], layout: dict[str, Any]
) -> None:
    pixels = np.random.default_rng(1).integers(0, 200, (3, 150, 170)).astype(np.uint8)
    path = write_raster(pixels, **how, **layout, colors="red green blue")
    for window in (Window(0, 0, 150, 170), Window(10, 70, 60, 60), Window(128, 128, 22, 42)):
        values, valid = Dataset.open(path).read(window)
        with rasterio.open(path) as file:
            rows, cols = (
                slice(window.row, window.row + window.rows),
                slice(window.col, window.col + window.cols),
            )
            expected = file.read()[:, rows, cols]
        assert np.array_equal(values, expected) and (valid is None or valid.all())


def second_block(path: Path) -> tuple[bytearray, int]:
    """The content of a file, and where its second block begins."""
    with rasterio.open(path) as file:
        return bytearray(path.read_bytes()), int(file.get_tag_item("BLOCK_OFFSET_1_0", "TIFF", bidx=1))


@pytest.mark.parametrize(
    ("own_tables", "damage", "message"),
    [
        (True, "marker", "the JPEG header of the block at 0, 1 is damaged"),  # libjpeg skips what it is
        (True, "table", "Huffman table"),
        (False, "marker", "missing SOS marker"),
        (False, "table", "Huffman table"),
    ],
)
def test_a_block_that_needs_the_tables_of_another_is_bad(
    write_raster: Callable[..., Path], own_tables: bool, damage: str, message: str
) -> None:
    """Its pixels would depend on which block was read before it."""
    how = TILED | {"jpegtablesmode": 0 if own_tables else 3}
    path = write_raster(PIXELS, **how)
    data, start = second_block(path)
    if damage == "marker" and own_tables:
        data[data.index(b"\xff\xc4", start)] = 0x7F
    elif damage == "marker":
        data[data.index(b"\xff\xda", start)] = 0x7F
    else:  # the number of a table of the only component
        scan = data.index(b"\xff\xda", start)
        data[scan + 6] = 0x32
    path.write_bytes(data)
    with pytest.raises(RasterReadError, match=rf"columns 64 to 128 \(.*{message}"):
        Dataset.open(path).read(WHOLE)
    _, valid = Dataset.open(path, skip_bad_tiles=True).read(WHOLE)
    assert valid is not None and not valid[:SIDE, SIDE:].any() and valid[SIDE:].all()


@pytest.mark.parametrize("mode", range(4))
def test_tables_may_be_in_blocks_or_in_the_file(write_raster: Callable[..., Path], mode: int) -> None:
    path = write_raster(PIXELS, **TILED, jpegtablesmode=mode)
    values, _ = Dataset.open(path).read(WHOLE)
    with rasterio.open(path) as file:
        assert (values[0] == file.read(1)).all()
