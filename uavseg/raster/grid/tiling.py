"""Tiling: windows, halos, and a window's blocks and cells in integers; masks of a bit for each pixel."""

from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import field, replace
from itertools import product
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Bools, Integers, Uint8s
from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.execution.executors import Map, Progress, serial, split_progress
from uavseg.units import BLOCK, CELL

MAX_TILES = 10_000_000
PANEL = 8192  # columns of a panel

Result = TypeVar("Result")
NONE, ALL, MIXED = np.uint8(0), np.uint8(1), np.uint8(2)  # codes of blocks


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of pixels: first row and column, number of rows and columns."""

    row: int
    col: int
    rows: int
    cols: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """The window as an index into an array of the whole raster."""
        return slice(self.row, self.row + self.rows), slice(self.col, self.col + self.cols)

    def grown(self, margin: int) -> "Window":
        """Return the window with a halo of `margin` pixels on every side; it may extend past the raster."""
        return Window(self.row - margin, self.col - margin, self.rows + 2 * margin, self.cols + 2 * margin)

    def clipped(self, shape: tuple[int, int]) -> "Window":
        """Return the part of the window inside a raster of `shape` (rows, cols); it may be empty."""
        return self.common(Window(0, 0, *shape))

    def relative_to(self, other: "Window") -> "Window":
        """Return the window, counted from the first pixel of another."""
        return Window(self.row - other.row, self.col - other.col, self.rows, self.cols)

    def common(self, other: "Window") -> "Window":
        """Return the part that two windows have in common; it may be empty."""
        row, col = max(self.row, other.row), max(self.col, other.col)
        rows = max(min(self.row + self.rows, other.row + other.rows) - row, 0)
        cols = max(min(self.col + self.cols, other.col + other.cols) - col, 0)
        return Window(row, col, rows, cols)

    def blocks(self, rows: int, cols: int) -> tuple[slice, slice]:
        """Return index of the blocks of so many rows and columns that intersect the window."""
        return (
            slice(self.row // rows, -(-(self.row + self.rows) // rows)),
            slice(self.col // cols, -(-(self.col + self.cols) // cols)),
        )


def tiles(shape: tuple[int, int], side: int | tuple[int, int]) -> list[Window]:
    """Return windows that cover a raster once, row by row.

    `shape` is rows and columns of the raster, `side` those of a tile in pixels: positive multiples of 64,
    else a ParameterError.

    Examples
    --------
    >>> tiles((100, 70), 64)
    [Window(row=0, col=0, rows=64, cols=64), Window(row=0, col=64, rows=64, cols=6),
     Window(row=64, col=0, rows=36, cols=64), Window(row=64, col=64, rows=36, cols=6)]
    """
    tile_rows, tile_cols = side if isinstance(side, tuple) else (side, side)
    for length in (tile_rows, tile_cols):
        if length <= 0 or length % BLOCK:
            raise ParameterError(f"the side of a tile is a positive multiple of {BLOCK} pixels, not {length}")
    count = -(-shape[0] // tile_rows) * -(-shape[1] // tile_cols)
    if count > MAX_TILES:
        raise ParameterError(
            f"tiles of {tile_cols} x {tile_rows} pixels divide the raster into {count:,}, and at most "
            f"{MAX_TILES:,} are worked through; choose larger ones (--tile)"
        )
    places = product(range(0, shape[0], tile_rows), range(0, shape[1], tile_cols))
    return [Window(*place, tile_rows, tile_cols).clipped(shape) for place in places]


def spread_windows(shape: tuple[int, int], count: int, side: int) -> list[Window]:
    """Return windows of `side` pixels, at most `count` along each side, spread evenly over a raster."""
    starts = []
    for length in shape:
        number, least = min(count, -(-length // side)), min(side, length)
        starts.append([(2 * k + 1) * length // (2 * number) - least // 2 for k in range(number)])
    sides = min(side, shape[0]), min(side, shape[1])
    return [Window(max(row, 0), max(col, 0), *sides).clipped(shape) for row, col in product(*starts)]


def in_panels(windows: list[Window]) -> list[Window]:
    """Return the same tiles, panel by panel of 8192 columns, each panel row by row.

    A tile is read with a halo. In this order the blocks of its neighbours are likely to be in the cache of
    decoded blocks, however wide the raster is.

    Examples
    --------
    >>> order = in_panels(tiles((128, 8192 + 64), (64, 8192)))
    >>> [(window.row, window.col) for window in order]
    [(0, 0), (64, 0), (0, 8192), (64, 8192)]
    """
    return sorted(windows, key=lambda window: (window.col // PANEL, window.row, window.col))


def tile_side(shape: tuple[int, int], file_block: tuple[int, int], pixels: int = 1 << 22) -> tuple[int, int]:
    """Return rows and columns of a tile of about `pixels` pixels that suits the layout of a file.

    Square if the file is tiled; whole rows if it is stored in strips, which are always decoded whole, unless
    64 rows are far more than so many pixels. `shape` and `file_block` are rows and columns of the raster, and
    of one block of the file.
    """
    in_strips = file_block[1] >= shape[1] and shape[1] > 2 * BLOCK
    if in_strips and BLOCK * shape[1] <= 4 * pixels:
        cols = whole_blocks(shape[1])
        return max(pixels // cols // BLOCK, 1) * BLOCK, cols
    side = max(int(pixels**0.5) // BLOCK, 1) * BLOCK
    return side, side


def whole_blocks(length: int) -> int:
    """Return a length in pixels, rounded up to whole blocks of 64."""
    return -(-length // BLOCK) * BLOCK


def cells_around(cells: NDArray[Any], window: Window, reach: int) -> NDArray[Any]:
    """Return cells of a window with a halo of `reach` pixels, a multiple of 8; 0 outside the raster."""
    margin = reach // CELL
    rows, cols = whole_blocks(window.rows) // CELL, whole_blocks(window.cols) // CELL
    around = np.zeros((rows + 2 * margin, cols + 2 * margin), cells.dtype)
    first = Window(window.row // CELL - margin, window.col // CELL - margin, *around.shape)
    part = first.clipped(cells.shape)
    around[part.relative_to(first).slices] = cells[part.slices]
    return around


def sample_positions(start: int, length: int, count: int) -> Integers:
    """Return `count` evenly spaced rows or columns of a range; all of them if `count` is `length`.

    Examples
    --------
    >>> sample_positions(10, 6, 3), sample_positions(10, 2, 2)
    (array([11, 13, 15]), array([10, 11]))
    """
    positions = ((np.arange(count) + 0.5) * (length / count) + 1e-10).astype(np.int64)  # as GDAL rounds
    return start + positions


def indices_within(positions: Integers, start: int, length: int) -> slice:
    """Return index of the ascending positions that lie in a range of rows or columns."""
    first, end = np.searchsorted(positions, [start, start + length]).tolist()
    return slice(first, end)


def window_blocks(window: Window, unit: int = BLOCK) -> tuple[slice, slice]:
    """Return index of a window's blocks in the block map, or of units of other sides in these blocks."""
    rows, cols = whole_blocks(window.rows), whole_blocks(window.cols)
    return Window(window.row // unit, window.col // unit, rows // unit, cols // unit).slices


def window_cells(window: Window) -> tuple[slice, slice]:
    """Return index of a window's cells in the block map, up to the end of its last blocks."""
    return window_blocks(window, CELL)


@dataclass(frozen=True, slots=True)
class TilePass:
    """One pass over the tiles of a raster."""

    windows: Sequence[Window]  # each after those above it and to its left in its panel
    map: Map = serial
    progress: Progress | None = None  # called with (done, total)

    def run(
        self, function: Callable[[Any], Result], items: Sequence[Any] | None = None
    ) -> Generator[Result, None, None]:
        """Yield results of a function for each window, or for each of some other items, in their order."""
        return self.map(function, self.windows if items is None else items, self.progress)

    def stages(self, count: int) -> list["TilePass"]:
        """Return the pass `count` times, each of which reports its share of the progress."""
        if self.progress is None:
            return [self] * count
        return [replace(self, progress=progress) for progress in split_progress(self.progress, count)]

    @property
    def silent(self) -> "TilePass":
        """The pass without progress."""
        return replace(self, progress=None)


@dataclass(frozen=True, eq=False)
class PixelMask:
    """A set of pixels whose memory grows with its outline, not its area; beyond the raster nothing counts."""

    codes: Uint8s = field(repr=False)  # (B, C): no, all or some pixels of a block of 64
    places: Integers = field(repr=False)  # (k,): mixed blocks, as ascending indices into `codes`
    bits: Uint8s = field(repr=False)  # (k, 64, 8): their pixels, eight to a byte

    @classmethod
    def of(cls, pixels: Bools) -> "PixelMask":
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
        return bool(self.codes[window.blocks(BLOCK, BLOCK)].any())

    def covers(self, window: Window) -> bool:
        """Return whether all blocks that intersect a window are wholly in the set."""
        return bool((self.codes[window.blocks(BLOCK, BLOCK)] == ALL).all())

    def read(self, window: Window) -> Bools:
        """Return which pixels of a window inside the raster are in the set, (rows, cols) bool."""
        here = window.blocks(BLOCK, BLOCK)
        codes = self.codes[here]
        whole = np.zeros((codes.shape[0], BLOCK, codes.shape[1], BLOCK), bool)
        whole[:] = (codes == ALL)[:, None, :, None]
        row, col = np.nonzero(codes == MIXED)
        if len(row):
            flat = (row + here[0].start) * self.codes.shape[1] + col + here[1].start
            bits = self.bits[np.searchsorted(self.places, flat)]
            whole[row, :, col, :] = np.unpackbits(bits, axis=2).view(bool)
        first = Window(window.row % BLOCK, window.col % BLOCK, window.rows, window.cols)
        return whole.reshape(codes.shape[0] * BLOCK, codes.shape[1] * BLOCK)[first.slices]

    def sample(self, rows: Integers, cols: Integers) -> Bools:
        """Return which pixels at the crossings of some rows and columns are in the set, (rows, cols) bool."""
        return self.at(*np.broadcast_arrays(rows[:, None], cols))

    def at(self, rows: Integers, cols: Integers) -> Bools:
        """Return which of some pixels are in the set; rows, columns and the result have one shape."""
        codes = self.codes[rows // BLOCK, cols // BLOCK]
        found: Bools = codes == ALL
        mixed = codes == MIXED
        row, col = rows[mixed], cols[mixed]
        index = np.searchsorted(self.places, row // BLOCK * self.codes.shape[1] + col // BLOCK)
        byte = self.bits[index, row % BLOCK, col % BLOCK // 8]
        found[mixed] = (byte >> (7 - col % 8)).astype(np.uint8) & 1
        return found


def _padded(pixels: Bools, value: bool) -> NDArray[Any]:
    """Return the pixels as (B, 64, C, 64), with a value beyond their end."""
    shape = whole_blocks(pixels.shape[0]), whole_blocks(pixels.shape[1])
    whole = pixels
    if shape != pixels.shape:
        whole = np.full(shape, value)
        whole[: pixels.shape[0], : pixels.shape[1]] = pixels
    return whole.reshape(shape[0] // BLOCK, BLOCK, shape[1] // BLOCK, BLOCK)
