"""Damaged blocks of masks, in the file and beside it: what the memory held does not decide what is valid."""

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio

from uavseg.errors import RasterReadError
from uavseg.raster.access.opening import quiet_open
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.bad_blocks import BadBlock, recording_bad_blocks
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.tiff import damaged_blocks

SIDE = 64
SHAPE = 2 * SIDE, 2 * SIDE + 10
PIXELS = np.random.default_rng(0).integers(1, 255, SHAPE, np.uint8)
VALID = np.random.default_rng(1).random(SHAPE) < 0.6
WHOLE = Window(0, 0, *SHAPE)
LAYOUTS: dict[str, dict[str, Any]] = {
    "tiles": {"tiled": True, "blockxsize": SIDE, "blockysize": SIDE, "compress": "deflate"},
    "strips": {"blockysize": SIDE, "compress": "deflate"},
}


def masked(path: Path, place: str) -> tuple[str, Path]:
    """Give a raster a mask; its name as a raster of its own, and the file that holds it."""
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=place == "in the file"), rasterio.open(path, "r+") as file:
        file.write_mask(VALID)
    beside = Path(f"{path}.msk")
    assert beside.exists() == (place == "beside it")
    return (str(beside), beside) if beside.exists() else (f"GTIFF_DIR:2:{path}", path)


def damage(name: str, path: Path, surplus: int = 1) -> None:
    """Let the stream of the first block of a mask go on beyond the block."""
    with quiet_open(name) as mask:
        offset = int(mask.get_tag_item("BLOCK_OFFSET_0_0", "TIFF", bidx=1))
        rows, cols = mask.block_shapes[0]
        bits = int(mask.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", 8))
        stream = zlib.compress(bytes(rows * -(-cols * bits // 8) + surplus), 9)
        assert len(stream) <= mask.block_size(1, 0, 0)
    data = bytearray(path.read_bytes())
    data[offset : offset + len(stream)] = stream
    path.write_bytes(data)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("place", ["in the file", "beside it"])
def test_pixels_are_valid_as_the_mask_says(
    write_raster: Callable[..., Path], place: str, layout: str
) -> None:
    path = write_raster(PIXELS, **LAYOUTS[layout])
    masked(path, place)
    values, valid = Dataset.open(path).read(WHOLE)
    assert np.array_equal(values[0], PIXELS) and np.array_equal(valid, VALID)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("place", ["in the file", "beside it"])
def test_a_stream_that_goes_on_beyond_its_block_makes_the_pixels_bad(
    write_raster: Callable[..., Path], place: str, layout: str
) -> None:
    path = write_raster(PIXELS, **LAYOUTS[layout])
    damage(*masked(path, place))
    with pytest.raises(RasterReadError, match=r"rows 0 to 64, .* goes on beyond its end"):
        Dataset.open(path).read(WHOLE)
    with recording_bad_blocks(found := set()):
        _, valid = Dataset.open(path, skip_bad_tiles=True).read(WHOLE)
    assert (
        valid is not None
        and BadBlock(str(path), 0, 0, SIDE, SIDE if layout == "tiles" else SHAPE[1]) in found
    )
    for block in found:
        assert not valid[block.row : block.row + block.rows, block.col : block.col + block.cols].any()
    assert np.array_equal(valid[SIDE:], VALID[SIDE:])


def test_blocks_of_mask_and_raster_are_compared_once_each(
    write_raster: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    of = damaged_blocks.BlockStream.of

    def note(path: Path, source: Any, band: int, place: tuple[int, int]) -> Any:
        seen.append(source.name)
        return of(path, source, band, place)

    path = write_raster(PIXELS, **LAYOUTS["tiles"])
    name, _ = masked(path, "in the file")
    monkeypatch.setattr(damaged_blocks.BlockStream, "of", note)
    dataset = Dataset.open(path)
    for _ in range(2):
        dataset.read(WHOLE)
    assert sorted(seen) == sorted([str(path)] * 6 + [name] * 6)


def test_a_page_named_by_its_number_is_compared_too(write_raster: Callable[..., Path]) -> None:
    path = write_raster(PIXELS, **LAYOUTS["tiles"])
    name, _ = masked(path, "in the file")
    damage(str(path), path)
    with pytest.raises(RasterReadError, match="goes on beyond its end"):
        Dataset.open(f"GTIFF_DIR:1:{path}").read(WHOLE)
    assert Dataset.open(name).read(WHOLE)[0].max() == 1
