"""Which leaves, and which pixels, belong together: by a range of intensity."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg._jit import kernel
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


def pixels_of(cells: NDArray[np.uint8], valid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The valid pixels of cells.

    Parameters
    ----------
    cells : (m, n) uint8 array, 1 in range
    valid : (8 m, 8 n) uint8 array

    Returns
    -------
    pixels : (8 m, 8 n) uint8 array
    """
    pixels = np.empty_like(valid)
    _spread(cells, valid, pixels)
    return pixels


def matching(grey: NDArray[np.uint16], valid: NDArray[np.uint8], low: int, high: int) -> NDArray[np.uint8]:
    """The valid pixels whose own grey lies in low..high, both ends in it.

    Parameters
    ----------
    grey : (M, N) uint16 array
    valid : (M, N) uint8 array
    low, high : int
        See `IntensityRange.greys`; low is larger than high where no grey lies in the range.

    Returns
    -------
    matching : (M, N) uint8 array
    """
    fits = np.empty_like(valid)
    _match(grey.reshape(-1), valid.reshape(-1), low, high, fits.reshape(-1))
    return fits


@kernel("void(u1[:,::1], u1[:,::1], u1[:,::1])")
def _spread(cells, valid, pixels):  # type: ignore[no-untyped-def]
    for r in range(pixels.shape[0]):
        for cell in range(cells.shape[1]):
            own = cells[r // 8, cell]
            for c in range(8 * cell, 8 * cell + 8):
                pixels[r, c] = own & valid[r, c]


@kernel("void(u2[::1], u1[::1], i8, i8, u1[::1])")
def _match(grey, valid, low, high, fits):  # type: ignore[no-untyped-def]
    least = np.uint16(max(low, 0))
    most = np.uint16(max(high, 0))
    for i in range(grey.size):
        fits[i] = np.uint8(grey[i] >= least) & np.uint8(grey[i] <= most) & valid[i]
