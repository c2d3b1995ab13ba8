"""Damaged files: an error that names the bad block, or invalid pixels."""

import pickle
import re
import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st

from uavseg.errors import RasterReadError
from uavseg.execution.executors import serial, threads
from uavseg.raster.access.opening import OpenFiles
from uavseg.raster.grid.tiling import Window, tiles
from uavseg.raster.read.bad_blocks import BadBlock, bad_block_warnings, recording_bad_blocks, with_bad_blocks
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.raster_file import RasterFile

ROWS, COLS = 300, 350
PIXELS = np.random.default_rng(0).integers(1, 255, (ROWS, COLS), np.uint8)
TILED = {"tiled": True, "blockxsize": 64, "blockysize": 64, "compress": "deflate"}
BAD = [(0, 1), (2, 3), (4, 5)]  # the last one is clipped by the edges of the raster


def spoil(path: Path, blocks: Iterable[tuple[int, int]], band: int = 1) -> Path:
    """Overwrite bytes of some blocks (row and column of blocks) of a GeoTIFF."""
    with rasterio.open(path) as file:
        places = [
            (int(file.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", "TIFF", bidx=band)), file.block_size(band, i, j))
            for i, j in blocks
        ]
    data = bytearray(path.read_bytes())
    for offset, size in places:
        data[offset + 2 : offset + size] = bytes(size - 2)
    path.write_bytes(data)
    return path


def box(i: int, j: int, side: int = 64) -> tuple[slice, slice]:
    return slice(i * side, min((i + 1) * side, ROWS)), slice(j * side, min((j + 1) * side, COLS))


def without(blocks: Iterable[tuple[int, int]]) -> np.ndarray:
    valid = np.ones((ROWS, COLS), bool)
    for block in blocks:
        valid[box(*block)] = False
    return valid


def bad_blocks(path: Path, blocks: Iterable[tuple[int, int]]) -> list[BadBlock]:
    return [
        BadBlock(str(path), i * 64, j * 64, min(64, ROWS - i * 64), min(64, COLS - j * 64)) for i, j in blocks
    ]


def seen(dataset: Dataset, side: Any, run: Any = serial) -> tuple[np.ndarray, np.ndarray, list[BadBlock]]:
    """All pixels, read tile by tile with a halo; which are valid; and the bad blocks that were recorded."""
    rows, cols = dataset.geobox.shape
    values, valid = np.zeros((rows, cols), dataset.dtype), np.zeros((rows, cols), bool)
    found: set[BadBlock] = set()
    windows = tiles((rows, cols), side)
    for window, (pixels, known) in zip(
        windows, with_bad_blocks(run, found)(dataset.read, windows), strict=True
    ):
        values[window.slices] = pixels[0]
        valid[window.slices] = True if known is None else known
    return values, valid, sorted(found)


SIDES = pytest.mark.parametrize("side", [64, (64, 384), (128, 192), 4096], ids=str)


@SIDES
@pytest.mark.parametrize("run", [serial, threads(3)], ids=["serial", "3 threads"])
def test_exactly_the_bad_blocks_are_invalid(write_raster: Callable, side: Any, run: Any) -> None:
    path = spoil(write_raster(PIXELS, **TILED), BAD)
    values, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side, run)
    assert np.array_equal(valid, without(BAD))
    assert np.array_equal(values[valid], PIXELS[valid])
    assert found == bad_blocks(path, BAD)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.data())
def test_any_window_reads_the_same_pixels(write_raster: Callable, data: Any) -> None:
    path = spoil(write_raster(PIXELS, **TILED), BAD)
    row, col = data.draw(st.integers(0, ROWS - 1)), data.draw(st.integers(0, COLS - 1))
    window = Window(row, col, data.draw(st.integers(1, ROWS - row)), data.draw(st.integers(1, COLS - col)))
    values, valid = Dataset.open(path, skip_bad_tiles=True).read(window)
    known = without(BAD)[window.slices]
    assert (valid is None and known.all()) or np.array_equal(valid, known)
    assert np.array_equal(values[0][known], PIXELS[window.slices][known])


