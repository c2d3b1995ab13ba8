"""Windowed reads of a dataset as 16-bit grey, and the measurement of the illumination that they subtract."""

import math
import threading
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.arrays import Integers, Uint8s, Uint16s, Uint32s
from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import TilePass, Window, spread_windows, whole_blocks
from uavseg.raster.intensity.stretch import Stretch, greys_beyond
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.blocks.block_map import cell_sums
from uavseg.segmentation.params.illumination import Illumination, fit_illumination, square_side
from uavseg.units import BLOCK, CELL, GREY_MAX


@dataclass(frozen=True, slots=True)
class GreyTile:
    """Grey of a window, M x N in whole blocks, with a margin m; pixels outside the raster are invalid."""

    grey: Uint16s  # (M + 2 m, N + 2 m): 0 where invalid
    valid: Uint8s  # (M + 2 m, N + 2 m): 1 where a pixel is valid
    all_valid: bool  # whether every pixel of the array is valid
    excess: NDArray[np.int32] | None = None  # (M + 2 m, N + 2 m): `greys_beyond`, if any and requested
    large_step: int = GREY_MAX  # as of the source

    @property
    def mask(self) -> Uint8s | None:
        """`valid`, or None where every pixel is valid."""
        return None if self.all_valid else self.valid

    def cropped(self, margin: int) -> "GreyTile":
        """Crop the outermost `margin` pixels on every side."""
        inner = np.s_[margin : self.grey.shape[0] - margin, margin : self.grey.shape[1] - margin]
        grey, valid = np.ascontiguousarray(self.grey[inner]), np.ascontiguousarray(self.valid[inner])
        excess = None if self.excess is None else np.ascontiguousarray(self.excess[inner])
        return replace(self, grey=grey, valid=valid, excess=excess)


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of the grey of a raster; a step is the absolute difference of adjacent pixels."""

    mean_step: float = math.nan
    deviation: float = math.nan  # the standard deviation
    separability: float = math.nan  # Otsu's eta: share of the variance between the two best classes


@dataclass(frozen=True)
class GreySource:
    """A dataset, the stretch that maps its values to grey, and the illumination subtracted from grey."""

    dataset: Dataset
    stretch: Stretch
    illumination: Illumination | None = field(default=None, kw_only=True)
    statistics: Statistics = field(default=Statistics(), kw_only=True, compare=False)
    large_step: int = field(default=GREY_MAX, kw_only=True)  # which a tenth of the steps exceeds

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.dataset.geobox.shape

    @property
    def is_intensity(self) -> bool:
        """Whether grey is intensity, and not a similarity."""
        return True

    @property
    def is_flat(self) -> bool:
        """Whether illumination is subtracted, so that v no longer stands for values of the dataset."""
        return self.illumination is not None

    def read(self, window: Window, margin: int, excess: bool = False) -> GreyTile:
        """Read the grey of a window with `margin` pixels on every side.

        With `excess`, the tile tells by how much pixels lie outside the ends of the stretch too; not with
        illumination.
        """
        shape = (whole_blocks(window.rows) + 2 * margin, whole_blocks(window.cols) + 2 * margin)
        part = window.grown(margin).clipped(self.shape)
        values, mask = self.dataset.read(part)
        pixels = self.stretch.apply(values, mask)
        outside = greys_beyond(values, mask, pixels, self.stretch) if excess and not self.is_flat else None
        if self.illumination is not None:
            self.illumination.subtract_from(pixels, mask, (part.row, part.col))
        if part.rows == shape[0] and part.cols == shape[1]:
            valid = np.ones(shape, np.uint8) if mask is None else mask.view(np.uint8)
            grey, valid = np.ascontiguousarray(pixels), np.ascontiguousarray(valid)
            return GreyTile(grey, valid, mask is None, outside, self.large_step)
        grey, valid = np.zeros(shape, np.uint16), np.zeros(shape, np.uint8)
        inner = Window(part.row - window.row + margin, part.col - window.col + margin, part.rows, part.cols)
        grey[inner.slices] = pixels
        valid[inner.slices] = 1 if mask is None else mask
        if outside is not None:
            outside, part_outside = np.zeros(shape, np.int32), outside
            outside[inner.slices] = part_outside
        return GreyTile(grey, valid, False, outside, self.large_step)


CAPACITY = 128 << 20  # bytes: the mixed blocks of a raster of about 16000 x 16000 pixels
CACHED_SIDE = BLOCK + 2  # a block with a border of one pixel


CachedBlocks = tuple[NDArray[np.uint16], NDArray[np.uint8] | None]


class BlockCache:
    """Cached blocks by tile; thread-safe. A pickled copy is empty and caches nothing.

    The k blocks of a tile are two (66 k, 66) arrays, stacked vertically with a border of one pixel each:
    grey, and 1 where a pixel is valid, or None where all are.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._free = capacity
        self._tiles: dict[Window, CachedBlocks] = {}
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type["BlockCache"], tuple[int]]:
        return BlockCache, (0,)

    def fingerprint(self) -> tuple[()]:
        """Return nothing: no result depends on the cache."""
        return ()

    def put(self, window: Window, tile: GreyTile, corners: Integers) -> None:
        """Cache the blocks of a tile that begin at `corners`, if there is room for them.

        The tile has a margin of one pixel. The corners, (k, 2), are the row and column of each block's first
        pixel within the window.
        """
        size = len(corners) * CACHED_SIDE * CACHED_SIDE * (2 if tile.all_valid else 3)
        with self._lock:
            if size == 0 or size > self._free:
                return
            self._free -= size
        valid = None if tile.all_valid else _crop_blocks(tile.valid, corners)
        self._tiles[window] = _crop_blocks(tile.grey, corners), valid

    def take(self, window: Window) -> CachedBlocks | None:
        """Remove and return the cached blocks of a tile; None if there are none."""
        return self._tiles.pop(window, None)


