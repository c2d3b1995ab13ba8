"""File state: it changes with every file that a raster consists of."""

import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from uavseg.errors import RasterReadError
from uavseg.raster.read.raster_file import file_states

PIXELS = np.arange(12, dtype=np.uint8).reshape(3, 4)


def names(path: object) -> list[str]:
    return [Path(name).name for name, *_ in file_states(str(path))]


def test_size_and_time_of_a_file_are_its_state(tmp_path: Path, write_raster: Callable) -> None:
    path = write_raster(PIXELS, tmp_path / "a.tif")
    assert file_states(str(path)) == ((str(path), path.stat().st_size, path.stat().st_mtime_ns),)
    before = file_states(str(path))
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1))
    assert file_states(str(path)) != before


def test_a_relative_path_is_the_same_file(
    tmp_path: Path, write_raster: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_raster(PIXELS, tmp_path / "a.tif")
    monkeypatch.chdir(tmp_path)
    assert file_states("a.tif") == file_states(str(path))


def test_the_files_of_a_vrt_belong_to_its_state(tmp_path: Path, write_raster: Callable) -> None:
    write_raster(PIXELS, tmp_path / "a.tif")
    source = "<SourceFilename relativeToVRT='1'>a.tif</SourceFilename><SourceBand>1</SourceBand>"
    band = f"<VRTRasterBand dataType='Byte' band='1'><SimpleSource>{source}</SimpleSource></VRTRasterBand>"
    (tmp_path / "a.vrt").write_text(f"<VRTDataset rasterXSize='4' rasterYSize='3'>{band}</VRTDataset>")
    assert sorted(names(tmp_path / "a.vrt")) == ["a.tif", "a.vrt"]


def test_a_file_in_an_archive_is_represented_by_the_archive(tmp_path: Path, write_raster: Callable) -> None:
    path = write_raster(PIXELS, tmp_path / "a.tif")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(path, "deep/a.tif")
    packed = tmp_path / "a.zip"
    inside = file_states(f"/vsizip/{packed}/deep/a.tif")
    assert set(inside) == {(str(packed), packed.stat().st_size, packed.stat().st_mtime_ns)}


def test_a_missing_raster_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RasterReadError, match=r"gone\.tif cannot be opened"):
        file_states(str(tmp_path / "gone.tif"))