@pytest.mark.parametrize(
    "window", [Window(0, 0, ROWS, COLS), Window(190, 250, 3, 3), Window(64, 64, 200, 200)]
)
def test_without_skipping_the_error_names_file_and_block(write_raster: Callable, window: Window) -> None:
    path = spoil(write_raster(PIXELS, **TILED), [(2, 3)])
    with pytest.raises(
        RasterReadError, match=r"rows 128 to 192, columns 192 to 256 \(.*--skip-bad-tiles"
    ) as caught:
        Dataset.open(path).read(window)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_without_bad_blocks_nothing_changes(write_raster: Callable) -> None:
    path = write_raster(PIXELS, nodata=7, **TILED)
    plain, skipping = (seen(Dataset.open(path, skip_bad_tiles=skip), 128) for skip in (False, True))
    assert all(map(np.array_equal, plain, skipping)) and skipping[2] == []


def test_a_block_is_bad_if_it_is_bad_in_one_of_the_used_bands(write_raster: Callable) -> None:
    planes = np.stack([PIXELS, PIXELS[::-1], PIXELS[:, ::-1]])
    path = write_raster(planes, interleave="band", colors="red green blue", **TILED)
    spoil(spoil(path, [(0, 1)], band=1), [(2, 3)], band=3)
    for how, bad in (
        ({}, [(0, 1), (2, 3)]),
        ({"band": 1}, [(0, 1)]),
        ({"band": 2}, []),
    ):
        _, valid, found = seen(Dataset.open(path, skip_bad_tiles=True, **how), 128)
        assert np.array_equal(valid, without(bad)) and found == bad_blocks(path, bad)


