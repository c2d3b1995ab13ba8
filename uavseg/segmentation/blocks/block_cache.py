"""Grey of blocks that will be looked at again, kept between two passes while there is room.

Nothing depends on whether a block was kept: what is not here is read again.
"""

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import Window
from uavseg.segmentation.source import GreyTile
from uavseg.units import BLOCK

ROOM = 128 << 20  # bytes: the mixed blocks of a raster of about 16000 x 16000 pixels
SIDE = BLOCK + 2  # a block with the pixels around it


@dataclass(frozen=True, slots=True)
class Patch:
    """Blocks of one tile, one under the other.

    Parameters
    ----------
    grey : (66 k, 66) uint16 array
        Each block with a border of one pixel.
    valid : (66 k, 66) uint8 array or None
        1 where a pixel is valid; None where all are.
    """

    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8] | None


class Patches:
    """Patches by the tile that they are from; pickled, it arrives empty and keeps nothing."""

    def __init__(self, room: int = ROOM) -> None:
        self._room = room
        self._kept: dict[Window, Patch] = {}
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type["Patches"], tuple[int]]:
        return Patches, (0,)

    def fingerprint(self) -> tuple[()]:
        """Nothing: no result depends on what is here."""
        return ()

    def put(self, window: Window, tile: GreyTile, corners: NDArray[np.int64]) -> None:
        """Keep the blocks of a tile that begin at `corners`, (k, 2), if there is room for them.

        Parameters
        ----------
        window : Window
        tile : GreyTile
            With a margin of one pixel.
        corners : (k, 2) int64 array
            Row and column of each block's first pixel within the window.
        """
        size = len(corners) * SIDE * SIDE * (2 if tile.every else 3)
        with self._lock:
            if size == 0 or size > self._room:
                return
            self._room -= size
        valid = None if tile.every else _cut(tile.valid, corners)
        self._kept[window] = Patch(_cut(tile.grey, corners), valid)

    def take(self, window: Window) -> Patch | None:
        """The blocks kept of a tile, which are then no longer here; None if there are none."""
        return self._kept.pop(window, None)


def _cut(image: NDArray[Any], corners: NDArray[np.int64]) -> NDArray[Any]:
    patches = np.empty((len(corners), SIDE, SIDE), image.dtype)
    for patch, (row, col) in zip(patches, corners, strict=True):
        patch[:] = image[row : row + SIDE, col : col + SIDE]
    return patches.reshape(-1, SIDE)
