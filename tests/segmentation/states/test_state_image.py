"""States kept two to a byte, in memory and in a file."""

import io

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from uavseg.errors import OutputError
from uavseg.raster.grid.tiling import Window
from uavseg.segmentation.states import state_image
from uavseg.segmentation.states.state_image import StateImage, pack_codes, unpack_codes


@pytest.fixture(params=["memory", "file"])
def room(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "file":
        monkeypatch.setattr(state_image, "MAX_IN_MEMORY", 0)
    return str(request.param)


def filled(shape: tuple[int, int], step: int) -> tuple[StateImage, np.ndarray]:
    image = StateImage(shape)
    rows = -(-shape[0] // 64) * 64
    codes = np.random.default_rng(1).integers(0, 16, (rows, image.cols)).astype(np.uint8)
    for row in reversed(range(0, rows, step)):
        image.write_codes(row, codes[row : row + step])
    return image, codes


def test_codes_written_are_read_back(room: str) -> None:
    image, codes = filled((130, 70), 64)
    assert isinstance(image._file, io.BytesIO) == (room == "memory")
    assert np.array_equal(image.read_codes(0, 192), codes)
    assert np.array_equal(image.read_codes(63, 3), codes[63:66])
    around = image.read_codes(-2, 196)
    assert not around[:2].any() and not around[-2:].any() and np.array_equal(around[2:-2], codes)
    image.write_codes(5, 15 - codes[5:7])
    assert np.array_equal(
        image.read_codes(4, 4), np.stack([codes[4], 15 - codes[5], 15 - codes[6], codes[7]])
    )


def test_states_are_read_by_window(room: str) -> None:
    image, codes = filled((130, 70), 192)
    states = codes[:130, :70] & 3
    assert np.array_equal(image.read(), states)
    assert np.array_equal(image.read(Window(60, 3, 40, 67)), states[60:100, 3:70])
    for rows in (1, 64, 256):
        parts = list(image.strips(rows))
        assert np.array_equal(np.vstack([part for _, part in parts]), states)
        assert [window.row for window, _ in parts] == list(range(0, 130, rows))


@settings(max_examples=30)
@given(st.integers(0, 9), st.integers(1, 9), st.integers(0, 10**6))
def test_unpacking_inverts_packing(rows: int, pairs: int, seed: int) -> None:
    codes = np.random.default_rng(seed).integers(0, 16, (rows, 2 * pairs)).astype(np.uint8)
    found = np.empty_like(codes)
    unpack_codes(pack_codes(codes), found)
    assert np.array_equal(found, codes) and pack_codes(codes).nbytes * 2 == codes.nbytes


def test_a_pixel_takes_4_bits() -> None:
    assert len(StateImage((640, 1280))._file.read()) == 640 * 1280 // 2


def test_a_full_disk_is_reported(room: str) -> None:
    image, codes = filled((64, 64), 64)

    class Full(io.BytesIO):
        def write(self, _content: object) -> int:
            raise OSError(28, "No space left on device")

    image._file = Full()
    with pytest.raises(
        OutputError, match=r"cannot write the states to \S+ \(No space left on device\).*TMPDIR"
    ):
        image.write_codes(0, codes)


def test_a_missing_temporary_folder_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise FileNotFoundError(2, "No usable temporary directory found")

    monkeypatch.setattr(state_image, "MAX_IN_MEMORY", 0)
    monkeypatch.setattr(state_image.tempfile, "TemporaryFile", refuse)
    with pytest.raises(OutputError, match="No usable temporary directory found"):
        StateImage((64, 64))