def _crop_blocks(image: NDArray[Any], corners: Integers) -> NDArray[Any]:
    """Stack the blocks that begin at `corners` of an array with a border of one pixel vertically."""
    blocks = np.empty((len(corners), CACHED_SIDE, CACHED_SIDE), image.dtype)
    for block, (row, col) in zip(blocks, corners, strict=True):
        block[:] = image[row : row + CACHED_SIDE, col : col + CACHED_SIDE]
    return blocks.reshape(-1, CACHED_SIDE)


_WINDOWS, _MIN_STEPS = (6, 24, 96), 4096  # along each side; more where windows hold fewer steps


def with_statistics(source: GreySource, tile_pass: TilePass) -> GreySource:
    """Return a source with its statistics and large step, from windows spread evenly over the raster."""
    for along in _WINDOWS:
        windows = spread_windows(source.shape, along, BLOCK)
        parts = list(tile_pass.silent.run(partial(_statistics, source), windows))
        steps, greys = (np.concatenate(part) for part in zip(*parts, strict=True))
        if len(steps) >= _MIN_STEPS:
            break
    steps, greys = (part if len(part) else np.zeros(1, np.uint16) for part in (steps, greys))
    counts = np.bincount(greys).astype(np.float64)
    shares, means = counts.cumsum() / len(greys), (counts * np.arange(len(counts))).cumsum() / len(greys)
    inner = (shares > 0) & (shares < 1)
    between = (means[-1] * shares - means)[inner] ** 2 / (shares * (1 - shares))[inner]
    variance = float(greys.var())
    found = Statistics(
        mean_step=float(steps.mean()),
        deviation=variance**0.5,
        separability=float(between.max(initial=0)) / variance if variance else 0.0,
    )
    return replace(source, statistics=found, large_step=int(np.quantile(steps, 0.9, method="lower")))


def _statistics(source: GreySource, window: Window) -> tuple[Uint16s, Uint16s]:
    """Return the absolute differences of adjacent valid pixels of a window, and the grey of valid pixels."""
    tile = source.read(window, 0)
    grey, valid = tile.grey.astype(np.int32), tile.valid != 0
    down = abs(np.diff(grey, axis=0))[valid[1:] & valid[:-1]]
    across = abs(np.diff(grey, axis=1))[valid[:, 1:] & valid[:, :-1]]
    return np.concatenate([down, across]).astype(np.uint16), tile.grey[valid]


def measure_illumination(source: GreySource, width: tuple[int, int], tile_pass: TilePass) -> Illumination:
    """Measure the illumination of a raster; sums are integers, so tiles and their order change nothing.

    The source is not flattened. `width` is in rows and columns of pixels; variation over less than that
    stays.
    """
    step = square_side(width)
    shape = -(-source.shape[0] // step), -(-source.shape[1] // step)
    sums, counts = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    results = tile_pass.run(partial(_tile_sums, source, step))
    for window, result in zip(tile_pass.windows, results, strict=True):
        if result is not None:
            row, col = window.row // step, window.col // step
            rows, cols = result[0].shape
            sums[row : row + rows, col : col + cols] += result[0]
            counts[row : row + rows, col : col + cols] += result[1]
    return fit_illumination(sums, counts, step, width)


def _tile_sums(source: GreySource, step: int, window: Window) -> tuple[Integers, Integers] | None:
    """Sum and count the valid pixels of a window by the squares that it touches."""
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, 0)
    sums, counts = cell_sums(tile.grey, tile.valid)
    cells = -(-window.rows // CELL), -(-window.cols // CELL)
    return tuple(_by_squares(array[: cells[0], : cells[1]], step, window) for array in (sums, counts))  # type: ignore[return-value]


def _by_squares(cells: Uint32s | Uint8s, step: int, window: Window) -> Integers:
    """Add up the cells of a window by the squares in which they lie."""
    total = cells.astype(np.int64)
    for axis, first in enumerate((window.row, window.col)):
        squares = (first // CELL + np.arange(total.shape[axis])) // (step // CELL)
        total = np.add.reduceat(total, np.flatnonzero(np.diff(squares, prepend=-1)), axis=axis)
    return total
