"""Grey map: the 16-bit grey of an occupancy map, its cell sums, and a log of the blocks that changed."""

from dataclasses import field
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.raster.grid.tiling import whole_blocks
from uavseg.segmentation.blocks.block_map import cell_sums
from uavseg.units import BLOCK

Mask = NDArray[np.bool_]
NeighbourBits = NDArray[np.uint16]

NEIGHBOURS = 9  # bits of a changed block: the 3 x 3 blocks around it that the change affects, by rows
SELF = 4  # the block itself, in the middle
_ALL = (1 << NEIGHBOURS) - 1


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class ChangeLog:
    """Changes of a grey map that one observer has not read yet."""

    changed: NeighbourBits  # (B, C) uint16; as in `GreyMap`

    def pop(self) -> tuple[Mask, Mask]:
        """Read the changes and clear them.

        The results (B, C) are blocks whose grey has changed, and blocks with a changed pixel in or next to
        them.
        """
        rows, cols = self.changed.shape
        around = np.zeros((rows + 2, cols + 2), bool)
        if self.changed.any():
            for k in range(NEIGHBOURS):
                around[k // 3 : k // 3 + rows, k % 3 : k % 3 + cols] |= (self.changed >> k & 1) > 0
        changed = (self.changed >> SELF & 1) > 0
        self.changed[:] = 0
        return changed, around[1:-1, 1:-1]


@dataclass(frozen=True, slots=True, eq=False)
class GreyMap:
    """The grey of a map that changes."""

    shape: tuple[int, int]  # rows and columns of the map in pixels
    # (M + 2, N + 2) uint16; padded to whole blocks of 64, with a border of one pixel; 0 outside the map.
    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]  # (M + 2, N + 2) uint8; 1 in the map
    sums: NDArray[np.uint32]  # (8 B, 8 C); valid grey of cells of 8 x 8, as in a `BlockMap`
    counts: NDArray[np.uint8]  # (8 B, 8 C)
    # (B, C) uint16; changes of each block since they were last copied to the change logs. A bit is set for
    # each of the 3 x 3 blocks around, in raster order, in which or next to which a pixel has changed its
    # grey.
    changed: NeighbourBits
    _logs: "WeakSet[ChangeLog]" = field(default_factory=WeakSet, repr=False)

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> "GreyMap":
        """Make a map of a number of rows and columns, 0 everywhere."""
        rows, cols = (whole_blocks(length) for length in shape)
        valid = np.zeros((rows + 2, cols + 2), np.uint8)
        valid[1 : shape[0] + 1, 1 : shape[1] + 1] = 1
        changed = np.zeros((rows // BLOCK, cols // BLOCK), np.uint16)
        grey = np.zeros(valid.shape, np.uint16)
        sums, counts = cell_sums(grey, valid, 1)
        return cls(shape=shape, grey=grey, valid=valid, sums=sums, counts=counts, changed=changed)

    def set_grey(self, grey: NDArray[np.uint16]) -> None:
        """Set the grey of the whole map, a (rows, cols) array; all blocks count as changed."""
        self.grey[1 : self.shape[0] + 1, 1 : self.shape[1] + 1] = grey
        self.sums[:] = cell_sums(self.grey, self.valid, 1)[0]
        self.changed[:] = _ALL

    def new_log(self) -> ChangeLog:
        """Return a log of the changes from now on, kept as long as the caller holds it."""
        self.flush_changes()
        log = ChangeLog(np.zeros(self.changed.shape, np.uint16))
        self._logs.add(log)
        return log

    def flush_changes(self) -> None:
        """Copy the changes to all logs and clear them here."""
        for log in self._logs:
            log.changed[:] |= self.changed
        self.changed[:] = 0
