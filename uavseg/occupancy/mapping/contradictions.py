"""Evidence that is revised by contradiction: occupied cells are forgotten when scans see through them.

A scan contradicts an occupied cell if beams cross it, and none returns at it or beside it. Its free evidence
is held back; after so many contradicting scans in a row that of all of them takes the place of the cell's. A
return at the cell confirms it. Beams that graze a wall cross its edge and return behind: so a group of
contradicted cells is forgotten only if it reaches farther from what stands than an edge is thick.
"""

import numpy as np
from numpy.typing import NDArray

from uavseg.occupancy.mapping.beams import merge_beams
from uavseg.occupancy.mapping.log_odds import FREE_LOG_ODDS, MAX_LOG_ODDS, Float32s
from uavseg.occupancy.mapping.pending import UP_TO_DATE, empty_pending
from uavseg.raster.grid.tiling import Window, whole_blocks
from uavseg.units import BLOCK

MAX_FORGET_AFTER = 1_000_000
_BESIDE, _EDGE = 1, 2  # cells: around a return; thickness of the edge of what stands
_MARGIN = 8  # cells that are looked at outside of those that a scan observes
_SQUARE = np.ones((3, 3), bool)


class Contradictions:
    """Scans in a row that contradicted each cell of a map of a shape, and their log-odds."""

    def __init__(self, shape: tuple[int, int], forget_after: int) -> None:
        self.forget_after = forget_after
        self._counts, self._held = np.zeros(shape, np.uint32), np.zeros(shape, np.float32)
        self._odds, self._pending = np.zeros(shape, np.float32), empty_pending(shape)

    def observe(self, beams: NDArray[np.float64], sigma: float) -> tuple[Window, Float32s, NDArray[np.bool_]]:
        """Return a window, the log-odds that a scan alone gives its cells, and where the scan returns."""
        seen = merge_beams(self._odds, self._pending, beams, sigma)
        window = seen.grown(_MARGIN).clipped(self._odds.shape)
        first, last = window.row // BLOCK, whole_blocks(window.row + window.rows) // BLOCK
        left, right = window.col // BLOCK, whole_blocks(window.col + window.cols) // BLOCK
        blocks = self._pending[first:last, left:right]
        counts = blocks.transpose(0, 2, 4, 1, 3, 5).reshape(BLOCK * (last - first), BLOCK * (right - left))
        counts = counts[window.relative_to(Window(BLOCK * first, BLOCK * left, 0, 0)).slices]
        odds = self._odds[window.slices] + np.float32(FREE_LOG_ODDS) * (counts % UP_TO_DATE)
        blocks[:], self._odds[window.slices] = 0, 0
        return window, odds, counts >= UP_TO_DATE

    def revised(
        self, before: Float32s, after: Float32s, observed: tuple[Window, Float32s, NDArray[np.bool_]]
    ) -> Float32s:
        """Return the log-odds of the window of a scan, from those before and after it was merged."""
        from scipy import ndimage

        window, odds, returns = observed
        counts, held = self._counts[window.slices], self._held[window.slices]
        occupied = before > 0
        through = occupied & (odds < 0) & ~ndimage.binary_dilation(returns, _SQUARE, _BESIDE)
        counts[through] += 1
        held[through] += odds[through]
        confirmed = ~occupied | (odds > 0)
        counts[confirmed], held[confirmed] = 0, 0
        due = counts >= self.forget_after
        stands = ndimage.binary_dilation(occupied & ~due, _SQUARE, _EDGE)
        groups, number = ndimage.label(due, _SQUARE)
        gone = due & (np.bincount(groups[due & through & ~stands], minlength=number + 1) > 0)[groups]
        revised = np.where(occupied & (odds < 0), before, after)
        revised[gone] = np.maximum(held[gone], -MAX_LOG_ODDS)
        counts[gone], held[gone] = 0, 0
        return revised