@SIDES
def test_strips_including_the_last(write_raster: Callable, side: Any) -> None:
    path = write_raster(PIXELS, compress="deflate", blockysize=40)
    path.write_bytes(path.read_bytes()[: -path.stat().st_size // 3])
    with rasterio.open(path) as file:
        strip = file.block_shapes[0][0]
    values, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    first = found[0].row
    assert first % strip == 0 and 100 < first < 250
    assert valid[:first].all() and not valid[first:].any()
    assert np.array_equal(values[valid], PIXELS[valid])
    assert [block.row for block in found] == list(range(first, ROWS, strip))


@SIDES
def test_a_mask_with_blocks_of_its_own(tmp_path: Path, write_raster: Callable, side: Any) -> None:
    """A bad block of the mask makes the whole block of the file that it intersects bad."""
    mask = np.where(np.arange(COLS) < 330, np.uint8(255), np.uint8(0)) * np.ones((ROWS, 1), np.uint8)
    path = write_raster(PIXELS, tmp_path / "a.tif", **TILED | {"blockxsize": 128, "blockysize": 128})
    beside = write_raster(mask, tmp_path / "mask.tif", **TILED | {"blockxsize": 32, "blockysize": 32})
    with rasterio.open(beside, "r+") as file:
        file.update_tags(INTERNAL_MASK_FLAGS_1="2")
    spoil(beside, [(1, 1)]).rename(f"{path}.msk")
    _, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    expected = mask > 0
    expected[:128, :128] = False
    assert np.array_equal(valid, expected)
    assert found == [BadBlock(str(path), 0, 0, 128, 128)]


def parts(folder: Path, write_raster: Callable) -> list[Path]:
    """Two files that overlap in columns 128 to 256 of a mosaic, each with bad blocks."""
    place = {"transform": Affine(2, 0, 4e5, 0, -2, 5e6), **TILED}
    east = place | {"transform": Affine(2, 0, 4e5 + 256, 0, -2, 5e6)}
    left = spoil(write_raster(PIXELS[:, :256], folder / "left.tif", **place), [(1, 1), (2, 3)])
    right = spoil(write_raster(PIXELS[:, 128:], folder / "right.tif", **east), [(0, 0), (2, 1), (4, 3)])
    return [left, right]


@SIDES
def test_in_a_mosaic_another_file_replaces_a_bad_block(
    tmp_path: Path, write_raster: Callable, side: Any
) -> None:
    left, right = parts(tmp_path, write_raster)
    values, valid, found = seen(Dataset.open([left, right], skip_bad_tiles=True), side)
    assert np.array_equal(valid, without([(1, 1), (2, 3), (4, 5)]))
    assert np.array_equal(values[valid], PIXELS[valid])
    assert found == [
        *(BadBlock(str(left), 64, 64, 64, 64), BadBlock(str(left), 128, 192, 64, 64)),
        *(BadBlock(str(right), 128, 64, 64, 64), BadBlock(str(right), 256, 192, 44, 30)),
    ]  # but not the first of the right file, which is not needed


def test_a_mosaic_names_the_damaged_file(tmp_path: Path, write_raster: Callable) -> None:
    left, right = parts(tmp_path, write_raster)
    dataset = Dataset.open([left, right])
    with pytest.raises(
        RasterReadError, match=r"left\.tif cannot be read in rows 64 to 128, columns 64 to 128"
    ):
        dataset.read(Window(0, 0, ROWS, 100))
    with pytest.raises(  # the first of the file, whatever is read
        RasterReadError, match=r"right\.tif cannot be read in rows 0 to 64, columns 0 to 64"
    ):
        dataset.read(Window(250, 260, 50, 90))


@SIDES
def test_a_vrt_is_read_by_its_own_blocks(tmp_path: Path, write_raster: Callable, side: Any) -> None:
    path = spoil(write_raster(PIXELS, tmp_path / "a.tif", **TILED), [(2, 3)])
    source = f"<SourceFilename relativeToVRT='1'>{path.name}</SourceFilename><SourceBand>1</SourceBand>"
    band = f"<VRTRasterBand dataType='Byte' band='1'><SimpleSource>{source}</SimpleSource></VRTRasterBand>"
    vrt = tmp_path / "a.vrt"
    vrt.write_text(f"<VRTDataset rasterXSize='{COLS}' rasterYSize='{ROWS}'>{band}</VRTDataset>")
    values, valid, found = seen(Dataset.open(vrt, skip_bad_tiles=True), side)
    assert found == [BadBlock(str(vrt), 128, 128, 128, 128)]
    expected = np.ones((ROWS, COLS), bool)
    expected[128:256, 128:256] = False
    assert np.array_equal(valid, expected) and np.array_equal(values[valid], PIXELS[valid])


def test_bad_blocks_are_invalid_in_a_downsampled_read_too(write_raster: Callable) -> None:
    path = spoil(write_raster(PIXELS, **TILED), BAD)
    found: set[BadBlock] = set()
    with recording_bad_blocks(found):
        values, valid, _ = Dataset.open(path, skip_bad_tiles=True).read_coarse(70)
    whole, _, _ = Dataset.open(write_raster(PIXELS, **TILED)).read_coarse(70)
    rows, cols = (
        (np.arange(n) + 0.5) * (full / n) for n, full in zip(valid.shape, (ROWS, COLS), strict=True)
    )
    assert np.array_equal(valid, without(BAD)[np.ix_(rows.astype(int), cols.astype(int))])
    assert np.array_equal(values[0][valid], whole[0][valid])
    assert sorted(found) == bad_blocks(path, BAD)


def test_a_missing_file_is_an_error_and_not_a_bad_block(write_raster: Callable) -> None:
    path = write_raster(PIXELS, **TILED)
    dataset = Dataset.open(path, skip_bad_tiles=True)
    path.unlink()
    with pytest.raises(RasterReadError):
        dataset.read(Window(0, 0, 64, 64))


def test_bad_blocks_are_returned_with_results_from_another_process(write_raster: Callable) -> None:
    path = spoil(write_raster(PIXELS, **TILED), BAD)

    def elsewhere(function: Any, items: Any, progress: Any = None) -> Any:
        """As on a cluster: functions, items and results are pickled."""
        for item in items:
            yield pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(function))(item)))

    _, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), 128, elsewhere)
    assert np.array_equal(valid, without(BAD)) and found == bad_blocks(path, BAD)


