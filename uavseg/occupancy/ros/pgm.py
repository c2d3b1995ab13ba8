"""PGM images, plain (P2) and raw (P5), 8 and 16 bits: the images of most robot maps.

Format: http://netpbm.sourceforge.net/doc/pgm.html. GDAL reads only raw ones, and ignores the maximum.
"""

import os
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import RasterReadError
from uavseg.inputs import read_bytes, read_start

MAX_BYTES = 1 << 30  # of a file, which is held in memory
MAGIC = (b"P2", b"P5")
_HEADER = re.compile(rb"P[25]" + 3 * rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,20})" + rb"(?=\s|$)")


def is_pgm(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins with the magic number of a PGM.

    Raises
    ------
    RasterReadError
        If it cannot be read.
    """
    return read_start(path, 2) in MAGIC


def read_pgm(path: str | os.PathLike[str]) -> tuple[NDArray[np.integer[Any]], int]:
    """Read the samples of a PGM, and the sample that stands for white.

    Returns
    -------
    samples : (rows, cols) integer array
        None is negative; some may be above the maximum, which are white too.
    maximum : int

    Raises
    ------
    RasterReadError
        If the header is invalid, or there are fewer samples than it says.
    """
    content = read_bytes(path, limit=MAX_BYTES)
    header = _HEADER.match(content)
    if header is None:
        raise RasterReadError(
            f"{os.fspath(path)} is not a PGM: expected width, height and maximum after P2 or P5"
        )
    cols, rows, maximum = (int(number) for number in header.groups())
    if not (cols and rows and 0 < maximum < 65536):
        raise RasterReadError(
            f"the header of {os.fspath(path)} is {cols} x {rows} pixels of up to {maximum}; "
            "expected at least one pixel, and a maximum of 1 to 65535"
        )
    plain = content[:2] == b"P2"
    body = content[header.end() :]
    samples_read = _plain(body, rows * cols, os.fspath(path)) if plain else _raw(body, rows * cols, maximum)
    if len(samples_read) < rows * cols:
        raise RasterReadError(
            f"{os.fspath(path)} says {cols} x {rows} pixels and holds {len(samples_read)}; it is truncated"
        )
    return samples_read[: rows * cols].reshape(rows, cols), maximum


def _raw(body: bytes, count: int, maximum: int) -> NDArray[np.integer[Any]]:
    """At most `count` samples after one byte of white space, most significant byte first."""
    dtype = np.dtype(">u2" if maximum > 255 else "u1")
    available = max(len(body) - 1, 0) // dtype.itemsize
    return np.frombuffer(body, dtype, min(available, count), offset=1 if body else 0)


def _plain(body: bytes, count: int, path: str) -> NDArray[np.int64]:
    """At most `count` samples, written as text."""
    tokens = re.sub(rb"#[^\r\n]*", b"", body).split()[:count]
    if not all(word.isdigit() and len(word) < 10 for word in tokens):
        raise RasterReadError(f"{path} is a plain PGM (P2) and holds something other than numbers")
    return np.array([int(word) for word in tokens], np.int64)


def pgm_bytes(grey: NDArray[np.uint8]) -> bytes:
    """A raw 8-bit PGM of a (rows, cols) uint8 array."""
    rows, cols = grey.shape
    return b"P5\n%d %d\n255\n" % (cols, rows) + np.ascontiguousarray(grey).tobytes()
