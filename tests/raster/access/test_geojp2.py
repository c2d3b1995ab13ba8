"""A JPEG 2000 file whose keys of the reference system are damaged is refused, and nothing else is printed."""

import struct
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine

from uavseg.errors import RasterReadError
from uavseg.raster.read.dataset import Dataset

UUID = bytes.fromhex("b14bf8bd083d4b43a5ae8cd7d5a6ce03")
KEYS, TEXTS = 34735, 34737
PROJECTED = 3072  # the key of the projected system


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "a.jp2"
    size = {"driver": "JP2OpenJPEG", "width": 90, "height": 80, "count": 1, "dtype": "uint8"}
    place = {"crs": "EPSG:32618", "transform": Affine(1, 0, 4e5, 0, -1, 5e6)}
    with rasterio.open(path, "w", **size, **place, GMLJP2="NO") as file:
        file.write(np.random.default_rng(0).integers(1, 255, (1, 80, 90), np.uint8))
    return path


def tag_place(content: bytes, wanted: int) -> tuple[int, int]:
    """Where the values of a tag of the box are in the file, and how many."""
    box = content.index(UUID) + 16
    assert content[box : box + 4] == b"II*\0"
    (place,) = struct.unpack_from("<I", content, box + 4)
    (count,) = struct.unpack_from("<H", content, box + place)
    for n in range(count):
        tag, _, items, offset = struct.unpack_from("<HHII", content, box + place + 2 + 12 * n)
        if tag == wanted:
            return box + offset, items
    raise AssertionError


def change_key(path: Path, key: int, field: int, value: int) -> None:
    """Write one of the four numbers of a key: its own number, location, count or offset."""
    content = bytearray(path.read_bytes())
    start, items = tag_place(content, KEYS)
    keys = list(struct.unpack_from(f"<{items}H", content, start))
    [at] = [n for n in range(4, items, 4) if keys[n] == key]
    struct.pack_into("<H", content, start + 2 * (at + field), value)
    path.write_bytes(content)


def test_a_sound_file_has_its_place(picture: Path) -> None:
    assert Dataset.open(picture).geobox.crs == rasterio.CRS.from_epsg(32618)


@pytest.mark.parametrize(("field", "value"), [(1, 7), (1, TEXTS), (2, 0), (2, 9)])
def test_a_key_outside_of_its_array_is_refused(
    picture: Path, field: int, value: int, capfd: pytest.CaptureFixture[str]
) -> None:
    change_key(picture, PROJECTED, field, value)
    with pytest.raises(RasterReadError, match="keys of its coordinate reference system cannot be read"):
        Dataset.open(picture)
    assert capfd.readouterr() == ("", "")


def test_texts_that_end_early_are_refused(picture: Path, capfd: pytest.CaptureFixture[str]) -> None:
    content = bytearray(picture.read_bytes())
    start, _ = tag_place(content, TEXTS)
    content[start + 3] = 0
    picture.write_bytes(content)
    with pytest.raises(RasterReadError, match="cannot be read"):
        Dataset.open(picture)
    assert capfd.readouterr() == ("", "")
