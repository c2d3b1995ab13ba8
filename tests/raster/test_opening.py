"""GDAL's options while rasters are read: each thread has them, and they are put back."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import rasterio
import shapely
from rasterio.env import get_gdal_config

from uavseg.errors import RasterReadError
from uavseg.raster.access.opening import OFFLINE_OPTIONS, gdal_env, quiet_open
from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset
from uavseg.raster.read.inspect_file import inspect_file

PROXY = "GDAL_HTTP_PROXY"
OFFLINE = OFFLINE_OPTIONS[PROXY]
MASKED = {"tiled": True, "blockxsize": 64, "blockysize": 64, "compress": "deflate"}


def in_threads(*actions: Callable[[threading.Barrier], object]) -> list[object]:
    """What some functions return that run at the same time, each in a thread of its own."""
    barrier, found = threading.Barrier(len(actions)), [None] * len(actions)

    def run(n: int) -> None:
        found[n] = actions[n](barrier)

    threads = [threading.Thread(target=run, args=(n,)) for n in range(len(actions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def proxy_while_reading(barrier: threading.Barrier, online: bool = False) -> object:
    with gdal_env(online):
        barrier.wait()
        seen = get_gdal_config(PROXY)
        barrier.wait()
    return seen, get_gdal_config(PROXY)


def test_every_thread_reads_without_requests() -> None:
    assert in_threads(*[proxy_while_reading] * 3) == [(OFFLINE, None)] * 3
    with gdal_env():
        assert in_threads(proxy_while_reading)[0][0] == OFFLINE  # type: ignore[index]
        assert get_gdal_config(PROXY) == OFFLINE
    assert get_gdal_config(PROXY) is None


def test_a_thread_that_is_online_changes_nothing_for_the_others() -> None:
    def online(barrier: threading.Barrier) -> object:
        return proxy_while_reading(barrier, online=True)

    assert in_threads(proxy_while_reading, online) == [(OFFLINE, None), (None, None)]
    with gdal_env(online=True):
        assert in_threads(proxy_while_reading)[0][0] == OFFLINE  # type: ignore[index]


def masked(path: Path) -> Path:
    pixels = np.random.default_rng(0).integers(1, 255, (128, 128), np.uint8)
    how = {"count": 1, "dtype": "uint8", "height": 128, "width": 128}
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(
            path,
            "w",
            "GTiff",
            **how,
            **MASKED,
            crs="EPSG:32618",
            transform=rasterio.Affine(2, 0, 4e5, 0, -2, 5e6),
        ) as file,
    ):
        file.write(pixels, 1)
        file.write_mask(np.where(pixels > 99, 255, 0).astype(np.uint8))
    return path


def test_a_mask_that_cannot_be_reached_is_an_error_and_not_a_raster_without_one(tmp_path: Path) -> None:
    content = masked(tmp_path / "a.tif").read_bytes()
    assert inspect_file(tmp_path / "a.tif").masks == "file"
    at = int.from_bytes(content[4:8], "little")
    count = int.from_bytes(content[at : at + 2], "little")
    pointer = at + 2 + 12 * count
    mask_at = int.from_bytes(content[pointer : pointer + 4], "little")
    assert mask_at > at
    elsewhere = content[:pointer] + (len(content) + 8).to_bytes(4, "little") + content[pointer + 4 :]
    for damaged in (elsewhere, content[: mask_at + 20]):
        (tmp_path / "b.tif").write_bytes(damaged)
        with pytest.raises(RasterReadError, match="one of its directories cannot be read: it ends before"):
            Dataset.open(tmp_path / "b.tif")
    index_at = next(
        entry + 8
        for entry in range(mask_at + 2, len(content), 12)
        if int.from_bytes(content[entry : entry + 2], "little") == 324
    )
    beyond = content[:index_at] + (len(content) - 8).to_bytes(4, "little") + content[index_at + 4 :]
    (tmp_path / "d.tif").write_bytes(beyond)
    with pytest.raises(RasterReadError, match="cannot be read"):
        Dataset.open(tmp_path / "d.tif")
    alone = content[:pointer] + bytes(4) + content[pointer + 4 :]
    (tmp_path / "c.tif").write_bytes(alone)
    assert inspect_file(tmp_path / "c.tif").masks == ""


@pytest.mark.parametrize("tag", [33550, 34735, 42113])
def test_a_tag_that_matters_and_cannot_be_read_is_an_error(tmp_path: Path, tag: int) -> None:
    path = masked(tmp_path / "a.tif")
    with rasterio.open(path, "r+") as file:
        file.nodata = 123456  # longer than an entry
    content = bytearray(path.read_bytes())
    at = int.from_bytes(content[4:8], "little")
    for n in range(int.from_bytes(content[at : at + 2], "little")):
        entry = at + 2 + 12 * n
        if int.from_bytes(content[entry : entry + 2], "little") == tag:
            content[entry + 8 : entry + 12] = (len(content) + 100).to_bytes(4, "little")
            break
    else:
        pytest.fail("the file does not have the tag")
    path.write_bytes(content)
    with pytest.raises(RasterReadError, match=r"its tag (Geo|GDAL)\w+ cannot be read"):
        Dataset.open(path)


def test_a_raster_that_loses_its_place_while_it_is_used_is_an_error(tmp_path: Path) -> None:
    path = masked(tmp_path / "a.tif")
    dataset = Dataset.open(path)
    how = {"count": 1, "dtype": "uint8", "height": 128, "width": 128}
    with (
        pytest.warns(rasterio.errors.NotGeoreferencedWarning),
        rasterio.open(path, "w", "GTiff", **how) as file,
    ):
        file.write(np.ones((1, 128, 128), np.uint8))
    with (
        pytest.warns(rasterio.errors.NotGeoreferencedWarning),
        pytest.raises(RasterReadError, match=r"a\.tif changed"),
    ):
        dataset.read(Window(0, 0, 64, 64))


@pytest.mark.slow
def test_filters_of_another_thread_do_not_make_it_fail(tmp_path: Path) -> None:
    """Shapely changes filters of warnings as it checks validity; Python has them once for all threads."""
    path = tmp_path / "unplaced.tif"
    with quiet_open(path, "w", driver="GTiff", width=3, height=2, count=1, dtype="uint8") as file:
        file.write(np.ones((1, 2, 3), np.uint8))
    ended = threading.Event()

    def check() -> None:
        while not ended.is_set():
            shapely.is_valid(shapely.Point(0, 0))

    with ThreadPoolExecutor(2) as pool:
        checks = pool.submit(check)
        try:
            opened = list(pool.map(lambda _: quiet_open(path).shape, range(500)))
        finally:
            ended.set()
        checks.result()
    assert opened == [(2, 3)] * 500
