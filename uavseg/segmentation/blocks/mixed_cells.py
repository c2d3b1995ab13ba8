"""Mixed cells: cells that may straddle a bound of the range, found from the block map alone."""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.blocks.block_map import BlockMap, mean_v

_MARGIN = 2.0  # part of a cell may lie this many times farther from the mean than the cells around it


def mixed_cells(blocks: BlockMap, inside: NDArray[np.uint8], low: float, high: float) -> NDArray[np.uint8]:
    """Cells whose pixels may lie on both sides of a bound of the range.

    A cell is not mixed where its leaf and the leaves of its eight neighbours are on the same side, and the
    means of these nine cells lie on that side too, farther from the bound than `_MARGIN` times their range:
    a road of 3 pixels shifts the mean of a cell by a third of the road's contrast.

    Parameters
    ----------
    blocks : BlockMap
    inside : (8 B, 8 C) uint8 array
        1 where a cell's leaf is in range.
    low, high : float
        The range of v.

    Returns
    -------
    mixed : (8 B, 8 C) uint8 array
    """
    mixed = np.zeros_like(inside)
    bounds = np.array([bound for bound in (low, high) if 0 < bound < 1])  # nothing lies beyond 0 and 1
    _mixed_cells(blocks.sums, blocks.counts, inside, low, high, bounds, _MARGIN, mixed)
    return mixed


@kernel("void(u4[:,::1], u1[:,::1], u1[:,::1], f8, f8, f8[::1], f8, u1[:,::1])")
def _mixed_cells(sums, counts, inside, low, high, bounds, margin, mixed):  # type: ignore[no-untyped-def]
    rows, cols = counts.shape
    for row in range(rows):
        for col in range(cols):
            own = mean_v(sums, counts, row, col, 1)
            if own < 0.0:
                continue
            differs = (low <= own and own <= high) != (inside[row, col] != 0)
            minimum = own
            maximum = own
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(max(col - 1, 0), min(col + 2, cols)):
                    mean = mean_v(sums, counts, r, c, 1)
                    if mean >= 0.0:
                        minimum = min(minimum, mean)
                        maximum = max(maximum, mean)
                        differs |= inside[r, c] != inside[row, col]
            distance = margin * (maximum - minimum)
            for k in range(bounds.shape[0]):
                differs |= minimum - distance <= bounds[k] and bounds[k] <= maximum + distance
            mixed[row, col] = differs
