"""A TIFF whose directories lead nowhere, or whose index is incomplete, is refused in a sentence."""

import struct
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine

from uavseg.errors import RasterReadError
from uavseg.raster.read.dataset import Dataset

PLACE = {"crs": "EPSG:32618", "transform": Affine(1, 0, 4e5, 0, -1, 5e6)}
ROWS, COMPRESSION, STRIP_OFFSETS, STRIP_LENGTHS = 257, 259, 273, 279


def write(path: Path, **how: str) -> Path:
    size = {"driver": "GTiff", "width": 40, "height": 30, "count": 1, "dtype": "uint8"}
    with rasterio.open(path, "w", **size, **PLACE, **how) as file:
        file.write(np.full((1, 30, 40), 7, np.uint8))
    return path


def put_next_directory(path: Path, place: int) -> None:
    """Write where the directory after the first one is, in a BigTIFF."""
    content = bytearray(path.read_bytes())
    (first,) = struct.unpack_from("<Q", content, 8)
    (count,) = struct.unpack_from("<Q", content, first)
    struct.pack_into("<Q", content, first + 8 + 20 * count, place)
    path.write_bytes(content)


def empty_tag(path: Path, tag: int) -> None:
    """Write that a tag of the first directory of a classic TIFF has no values."""
    _write_at(path, tag, 4, "<I", 0)


def set_tag(path: Path, tag: int, value: int) -> None:
    """Write the value of a tag of the first directory of a classic TIFF, which is one short number."""
    _write_at(path, tag, 8, "<H", value)


def _write_at(path: Path, tag: int, place: int, number: str, value: int) -> None:
    content = bytearray(path.read_bytes())
    (first,) = struct.unpack_from("<I", content, 4)
    (count,) = struct.unpack_from("<H", content, first)
    [at] = [
        at
        for at in range(first + 2, first + 2 + 12 * count, 12)
        if struct.unpack_from("<H", content, at) == (tag,)
    ]
    struct.pack_into(number, content, at + place, value)
    path.write_bytes(content)


@pytest.mark.parametrize("compression", ["CCITTRLE", "CCITTFAX3", "CCITTFAX4"])
def test_a_fax_is_refused_because_its_damage_is_not_seen(tmp_path: Path, compression: str) -> None:
    path = write(tmp_path / "a.tif", nbits="1", compress=compression)
    with pytest.raises(RasterReadError, match="as a fax, CCITT, where damage cannot be told from content"):
        Dataset.open(path)


def test_a_mask_that_became_a_fax_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif")
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=False), rasterio.open(path, "r+") as file:
        file.write_mask(np.eye(30, 40, dtype=bool))
    assert Dataset.open(path).geobox.shape == (30, 40)
    set_tag(tmp_path / "a.tif.msk", COMPRESSION, 2)
    with pytest.raises(RasterReadError, match="a mask in it is compressed as a fax"):
        Dataset.open(path)


@pytest.mark.parametrize("place", [1 << 20, 1 << 62, 1 << 63, (1 << 64) - 1])
def test_a_next_directory_beyond_the_end_is_refused(tmp_path: Path, place: int) -> None:
    path = write(tmp_path / "a.tif", bigtiff="YES")
    assert Dataset.open(path).geobox.shape == (30, 40)
    put_next_directory(path, place)
    with pytest.raises(RasterReadError, match=r"directories cannot be read: it ends before\); the file is d"):
        Dataset.open(path)


@pytest.mark.parametrize("how", [{}, {"interleave": "band"}, {"interleave": "pixel", "photometric": "RGB"}])
def test_an_index_of_more_strips_than_there_are_is_refused(tmp_path: Path, how: dict[str, str]) -> None:
    """libtiff would end the process where it looks for one of the others."""
    path = tmp_path / "a.tif"
    size = {"driver": "GTiff", "width": 40, "height": 30, "count": 3, "dtype": "uint8", "blockysize": 4}
    with rasterio.open(path, "w", **(size | PLACE | how), compress="deflate") as file:
        file.write(np.full((3, 30, 40), 7, np.uint8))
    assert Dataset.open(path, rgb=(1, 2, 3)).geobox.shape == (30, 40)
    set_tag(path, ROWS, 10)
    with pytest.raises(RasterReadError, match="its index has more strips than its size makes"):
        Dataset.open(path, rgb=(1, 2, 3))
    set_tag(path, ROWS, 29)  # as many strips
    assert Dataset.open(path, rgb=(1, 2, 3)).geobox.shape == (29, 40)


@pytest.mark.parametrize("how", [{"blockysize": 4}, {"tiled": True, "blockxsize": 16, "blockysize": 16}])
@pytest.mark.parametrize("interleave", ["band", "pixel"])
def test_an_index_of_fewer_blocks_than_there_are_is_refused(
    tmp_path: Path, how: dict[str, int], interleave: str
) -> None:
    path = tmp_path / "a.tif"
    size = {"driver": "GTiff", "width": 40, "height": 30, "count": 3, "dtype": "uint8"}
    with rasterio.open(path, "w", **(size | PLACE | how), interleave=interleave, compress="deflate") as file:
        file.write(np.full((3, 30, 40), 7, np.uint8))
    set_tag(path, ROWS, 32)  # as many blocks
    assert Dataset.open(path, rgb=(1, 2, 3)).geobox.shape == (32, 40)
    set_tag(path, ROWS, 65535)
    for skip in (False, True):
        with pytest.raises(RasterReadError, match=r"its index has \d+ of the [\d,]+ blocks"):
            Dataset.open(path, rgb=(1, 2, 3), skip_bad_tiles=skip)


def test_lengths_of_blocks_without_their_places_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif")
    empty_tag(path, STRIP_OFFSETS)
    with pytest.raises(RasterReadError, match="it has lengths of blocks, but not where they are"):
        Dataset.open(path)


def test_a_sparse_file_without_an_index_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "a.tif")
    empty_tag(path, STRIP_OFFSETS)
    empty_tag(path, STRIP_LENGTHS)
    assert Dataset.open(path).geobox.shape == (30, 40)
