"""GreySource: windowed reads of a dataset as 16-bit grey."""

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window, whole_blocks
from uavseg.raster.intensity.beyond import greys_beyond
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.segmentation.params.illumination import Illumination
from uavseg.units import BLOCK


@dataclass(frozen=True, slots=True)
class GreyTile:
    """Grey of a window with a margin; pixels outside the raster are invalid.

    Parameters
    ----------
    grey : (M + 2 m, N + 2 m) uint16 array
        0 where invalid; M and N are the window's sides, rounded up to whole blocks.
    valid : (M + 2 m, N + 2 m) uint8 array
        1 where a pixel is valid.
    all_valid : bool
        Whether every pixel of the array is valid.
    beyond : (M + 2 m, N + 2 m) int32 array, optional
        By how many greys pixels lie beyond the ends of the stretch, see `greys_beyond`; None if none does, or
        it was not asked for.
    """

    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]
    all_valid: bool
    beyond: NDArray[np.int32] | None = None

    @property
    def mask(self) -> NDArray[np.uint8] | None:
        """`valid`, or None where every pixel is valid."""
        return None if self.all_valid else self.valid

    def cropped(self, margin: int) -> "GreyTile":
        """The tile without its outermost `margin` pixels on every side."""
        inner = np.s_[margin : self.grey.shape[0] - margin, margin : self.grey.shape[1] - margin]
        grey, valid = np.ascontiguousarray(self.grey[inner]), np.ascontiguousarray(self.valid[inner])
        beyond = None if self.beyond is None else np.ascontiguousarray(self.beyond[inner])
        return GreyTile(grey, valid, self.all_valid, beyond)


@dataclass(frozen=True)
class GreySource:
    """A dataset, the stretch that maps its values to grey, and the light that is taken away from grey."""

    dataset: Dataset
    stretch: Stretch
    illumination: Illumination | None = field(default=None, kw_only=True)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.dataset.geobox.shape

    @property
    def is_intensity(self) -> bool:
        """Whether grey is intensity, and not a likelihood."""
        return True

    @property
    def is_flat(self) -> bool:
        """Whether slow light is taken away, so that v no longer stands for values of the dataset."""
        return self.illumination is not None

    def read(self, window: Window, margin: int, beyond: bool = False) -> GreyTile:
        """Read the grey of a window with `margin` more pixels on every side.

        With `beyond`, also by how much pixels lie beyond the ends of the stretch, unless light is taken away.
        """
        shape = (whole_blocks(window.rows) + 2 * margin, whole_blocks(window.cols) + 2 * margin)
        part = window.grown(margin).clipped(self.shape)
        values, mask = self.dataset.read(part)
        pixels = self.stretch.apply(values, mask)
        more = greys_beyond(values, mask, pixels, self.stretch) if beyond and not self.is_flat else None
        if self.illumination is not None:
            self.illumination.subtract_from(pixels, mask, (part.row, part.col))
        if part.rows == shape[0] and part.cols == shape[1]:
            valid = np.ones(shape, np.uint8) if mask is None else mask.view(np.uint8)
            return GreyTile(np.ascontiguousarray(pixels), np.ascontiguousarray(valid), mask is None, more)
        grey, valid = np.zeros(shape, np.uint16), np.zeros(shape, np.uint8)
        inner = Window(part.row - window.row + margin, part.col - window.col + margin, part.rows, part.cols)
        grey[inner.slices] = pixels
        valid[inner.slices] = 1 if mask is None else mask
        if more is not None:
            more, read = np.zeros(shape, np.int32), more
            more[inner.slices] = read
        return GreyTile(grey, valid, False, more)


CAPACITY = 128 << 20  # bytes: the mixed blocks of a raster of about 16000 x 16000 pixels
CACHED_SIDE = BLOCK + 2  # a block with a border of one pixel


@dataclass(frozen=True, slots=True)
class CachedBlocks:
    """Blocks of one tile, stacked vertically.

    Parameters
    ----------
    grey : (66 k, 66) uint16 array
        Each block with a border of one pixel.
    valid : (66 k, 66) uint8 array or None
        1 where a pixel is valid; None where all are.
    """

    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8] | None


class BlockCache:
    """Cached blocks by tile; thread-safe. A pickled copy is empty and caches nothing."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._free = capacity
        self._tiles: dict[Window, CachedBlocks] = {}
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type["BlockCache"], tuple[int]]:
        return BlockCache, (0,)

    def fingerprint(self) -> tuple[()]:
        """Empty: no result depends on the cache."""
        return ()

    def put(self, window: Window, tile: GreyTile, corners: NDArray[np.int64]) -> None:
        """Cache the blocks of a tile that begin at `corners`, if there is room for them.

        Parameters
        ----------
        window : Window
        tile : GreyTile
            Grey with a margin of one pixel.
        corners : (k, 2) int64 array
            Row and column of each block's first pixel within the window.
        """
        size = len(corners) * CACHED_SIDE * CACHED_SIDE * (2 if tile.all_valid else 3)
        with self._lock:
            if size == 0 or size > self._free:
                return
            self._free -= size
        valid = None if tile.all_valid else _crop_blocks(tile.valid, corners)
        self._tiles[window] = CachedBlocks(_crop_blocks(tile.grey, corners), valid)

    def take(self, window: Window) -> CachedBlocks | None:
        """Remove and return the cached blocks of a tile; None if there are none."""
        return self._tiles.pop(window, None)


def _crop_blocks(image: NDArray[Any], corners: NDArray[np.int64]) -> NDArray[Any]:
    """The blocks that begin at `corners` of an array with a border of one pixel, stacked vertically."""
    blocks = np.empty((len(corners), CACHED_SIDE, CACHED_SIDE), image.dtype)
    for block, (row, col) in zip(blocks, corners, strict=True):
        block[:] = image[row : row + CACHED_SIDE, col : col + CACHED_SIDE]
    return blocks.reshape(-1, CACHED_SIDE)
