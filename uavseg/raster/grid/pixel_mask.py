"""Two-level bit mask: a code for each block of 64 x 64 pixels, and a bit for each pixel of mixed blocks."""

from collections.abc import Iterable
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import Window, whole_blocks, window_blocks
from uavseg.units import BLOCK

NONE, ALL, MIXED = np.uint8(0), np.uint8(1), np.uint8(2)  # codes of blocks

Pixels = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PixelMask:
    """A set of pixels of a raster; its memory grows with the length of its outline, not with its area.

    What lies beyond the raster counts neither way.
    """

    codes: NDArray[np.uint8] = field(repr=False)  # (B, C): no, all or some pixels of a block of 64
    places: NDArray[np.int64] = field(repr=False)  # (k,): mixed blocks, as ascending indices into `codes`
    bits: NDArray[np.uint8] = field(repr=False)  # (k, 64, 8): their pixels, eight to a byte

    @classmethod
    def of(cls, pixels: Pixels) -> "PixelMask":
        """Return the set of the pixels that are true in an array.

        Examples
        --------
        >>> mask = PixelMask.of(np.arange(128) < 70 + np.zeros((64, 1)))
        >>> mask.codes
        array([[1, 2]], dtype=uint8)
        """
        rows, cols = pixels.shape
        inside = _padded(pixels, False)
        any_of = inside.any(axis=(1, 3))
        all_of = (_padded(pixels, True) if rows % BLOCK or cols % BLOCK else inside).all(axis=(1, 3))
        codes = np.where(all_of, ALL, np.where(any_of, MIXED, NONE)).astype(np.uint8)
        places = np.flatnonzero(codes == MIXED)
        mixed = inside.transpose(0, 2, 1, 3)[codes == MIXED]
        return cls(codes, places, np.packbits(mixed, axis=2))

    @classmethod
    def joined(cls, shape: tuple[int, int], parts: Iterable[tuple[Window, "PixelMask"]]) -> "PixelMask":
        """Return the set of a raster of `shape` from those of its tiles; nothing is in it elsewhere."""
        codes = np.zeros((-(-shape[0] // BLOCK), -(-shape[1] // BLOCK)), np.uint8)
        places, bits = [np.zeros(0, np.int64)], [np.zeros((0, BLOCK, BLOCK // 8), np.uint8)]
        for window, part in parts:
            here = window_blocks(window)
            codes[here] = part.codes
            row, col = np.divmod(part.places, part.codes.shape[1])
            places.append((row + here[0].start) * codes.shape[1] + col + here[1].start)
            bits.append(part.bits)
        joined = np.concatenate(places)
        order = np.argsort(joined)
        return cls(codes, joined[order], np.concatenate(bits)[order])

    def touches(self, window: Window) -> bool:
        """Return whether a block that intersects a window has a pixel in the set."""
        return bool(self.codes[_blocks(window)].any())

    def covers(self, window: Window) -> bool:
        """Return whether all blocks that intersect a window are wholly in the set."""
        return bool((self.codes[_blocks(window)] == ALL).all())

    def read(self, window: Window) -> Pixels:
        """Return which pixels of a window inside the raster are in the set, (rows, cols) bool."""
        here = _blocks(window)
        codes = self.codes[here]
        whole = np.zeros((codes.shape[0], BLOCK, codes.shape[1], BLOCK), bool)
        whole[:] = (codes == ALL)[:, None, :, None]
        row, col = np.nonzero(codes == MIXED)
        if len(row):
            flat = (row + here[0].start) * self.codes.shape[1] + col + here[1].start
            bits = self.bits[np.searchsorted(self.places, flat)]
            whole[row, :, col, :] = np.unpackbits(bits, axis=2).view(bool)
        first = Window(window.row % BLOCK, window.col % BLOCK, window.rows, window.cols)
        pixels: Pixels = whole.reshape(codes.shape[0] * BLOCK, codes.shape[1] * BLOCK)[first.slices]
        return pixels

    def sample(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Pixels:
        """Return which pixels at the crossings of some rows and columns are in the set, (rows, cols) bool."""
        return self.at(*np.broadcast_arrays(rows[:, None], cols))

    def at(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Pixels:
        """Return which of some pixels are in the set; rows, columns and the result have one shape."""
        codes = self.codes[rows // BLOCK, cols // BLOCK]
        found: Pixels = codes == ALL
        mixed = codes == MIXED
        row, col = rows[mixed], cols[mixed]
        index = np.searchsorted(self.places, row // BLOCK * self.codes.shape[1] + col // BLOCK)
        byte = self.bits[index, row % BLOCK, col % BLOCK // 8]
        found[mixed] = (byte >> (7 - col % 8)).astype(np.uint8) & 1
        return found

    def count(self, shape: tuple[int, int]) -> int:
        """Return number of pixels in the set, of a raster of `shape`."""
        rows = np.minimum(BLOCK, shape[0] - BLOCK * np.arange(self.codes.shape[0]))
        cols = np.minimum(BLOCK, shape[1] - BLOCK * np.arange(self.codes.shape[1]))
        return int(rows @ (self.codes == ALL) @ cols) + int(np.bitwise_count(self.bits).sum())


def _padded(pixels: Pixels, value: bool) -> NDArray[Any]:
    """Return the pixels as (B, 64, C, 64), with a value beyond their end."""
    shape = whole_blocks(pixels.shape[0]), whole_blocks(pixels.shape[1])
    whole = pixels
    if shape != pixels.shape:
        whole = np.full(shape, value)
        whole[: pixels.shape[0], : pixels.shape[1]] = pixels
    return whole.reshape(shape[0] // BLOCK, BLOCK, shape[1] // BLOCK, BLOCK)


def _blocks(window: Window) -> tuple[slice, slice]:
    """Return index of the blocks that intersect a window."""
    return (
        slice(window.row // BLOCK, -(-(window.row + window.rows) // BLOCK)),
        slice(window.col // BLOCK, -(-(window.col + window.cols) // BLOCK)),
    )
