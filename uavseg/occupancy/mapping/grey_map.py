"""Grey map: the 16-bit grey of an occupancy map, its cell sums, and a log of the blocks that changed."""

from dataclasses import dataclass, field
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import whole_blocks
from uavseg.segmentation.blocks.block_map import cell_sums
from uavseg.units import BLOCK

Mask = NDArray[np.bool_]
NeighbourBits = NDArray[np.uint16]

NEIGHBOURS = 9  # bits of a changed block: the 3 x 3 blocks around that the change affects, in raster order
SELF = 4  # the block itself, in the middle
_ALL = (1 << NEIGHBOURS) - 1


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class ChangeLog:
    """Changes of a grey map that one observer has not read yet.

    Parameters
    ----------
    changed : (B, C) uint16 array
        As in `GreyMap`.
    """

    changed: NeighbourBits

    def pop(self) -> tuple[Mask, Mask]:
        """Read the changes and clear them.

        Returns
        -------
        changed, affected : (B, C) bool arrays
            Blocks whose grey has changed, and blocks with a changed pixel in them or next to them.
        """
        rows, cols = self.changed.shape
        around = np.zeros((rows + 2, cols + 2), bool)
        if self.changed.any():
            for k in range(NEIGHBOURS):
                around[k // 3 : k // 3 + rows, k % 3 : k % 3 + cols] |= (self.changed >> k & 1) > 0
        own = (self.changed >> SELF & 1) > 0
        self.changed[:] = 0
        return own, around[1:-1, 1:-1]


@dataclass(frozen=True, slots=True, eq=False)
class GreyMap:
    """The grey of a map that changes.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the map in pixels.
    grey : (M + 2, N + 2) uint16 array
        Padded to whole blocks of 64, with a border of one pixel; 0 outside the map.
    valid : (M + 2, N + 2) uint8 array
        1 in the map.
    sums, counts : (8 B, 8 C) uint32 and uint8 arrays
        Of the valid grey of cells of 8 x 8, as in a `BlockMap`.
    changed : (B, C) uint16 array
        Changes of each block since they were last copied to the change logs. A bit is set for each of the
        3 x 3 blocks around, in raster order, in which or next to which a pixel has changed its grey.
    """

    shape: tuple[int, int]
    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]
    sums: NDArray[np.uint32]
    counts: NDArray[np.uint8]
    changed: NeighbourBits
    _logs: "WeakSet[ChangeLog]" = field(default_factory=WeakSet, repr=False)

    @classmethod
    def empty(cls, shape: tuple[int, int]) -> "GreyMap":
        """A map of so many rows and columns, 0 everywhere."""
        rows, cols = (whole_blocks(length) for length in shape)
        valid = np.zeros((rows + 2, cols + 2), np.uint8)
        valid[1 : shape[0] + 1, 1 : shape[1] + 1] = 1
        changed = np.zeros((rows // BLOCK, cols // BLOCK), np.uint16)
        grey = np.zeros(valid.shape, np.uint16)
        return cls(shape, grey, valid, *cell_sums(grey, valid, 1), changed)

    def set_grey(self, grey: NDArray[np.uint16]) -> None:
        """Set the grey of the whole map, a (rows, cols) array; all blocks count as changed."""
        self.grey[1 : self.shape[0] + 1, 1 : self.shape[1] + 1] = grey
        self.sums[:] = cell_sums(self.grey, self.valid, 1)[0]
        self.changed[:] = _ALL

    def new_log(self) -> ChangeLog:
        """A log of the changes from now on, kept for as long as the caller holds it."""
        self.flush_changes()
        log = ChangeLog(np.zeros(self.changed.shape, np.uint16))
        self._logs.add(log)
        return log

    def flush_changes(self) -> None:
        """Copy the changes to all logs and clear them here."""
        for log in self._logs:
            log.changed[:] |= self.changed
        self.changed[:] = 0
