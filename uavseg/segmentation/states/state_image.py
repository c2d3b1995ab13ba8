"""StateImage: the states of a whole raster, half a byte a pixel, read by window."""

import io
import tempfile
from collections.abc import Iterator
from typing import IO

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import OutputError
from uavseg.raster.tiling import Window, whole_blocks
from uavseg.segmentation.states.state_scans import Codes, states_in

ROOM = 64 << 20  # bytes held in memory: the codes of 128 million pixels; more lie in a temporary file

_FOUR = np.uint8(4)
_LOW = np.uint8(15)


class StateImage:
    """Codes of the pixels of a raster (see `statescans`), packed two to a byte.

    Up to 64 MB they are held in memory; beyond that in an unnamed temporary file, so that what is held does
    not grow with the raster.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raster; codes are kept for its whole blocks.

    Raises
    ------
    OutputError
        If there is no room for the temporary file.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self._rows, self._cols = (whole_blocks(length) for length in shape)
        self._file = _room_for(self._rows * self._cols // 2)

    @property
    def cols(self) -> int:
        """Columns of its whole blocks."""
        return self._cols

    def put(self, row: int, codes: Codes) -> None:
        """Keep the codes of some rows from `row` on, (rows, cols) with the columns of whole blocks."""
        try:
            self._file.seek(row * self._cols // 2)
            self._file.write(packed(codes).tobytes())
        except OSError as error:
            raise _no_room(error) from error

    def codes(self, row: int, rows: int) -> Codes:
        """Codes of some rows, (rows, cols) with the columns of whole blocks; 0 above and below the raster."""
        first, last = max(row, 0), min(row + rows, self._rows)
        found = np.zeros((rows, self._cols), np.uint8)
        if last > first:
            self._file.seek(first * self._cols // 2)
            content = self._file.read((last - first) * self._cols // 2)
            unpack(
                np.frombuffer(content, np.uint8).reshape(last - first, -1), found[first - row : last - row]
            )
        return found

    def read(self, window: Window | None = None) -> NDArray[np.uint8]:
        """States of a window, or of all.

        Returns
        -------
        states : (rows, cols) uint8 array
            0 invalid, 1 free, 2 unknown, 3 occupied.
        """
        part = Window(0, 0, *self.shape) if window is None else window
        codes = self.codes(part.row, part.rows)
        return np.ascontiguousarray(states_in(codes[:, part.col : part.col + part.cols]))

    def strips(self, rows: int = 256) -> Iterator[tuple[Window, NDArray[np.uint8]]]:
        """States of all rows, some at a time from the top."""
        for row in range(0, self.shape[0], rows):
            window = Window(row, 0, rows, self.shape[1]).clipped(self.shape)
            yield window, self.read(window)


def packed(codes: Codes) -> NDArray[np.uint8]:
    """Codes two to a byte: (rows, cols / 2), the left half of each row in the low bits."""
    half = codes.shape[1] // 2
    return codes[:, :half] | codes[:, half:] << _FOUR


def unpack(pairs: NDArray[np.uint8], codes: Codes) -> None:
    """`packed` undone, into an array."""
    half = pairs.shape[1]
    np.bitwise_and(pairs, _LOW, out=codes[:, :half])
    np.right_shift(pairs, _FOUR, out=codes[:, half:])


def _room_for(size: int) -> IO[bytes]:
    if size <= ROOM:
        return io.BytesIO(bytes(size))
    try:
        return tempfile.TemporaryFile(prefix="uavseg-states-")
    except OSError as error:
        raise _no_room(error) from error


def _no_room(error: OSError) -> OutputError:
    return OutputError(
        f"the states cannot be kept in {tempfile.gettempdir()} ({error.strerror or error}); name a folder "
        "with more room in the environment variable TMPDIR"
    )