def test_a_change_of_the_file_or_of_how_it_is_read_changes_its_fingerprint(
    tmp_path: Path, write_raster: Callable
) -> None:
    from uavseg.execution.checkpoint import fingerprint

    path = write_raster(PIXELS, tmp_path / "a.tif", **TILED)
    other = write_raster(PIXELS, tmp_path / "b.tif", **TILED)
    opened = [
        Dataset.open(path),
        Dataset.open(path, nodata=3),
        Dataset.open(path, skip_bad_tiles=True),
        Dataset.open(other),
        Dataset.open([path, other]),
    ]
    hashes = [fingerprint(dataset) for dataset in opened]
    assert len(set(hashes)) == len(hashes)
    assert fingerprint(Dataset.open(path)) == hashes[0]
    Path(f"{path}.msk").write_bytes(path.read_bytes())
    assert fingerprint(Dataset.open(path)) != hashes[0]
    Path(f"{path}.msk").unlink()
    write_raster(PIXELS[::-1], path, **TILED)
    assert fingerprint(Dataset.open(path)) != hashes[0]


def test_a_block_that_failed_is_not_read_as_zeros_afterwards(tmp_path: Path, write_raster: Callable) -> None:
    path = write_raster(PIXELS, tmp_path / "a.tif", **TILED)
    content = bytearray(path.read_bytes())
    (start,) = struct.unpack_from("<I", content, 4)
    entries = range(start + 2, start + 2 + 12 * content[start], 12)
    [sizes] = [at for at in entries if struct.unpack_from("<H", content, at) == (325,)]
    struct.pack_into("<I", content, sizes + 8, 1 << 24)  # the sizes of the blocks are no longer in the file
    path.write_bytes(content)
    dataset = Dataset.open(path)
    for _ in range(2):
        with pytest.raises(RasterReadError, match="cannot be read"):
            dataset.read(Window(64, 64, 20, 20))


