"""Which cells may hold pixels on both sides of an end of a range, from the block map alone."""

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
from uavseg.segmentation.blocks.block_map import BlockMap, mean_v

_MARGIN = 2.0  # how much farther the mean of a part of a cell may lie away than those of cells do


def mixed_cells(blocks: BlockMap, inside: NDArray[np.uint8], low: float, high: float) -> NDArray[np.uint8]:
    """Cells whose pixels may lie on both sides of an end of the range.

    A cell is settled where its leaf and the leaves of the eight cells around are on the same side, and the
    means of these nine cells lie on that side too, farther from the end than `_MARGIN` times what they lie
    apart: a road of 3 pixels moves the mean of a cell by a third of how far it stands out.

    Parameters
    ----------
    blocks : BlockMap
    inside : (8 B, 8 C) uint8 array
        1 where a cell's leaf is in range.
    low, high : float
        The range of v.

    Returns
    -------
    unsettled : (8 B, 8 C) uint8 array
    """
    found = np.zeros_like(inside)
    ends = np.array([end for end in (low, high) if 0 < end < 1])  # nothing lies beyond 0 and 1
    _mixed_cells(blocks.sums, blocks.counts, inside, low, high, ends, _MARGIN, found)
    return found


@kernel("void(u4[:,::1], u1[:,::1], u1[:,::1], f8, f8, f8[::1], f8, u1[:,::1])")
def _mixed_cells(sums, counts, inside, low, high, ends, margin, found):  # type: ignore[no-untyped-def]
    rows, cols = counts.shape
    for row in range(rows):
        for col in range(cols):
            own = mean_v(sums, counts, row, col, 1)
            if own < 0.0:
                continue
            differs = (low <= own and own <= high) != (inside[row, col] != 0)
            least = own
            most = own
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(max(col - 1, 0), min(col + 2, cols)):
                    mean = mean_v(sums, counts, r, c, 1)
                    if mean >= 0.0:
                        least = min(least, mean)
                        most = max(most, mean)
                        differs |= inside[r, c] != inside[row, col]
            spread = margin * (most - least)
            for k in range(ends.shape[0]):
                differs |= least - spread <= ends[k] and ends[k] <= most + spread
            found[row, col] = differs
