"""Which leaves belong together: by a range of mean intensity."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import IntensityRangeError
from uavseg.segmentation.blockmap import FULL, BlockMap, leaves

_STRIP = 64  # rows of blocks looked at together


@dataclass(frozen=True, slots=True)
class IntensityRange:
    """An interval of v with both ends in it.

    Raises
    ------
    IntensityRangeError
        If not 0 <= low < high <= 1.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high <= 1:
            raise IntensityRangeError(
                f"an intensity range wants 0 <= low < high <= 1, not {self.low:g},{self.high:g}"
            )

    @property
    def greys(self) -> tuple[int, int]:
        """The smallest and the largest grey g whose v = g / 65535 lies in the range."""
        v = np.arange(FULL + 1) / FULL
        return int(np.searchsorted(v, self.low, "left")), int(np.searchsorted(v, self.high, "right")) - 1


def in_range(
    blocks: BlockMap, interval: IntensityRange, threshold: float, intensity_step: float
) -> NDArray[np.uint8]:
    """Cells of the leaves whose mean lies in a range.

    Parameters
    ----------
    blocks : BlockMap
    interval : IntensityRange
    threshold, intensity_step : float
        X and tau of the division, see `blockmap.leaves`.

    Returns
    -------
    inside : (8 B, 8 C) uint8 array, 1 in range
    """
    inside = np.zeros(blocks.counts.shape, np.uint8)
    for top in range(0, blocks.blocks[0], _STRIP):
        _, mean = leaves(blocks, threshold, intensity_step, slice(top, top + _STRIP))
        inside[8 * top : 8 * (top + _STRIP)] = (mean >= interval.low) & (mean <= interval.high)
    return inside
