"""The header of a classic netCDF file asks for no more than the file holds."""

import struct
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings, strategies as st
from rasterio.shutil import copy

from uavseg.errors import RasterReadError
from uavseg.raster.access.untrusted import check_netcdf_header
from uavseg.raster.read.dataset import Dataset


def header(version: int, attribute_length: int = 4, dimensions: int = 1) -> bytes:
    """A file of one dimension, an attribute of texts, and one variable, without values."""
    count = ">Q" if version == 5 else ">I"

    def number(value: int) -> bytes:
        return struct.pack(count, value)

    def text(word: bytes) -> bytes:
        return number(len(word)) + word + bytes(-len(word) % 4)

    def kind(value: int) -> bytes:
        return struct.pack(">I", value)

    place = struct.pack(">I" if version == 1 else ">Q", 0)
    attributes = kind(12) + number(1) + text(b"title") + kind(2) + number(attribute_length) + b"abcd"
    variable = text(b"band") + number(dimensions) + number(0) * min(dimensions, 9) + kind(0) + number(0)
    return (
        b"CDF" + bytes([version]) + number(0) + kind(10) + number(1) + text(b"x") + number(3) + attributes
        + kind(11) + number(1) + variable + kind(1) + number(4) + place
    )  # fmt: skip


@pytest.mark.parametrize("version", [1, 2, 5])
def test_a_sound_header_is_read_to_its_end(tmp_path: Path, version: int) -> None:
    path = tmp_path / "a.nc"
    content = header(version)
    path.write_bytes(content)
    check_netcdf_header(path)
    for length in range(4, len(content)):
        path.write_bytes(content[:length])
        with pytest.raises(RasterReadError, match="its netCDF header is damaged"):
            check_netcdf_header(path)


@pytest.mark.parametrize("version", [1, 2, 5])
@pytest.mark.parametrize("wrong", [{"attribute_length": 1 << 31}, {"dimensions": 1 << 30}])
def test_what_is_counted_lies_in_the_file(tmp_path: Path, version: int, wrong: dict[str, int]) -> None:
    path = tmp_path / "a.nc"
    path.write_bytes(header(version, **wrong))
    with pytest.raises(RasterReadError, match="its netCDF header is damaged"):
        Dataset.open(path)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("netcdf")
    how = {"driver": "GTiff", "width": 60, "height": 50, "count": 1, "dtype": "uint8"}
    place = {"crs": "EPSG:32618", "transform": Affine(1, 0, 4e5, 0, -1, 5e6)}
    with rasterio.open(folder / "a.tif", "w", **how, **place) as file:
        file.write(np.arange(3000, dtype=np.uint8).reshape(50, 60), 1)
    copy(folder / "a.tif", folder / "a.nc", driver="netCDF")
    return folder / "a.nc"


def test_a_file_of_gdal_is_read(written: Path) -> None:
    values, _ = Dataset.open(written).read(Dataset.open(written).windows(64)[0])
    assert np.array_equal(values[0].ravel(), np.arange(3000, dtype=np.uint8))


@pytest.mark.slow
@given(st.integers(4, 1500), st.integers(0, 255))
@settings(max_examples=200)
def test_a_changed_byte_is_refused_or_asks_for_no_more_than_the_file_holds(
    written: Path, place: int, byte: int
) -> None:
    content = bytearray(written.read_bytes())
    content[place] = byte
    changed = written.with_name("b.nc")
    changed.write_bytes(content)
    try:
        check_netcdf_header(changed)
    except RasterReadError as error:
        assert "\n" not in str(error)
