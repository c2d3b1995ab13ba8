"""The largest window of texture that fits into a sample."""

import numpy as np
from numpy.typing import NDArray

from uavseg.regions.sample.place import SampleMask
from uavseg.segmentation.sample.g_scores import min_count
from uavseg.units import CELL

USUAL_WINDOWS = (32, 24, 16)  # pixels
_WINDOWS_IN_SAMPLE = 3  # least area of a sample, in windows: that of a disc with the side as radius


def fitting_window(place: SampleMask) -> int | None:
    """Side in pixels of the largest usual window that fits into a sample; None where none does.

    Parameters
    ----------
    place : SampleMask
    """
    counts = _cell_counts(place)
    for side in USUAL_WINDOWS:
        if counts.sum() >= _WINDOWS_IN_SAMPLE * side**2 and _holds(counts, side // CELL):
            return side
    return None


def _cell_counts(place: SampleMask) -> NDArray[np.int64]:
    mask = place.mask
    rows, cols = (-(-length // CELL) for length in mask.shape)
    padded = np.pad(mask, ((0, rows * CELL - mask.shape[0]), (0, cols * CELL - mask.shape[1])))
    counts: NDArray[np.int64] = padded.reshape(rows, CELL, cols, CELL).sum((1, 3), dtype=np.int64)
    return counts


def _holds(counts: NDArray[np.int64], side: int) -> bool:
    """Whether some window of so many cells is covered well enough to have a score."""
    if min(counts.shape) < side:
        return False
    windows = np.lib.stride_tricks.sliding_window_view(counts, (side, side))
    return bool(windows.sum((2, 3)).max() >= min_count(side))
