"""Header of a classic netCDF file: its counts are compared with its size.

The netCDF library allocates what the header asks for: 2 GB for a damaged file of 20 kB. Format:
https://docs.unidata.ucar.edu/netcdf-c/current/file_format_specifications.html.
"""

from pathlib import Path
from typing import BinaryIO

from uavseg.errors import RasterReadError

SIGNATURES = (b"CDF\x01", b"CDF\x02", b"CDF\x05")
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}  # of a value, by its type
_MAX_DIMENSIONS = 1024  # of a variable, as in the library


def check_netcdf_header(path: Path) -> None:
    """Refuse a file whose header counts more than lies within it (RasterReadError)."""
    size = path.stat().st_size
    with path.open("rb") as file:
        try:
            _Header(file, size).check()
        except ValueError as error:
            raise RasterReadError(
                f"{path} cannot be opened as a raster (its netCDF header is damaged: {error}); repair it, or "
                "get it again"
            ) from error


class _Header:
    """The header, read from its start; ValueError where it leaves the file."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        version = file.read(4)[3]
        self._count_bytes = 8 if version == 5 else 4
        self._place_bytes = 4 if version == 1 else 8

    def check(self) -> None:
        self._read_integer(self._count_bytes)  # of records
        for _ in range(self._list(_DIMENSIONS, 2)):
            self._text()
            self._read_integer(self._count_bytes)
        self._attributes()
        for _ in range(self._list(_VARIABLES, 6)):
            self._text()
            dimensions = self._read_integer(self._count_bytes)
            if dimensions > _MAX_DIMENSIONS:
                raise ValueError(f"a variable with {dimensions:,} dimensions")
            self._skip(dimensions * self._count_bytes)
            self._attributes()
            self._skip(4 + self._count_bytes + self._place_bytes)  # type, size, place

    def _attributes(self) -> None:
        for _ in range(self._list(_ATTRIBUTES, 3)):
            self._text()
            kind, count = self._read_integer(4), self._read_integer(self._count_bytes)
            if kind not in _BYTES:
                raise ValueError(f"an attribute of type {kind}")
            self._skip(count * _BYTES[kind])

    def _list(self, tag: int, numbers: int) -> int:
        """Return how many elements a list has, each of which holds at least so many numbers."""
        found, count = self._read_integer(4), self._read_integer(self._count_bytes)
        if found != tag and (found or count):
            raise ValueError(f"a list of kind {found} in place of {tag}")
        if count * numbers * 4 > self._size:
            raise ValueError(f"{count:,} entries in a file of {self._size:,} bytes")
        return count

    def _text(self) -> None:
        self._skip(self._read_integer(self._count_bytes))

    def _read_integer(self, length: int) -> int:
        content = self._file.read(length)
        if len(content) < length:
            raise ValueError("it ends before")
        return int.from_bytes(content, "big")

    def _skip(self, length: int) -> None:
        """Pass over bytes, which are padded to a multiple of four."""
        end = self._file.tell() + -(-length // 4) * 4
        if end > self._size:
            raise ValueError("it ends before")
        self._file.seek(end)
