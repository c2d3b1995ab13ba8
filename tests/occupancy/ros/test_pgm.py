"""PGM images of all depths, and damaged ones."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import array_shapes, arrays

from tests.occupancy.ros.map_files import ALL, put
from uavseg.errors import RasterReadError
from uavseg.occupancy.ros.ros_map import is_pgm, pgm_bytes, read_pgm, read_ros_map
from uavseg.raster.formats.png import to_8_bits


def plain(samples: np.ndarray, maximum: int) -> bytes:
    rows, cols = samples.shape
    text = "\n".join(" ".join(map(str, row)) for row in samples.tolist())
    return f"P2 # plain\n# by hand\n{cols} {rows}\n{maximum}\n{text}\n".encode()


def raw(samples: np.ndarray, maximum: int) -> bytes:
    rows, cols = samples.shape
    return (
        b"P5\n# raw\n%d\t%d\n%d\n" % (cols, rows, maximum)
        + samples.astype(">u2" if maximum > 255 else "u1").tobytes()
    )


@pytest.mark.parametrize("form", [plain, raw])
@pytest.mark.parametrize(
    ("samples", "maximum", "grey"),
    [
        (ALL, 255, ALL),
        (ALL.astype(int) * 257, 65535, ALL),
        (ALL.astype(int) * 257 + 256 * (ALL < 255), 65535, ALL),  # rounded down
        (np.arange(16).reshape(4, 4), 15, np.arange(16).reshape(4, 4) * 17),
        (np.array([[0, 1], [1, 0]]), 1, np.array([[0, 255], [255, 0]])),
        (np.array([[0, 500, 1000]]), 1000, np.array([[0, 127, 255]])),
        (np.array([[7, 200]]), 100, np.array([[17, 255]])),  # beyond the maximum is white
    ],
)
def test_pgms_of_every_depth_are_read(
    tmp_path: Path, form: Any, samples: np.ndarray, maximum: int, grey: np.ndarray
) -> None:
    path = put(tmp_path, ALL, mode="raw")
    (tmp_path / "map.pgm").write_bytes(form(samples, maximum))
    assert (to_8_bits(*read_pgm(tmp_path / "map.pgm")) == grey).all()
    assert (read_ros_map(path).cells == np.where(grey <= 100, grey.astype(int), -1)).all()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"P5\n4 4\n255\n" + bytes(15), "says 4 x 4 pixels and holds 15; it is truncated"),
        (b"P5\n4 4\n65535\n" + bytes(31), "says 4 x 4 pixels and holds 15; it is truncated"),
        (b"P5\n100000000 100000000\n255\n" + bytes(99), "holds 99; it is truncated"),
        (b"P5\n99999999999999999999 9\n255\n" + bytes(99), "holds 99; it is truncated"),
        (b"P2\n99999999999999999999 9\n255\n1 2 3", "holds 3; it is truncated"),
        (b"P5\n0 4\n255\n", "is 0 x 4 pixels of up to 255"),
        (b"P5\n4 4\n0\n" + bytes(16), "a maximum of 1 to 65535"),
        (b"P5\n4 4\n65536\n" + bytes(32), "a maximum of 1 to 65535"),
        (b"P5\n4 -4\n255\n" + bytes(16), "is not a PGM"),
        (b"P5", "is not a PGM"),
        (b"P2\n2 2\n255\n1 2 x 4", "something other than numbers"),
        (b"P2\n2 2\n255\n1 -2 3 4", "something other than numbers"),
        (b"", "cannot be read as a picture"),
        (b"\x89PNG\r\n\x1a\n", "cannot be read as a picture"),
    ],
)
def test_an_invalid_image_is_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = put(tmp_path, ALL)
    (tmp_path / "map.pgm").write_bytes(content)
    with pytest.raises(RasterReadError) as caught:
        read_ros_map(path)
    assert message in str(caught.value) and "map.pgm" in str(caught.value) and "\n" not in str(caught.value)


@given(arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=20)))
def test_a_pgm_written_is_read_equal(grey: np.ndarray) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.pgm"
        path.write_bytes(pgm_bytes(grey))
        assert is_pgm(path)
        with pytest.raises(RasterReadError, match=r"none\.pgm cannot be read \(No such file"):
            is_pgm(Path(folder) / "none.pgm")
        samples, maximum = read_pgm(path)
    assert maximum == 255 and np.array_equal(samples, grey)