def test_a_bad_block_is_tried_once_by_a_thread_however_many_tiles_it_meets(
    write_raster: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = spoil(write_raster(PIXELS, compress="deflate", blockysize=100), [(1, 0)])  # a strip
    dataset, read, windows = Dataset.open(path, skip_bad_tiles=True), RasterFile.read, []

    def counted(self: RasterFile, handles: Any, choice: Any, window: Window, *more: Any) -> Any:
        windows.append(window)
        return read(self, handles, choice, window, *more)

    monkeypatch.setattr(RasterFile, "read", counted)
    for tile in tiles((ROWS, COLS), 64):
        _, valid = dataset.read(tile)
        rows = np.arange(tile.row, tile.row + tile.rows)
        assert valid is not None or not ((rows >= 100) & (rows < 200)).any()
    met = [one for one in windows if one.row < 200 and one.row + one.rows > 100]
    assert met == [Window(64, 0, 64, 64), Window(100, 0, 28, 64)]  # a tile, and its part of the strip


def test_of_wide_strips_only_the_window_is_read(
    write_raster: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_raster(PIXELS, compress="deflate", blockysize=40)
    path.write_bytes(path.read_bytes()[: -path.stat().st_size // 3])
    read: list[Window] = []
    plain = RasterFile.read

    def counting(self: RasterFile, handles: Any, choice: Any, window: Window, *shape: Any) -> Any:
        read.append(window)
        return plain(self, handles, choice, window, *shape)

    monkeypatch.setattr(RasterFile, "read", counting)
    _, valid = Dataset.open(path, skip_bad_tiles=True).read(Window(0, 64, ROWS, 16))
    assert valid is not None and not valid.all()
    assert {(window.col, window.cols) for window in read} == {(64, 16)}


@given(st.sets(st.tuples(st.sampled_from("ab"), st.integers(0, 4), st.integers(0, 4))))
def test_adjacent_bad_blocks_are_one_rectangle_and_none_is_left_out(bad: set[tuple[str, int, int]]) -> None:
    """Of files of 5 x 5 blocks, the last of each row and column of which is narrower."""
    rows, cols = (10, 10, 10, 10, 3), (8, 8, 8, 8, 5)
    found = [BadBlock(name, 10 * r, 8 * c, rows[r], cols[c]) for name, r, c in bad]
    said = bad_block_warnings(found)
    assert said == bad_block_warnings(reversed(found)) and len(said) <= len(found)
    for name in "ab":
        count = np.zeros((43, 37), int)
        for text in said:
            if text.startswith(f"{name} "):
                ends = [int(number) for pair in re.findall(r"(\d+) to (\d+)", text) for number in pair]
                top, bottom, left, right = ends
                count[top:bottom, left:right] += 1
        expected = np.zeros_like(count)
        for block in found:
            if block.path == name:
                expected[block.row : block.row + block.rows, block.col : block.col + block.cols] = 1
        assert np.array_equal(count, expected)


def test_a_file_whose_strips_are_all_bad_has_one_warning_and_a_checkered_one_says_how_many_more() -> None:
    strips = [BadBlock("a", 22 * k, 0, 22, 256) for k in range(900)]
    assert [text.split(":")[0] for text in bad_block_warnings(strips)] == [
        "a cannot be read in rows 0 to 19800, columns 0 to 256"
    ]
    checkered = [BadBlock("a", 64 * r, 64 * c, 64, 64) for r in range(10) for c in range(10) if (r + c) % 2]
    said = bad_block_warnings(checkered)
    assert len(said) == 21 and said[-1] == "30 more places cannot be read: their pixels count as nodata"


SMALL_BLOCKS = {"tiled": True, "blockxsize": 16, "blockysize": 16, "compress": "deflate"}


@pytest.mark.parametrize("side", [64, 192, 2048])
def test_a_file_of_many_blocks_none_of_which_can_be_read_is_left_out_as_a_whole(
    tmp_path: Path, write_raster: Callable, side: int
) -> None:
    pixels = np.random.default_rng(1).integers(1, 255, (280, 260), np.uint8)
    path = write_raster(pixels, tmp_path / "a.tif", **SMALL_BLOCKS)
    spoil(path, [(row, col) for row in range(18) for col in range(17)])
    _, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    assert not valid.any() and found == [BadBlock(str(path), 0, 0, 280, 260)]


@pytest.mark.slow
@pytest.mark.parametrize("tried", [7, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 63))])
def test_where_one_of_many_blocks_can_be_read_each_is_tried(
    tmp_path: Path, write_raster: Callable, tried: int
) -> None:
    pixels = np.random.default_rng(1).integers(1, 255, (288, 272), np.uint8)
    path = write_raster(pixels, tmp_path / "a.tif", **SMALL_BLOCKS)
    kept = divmod(tried * (18 * 17 - 1) // 63, 17)  # the first, one between, the last
    spoil(path, [(row, col) for row in range(18) for col in range(17) if (row, col) != kept])
    _, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), 2048)
    assert valid.sum() == 256 and len(found) == 18 * 17 - 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "side",
    [64, *(pytest.param(side, marks=pytest.mark.slow) for side in (192, (64, 448)))],
    ids=str,
)
def test_of_many_bad_blocks_one_more_costs_one_opening(
    tmp_path: Path, write_raster: Callable, monkeypatch: pytest.MonkeyPatch, side: Any
) -> None:
    count = 300
    pixels = np.random.default_rng(2).integers(1, 255, (64 * count, 70), np.uint8)
    path = write_raster(pixels, tmp_path / "a.tif", compress="deflate", blockysize=64)
    bad = [row for row in range(count) if row % 3]
    spoil(path, [(row, 0) for row in bad])
    closed: list[str] = []
    close = OpenFiles.close
    monkeypatch.setattr(OpenFiles, "close", lambda self, name: (closed.append(name), close(self, name))[1])
    values, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    expected = np.ones(pixels.shape, bool)
    for row in bad:
        expected[row * 64 : row * 64 + 64] = False
    assert np.array_equal(valid, expected) and np.array_equal(values[valid], pixels[valid])
    assert [block.row // 64 for block in found] == bad
    assert len(closed) <= len(bad) + 64


@pytest.mark.parametrize("side", [64, 192, (64, 448)], ids=str)
@pytest.mark.parametrize("compress", ["deflate", None])
def test_of_a_file_that_is_cut_off_few_blocks_are_tried(
    write_raster: Callable, monkeypatch: pytest.MonkeyPatch, side: Any, compress: str | None
) -> None:
    path = write_raster(PIXELS, **(TILED | {"compress": compress}))
    with rasterio.open(path) as file:
        places = {
            (i, j): int(file.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", "TIFF", bidx=1))
            for i, j in np.ndindex(-(-ROWS // 64), -(-COLS // 64))
        }
    last = (2, 1)  # the first block that is not whole
    path.write_bytes(path.read_bytes()[: places[last] + 100])
    bad = [block for block in places if places[block] >= places[last]]
    closed: list[str] = []
    close = OpenFiles.close
    monkeypatch.setattr(OpenFiles, "close", lambda self, name: (closed.append(name), close(self, name))[1])
    values, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    assert np.array_equal(valid, without(bad)) and np.array_equal(values[valid], PIXELS[valid])
    assert found == bad_blocks(path, bad)
    assert len(closed) < len(bad)


@pytest.mark.parametrize("side", [64, 192, 256])
def test_a_damaged_tile_of_jpeg_2000_is_bad_and_not_zeros(tmp_path: Path, side: int) -> None:
    """GDAL reads several tiles in threads of its own, which leave out errors, unless it is to use one."""
    path, count = tmp_path / "a.jp2", 256
    pixels = np.random.default_rng(0).integers(1, 255, (count, count), np.uint8)
    how = {"driver": "JP2OpenJPEG", "width": count, "height": count, "count": 1, "dtype": "uint8"}
    how |= {
        "crs": "EPSG:32618",
        "transform": Affine(1, 0, 4e5, 0, -1, 5e6),
        "quality": 100,
        "reversible": True,
    }
    with rasterio.open(path, "w", **how, blockxsize=64, blockysize=64) as file:
        file.write(pixels, 1)
    content = path.read_bytes()
    tile_starts = [found.start() for found in re.finditer(re.escape(b"\xff\x90\0\x0a\0\x05"), content)]
    [start] = tile_starts  # of the sixth tile: a marker, a length of 10 and its number
    path.write_bytes(content[: start + 12] + b"\xff\x90" + content[start + 14 :])  # no data, another tile
    values, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    expected = np.ones((count, count), bool)
    expected[64:128, 64:128] = False
    assert found == [BadBlock(str(path), 64, 64, 64, 64)] and np.array_equal(valid, expected)
    assert np.array_equal(values[valid], pixels[valid])
    with pytest.raises(RasterReadError, match="rows 64 to 128, columns 64 to 128"):
        Dataset.open(path).read(Window(0, 0, count, count))


@pytest.mark.parametrize("side", [64, 192, 1024])
def test_a_text_grid_that_ends_early_is_read_up_to_there(tmp_path: Path, side: int) -> None:
    """GDAL alone would look for the last row 2^100 times."""
    rows, last = 300, 200
    lines = [" ".join(str(row % 9 + col) for col in range(70)) for row in range(last)]
    head = f"ncols 70\nnrows {rows}\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    path = tmp_path / "a.asc"
    path.write_text(head + "\n".join(lines) + "\n")
    values, valid, found = seen(Dataset.open(path, skip_bad_tiles=True), side)
    assert valid[:last].all() and not valid[last:].any()
    assert np.array_equal(values[:last], np.add.outer(np.arange(last) % 9, np.arange(70)))
    assert [(block.row, block.rows) for block in found] == [(row, 1) for row in range(last, rows)]
    with pytest.raises(RasterReadError, match=f"rows {last} to {last + 1}"):
        Dataset.open(path).read(Window(rows - 50, 0, 50, 70))
