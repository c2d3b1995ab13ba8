"""Image of the states of a whole raster in 4 bits per pixel, in memory or in a temporary file."""

import io
import tempfile
from collections.abc import Iterator
from typing import IO

import numpy as np

from uavseg.arrays import Uint8s
from uavseg.errors import OutputError
from uavseg.raster.grid.tiling import Window, whole_blocks
from uavseg.segmentation.states.state_scans import decode_states

MAX_IN_MEMORY = 64 << 20  # bytes: the codes of 128 million pixels; larger images go to a temporary file

_HALF_BYTE = np.uint8(4)
_LOW_BITS = np.uint8(15)


class StateImage:
    """Codes of the pixels of a raster (see `state_scans`), packed two to a byte.

    Images of up to 64 MB are held in memory, larger ones in an unnamed temporary file, so that memory is
    bounded. Codes are stored for the whole blocks of the raster. An OutputError says that there is no space
    for the file.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self._rows, self._cols = (whole_blocks(length) for length in shape)
        self._file = _open_buffer(self._rows * self._cols // 2)

    @property
    def cols(self) -> int:
        """Columns, rounded up to whole blocks."""
        return self._cols

    def write_codes(self, row: int, codes: Uint8s) -> None:
        """Write the codes of rows from `row` on, (rows, cols) with the columns of whole blocks."""
        try:
            self._file.seek(row * self._cols // 2)
            self._file.write(pack_codes(codes).tobytes())
        except OSError as error:
            raise _disk_error(error) from error

    def read_codes(self, row: int, rows: int) -> Uint8s:
        """Read the codes of rows, (rows, cols) with the columns of whole blocks; 0 outside the raster."""
        first, last = max(row, 0), min(row + rows, self._rows)
        codes = np.zeros((rows, self._cols), np.uint8)
        if last > first:
            self._file.seek(first * self._cols // 2)
            content = self._file.read((last - first) * self._cols // 2)
            pairs = np.frombuffer(content, np.uint8).reshape(last - first, -1)
            unpack_codes(pairs, codes[first - row : last - row])
        return codes

    def read(self, window: Window | None = None) -> Uint8s:
        """Read the states of a window, or of the whole raster: 0 invalid, 1 free, 2 unknown, 3 occupied."""
        part = Window(0, 0, *self.shape) if window is None else window
        codes = self.read_codes(part.row, part.rows)
        return np.ascontiguousarray(decode_states(codes[:, part.col : part.col + part.cols]))

    def strips(self, rows: int = 256) -> Iterator[tuple[Window, Uint8s]]:
        """Yield windows of whole rows from the top, with their states."""
        for row in range(0, self.shape[0], rows):
            window = Window(row, 0, rows, self.shape[1]).clipped(self.shape)
            yield window, self.read(window)


def pack_codes(codes: Uint8s) -> Uint8s:
    """Pack codes two to a byte: (rows, cols / 2), the left half of each row in the low bits."""
    half = codes.shape[1] // 2
    return codes[:, :half] | codes[:, half:] << _HALF_BYTE


def unpack_codes(pairs: Uint8s, codes: Uint8s) -> None:
    """Unpack (rows, cols / 2) pairs into a (rows, cols) array, the inverse of `pack_codes`."""
    half = pairs.shape[1]
    np.bitwise_and(pairs, _LOW_BITS, out=codes[:, :half])
    np.right_shift(pairs, _HALF_BYTE, out=codes[:, half:])


def _open_buffer(size: int) -> IO[bytes]:
    if size <= MAX_IN_MEMORY:
        return io.BytesIO(bytes(size))
    try:
        return tempfile.TemporaryFile(prefix="uavseg-states-")
    except OSError as error:
        raise _disk_error(error) from error


def _disk_error(error: OSError) -> OutputError:
    return OutputError(
        f"cannot write the states to {tempfile.gettempdir()} ({error.strerror or error}); name a folder "
        "with more space in the environment variable TMPDIR"
    )
