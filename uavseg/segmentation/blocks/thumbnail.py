"""Thumbnail of an image as PNG, for notebooks: grey with alpha, reduced by averaging."""

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

MAX_SIDE = 360  # pixels


def thumbnail(sums: NDArray[np.uint32], counts: NDArray[np.uint8], maximum: float) -> str:
    """A `data:` address of the picture of means, at most `MAX_SIDE` pixels on a side.

    Parameters
    ----------
    sums : (M, N) uint32 array
        Sum of the valid pixels of each cell.
    counts : (M, N) uint8 array
        Their number; cells without any are transparent.
    maximum : float
        The mean that is white.
    """
    step = max(1, -(-max(sums.shape) // MAX_SIDE))
    total, number = (_sum_squares(band, step) for band in (sums, counts))
    means = np.divide(total, number, out=np.zeros(total.shape), where=number > 0)
    grey = np.rint(np.clip(means / maximum, 0, 1) * 255).astype(np.uint8)
    alpha = np.where(number > 0, 255, 0).astype(np.uint8)
    return "data:image/png;base64," + base64.b64encode(_png(np.dstack([grey, alpha]))).decode()


def _sum_squares(band: NDArray[np.integer], step: int) -> NDArray[np.float64]:
    """Sums of squares of cells; those at the edge may be smaller."""
    rows, cols = (np.arange(0, length, step) for length in band.shape)
    summed: NDArray[np.float64] = np.add.reduceat(np.add.reduceat(band.astype(float), rows, 0), cols, 1)
    return summed


def _png(image: NDArray[np.uint8]) -> bytes:
    """A (M, N, 2) image of grey and alpha as a PNG file (ISO/IEC 15948)."""
    rows, cols, _ = image.shape
    lines = b"".join(b"\0" + line.tobytes() for line in image)  # each without a filter
    header = struct.pack(">IIBBBBB", cols, rows, 8, 4, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
