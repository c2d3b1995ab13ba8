"""Ground: the grey of a map that changes, and for everybody who watches it, what has changed."""

from dataclasses import dataclass, field
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import whole_blocks
from uavseg.segmentation.blocks.block_map import cell_sums
from uavseg.units import BLOCK

Mask = NDArray[np.bool_]
Bits = NDArray[np.uint16]

NEIGHBOURS = 9  # bits of what has changed in a block: who of the 3 x 3 blocks around sees it, in raster order
SELF = 4  # the one in the middle
_ALL = (1 << NEIGHBOURS) - 1


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Watch:
    """What has changed since somebody looked, as in `Ground`."""

    changed: Bits

    def taken(self) -> tuple[Mask, Mask]:
        """The blocks whose grey has changed, and those that see a change; from now on they count as seen."""
        rows, cols = self.changed.shape
        around = np.zeros((rows + 2, cols + 2), bool)
        if self.changed.any():
            for k in range(NEIGHBOURS):
                around[k // 3 : k // 3 + rows, k % 3 : k % 3 + cols] |= (self.changed >> k & 1) > 0
        own = (self.changed >> SELF & 1) > 0
        self.changed[:] = 0
        return own, around[1:-1, 1:-1]


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The grey of a map that changes.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the map in pixels.
    grey : (M + 2, N + 2) uint16 array
        Up to whole blocks of 64, with a border of one pixel; 0 outside the map.
    valid : (M + 2, N + 2) uint8 array
        1 in the map.
    sums, counts : (8 B, 8 C) uint32 and uint8 arrays
        Of the valid grey of cells of 8 x 8, as in a `BlockMap`.
    changed : (B, C) uint16 array
        What has changed in each block since it was handed to those who watch. A bit is set for each block
        among the 3 x 3 around, in raster order, which a pixel whose grey has changed lies in or next to.
    """

    shape: tuple[int, int]
    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]
    sums: NDArray[np.uint32]
    counts: NDArray[np.uint8]
    changed: Bits
    _watches: "WeakSet[Watch]" = field(default_factory=WeakSet, repr=False)

    @classmethod
    def of(cls, shape: tuple[int, int]) -> "Ground":
        """The ground of a map whose grey was not shown yet."""
        rows, cols = (whole_blocks(length) for length in shape)
        valid = np.zeros((rows + 2, cols + 2), np.uint8)
        valid[1 : shape[0] + 1, 1 : shape[1] + 1] = 1
        changed = np.zeros((rows // BLOCK, cols // BLOCK), np.uint16)
        grey = np.zeros(valid.shape, np.uint16)
        return cls(shape, grey, valid, *cell_sums(grey, valid, 1), changed)

    def show(self, grey: NDArray[np.uint16]) -> None:
        """Take the grey of the whole map."""
        self.grey[1 : self.shape[0] + 1, 1 : self.shape[1] + 1] = grey
        self.sums[:] = cell_sums(self.grey, self.valid, 1)[0]
        self.changed[:] = _ALL

    def watch(self) -> Watch:
        """Begin to watch: what has changed up to now is not told."""
        self.hand_out()
        watch = Watch(np.zeros(self.changed.shape, np.uint16))
        self._watches.add(watch)
        return watch

    def hand_out(self) -> None:
        """Tell those who watch what has changed."""
        for watch in self._watches:
            watch.changed[:] |= self.changed
        self.changed[:] = 0
