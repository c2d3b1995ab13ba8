"""A dataset seen through a stretch: grey by window."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.tiling import Window, whole_blocks


@dataclass(frozen=True, slots=True)
class GreyTile:
    """Grey of a window with a margin; what lies outside the raster is invalid.

    Parameters
    ----------
    grey : (M + 2 m, N + 2 m) uint16 array
        0 where invalid; M and N are the window's sides, rounded up to whole blocks.
    valid : (M + 2 m, N + 2 m) uint8 array
    every : bool
        Whether all of it is valid.
    """

    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]
    every: bool


@dataclass(frozen=True)
class GreySource:
    """A dataset seen through a stretch."""

    dataset: Dataset
    stretch: Stretch

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.dataset.geobox.shape

    def read(self, window: Window, margin: int) -> GreyTile:
        """The grey of a window with `margin` pixels more on every side."""
        shape = (whole_blocks(window.rows) + 2 * margin, whole_blocks(window.cols) + 2 * margin)
        part = window.grown(margin).clipped(self.shape)
        values, known = self.dataset.read(part)
        pixels = self.stretch.apply(values, known)
        if part.rows == shape[0] and part.cols == shape[1]:
            whole = np.ones(shape, np.uint8) if known is None else known.view(np.uint8)
            return GreyTile(np.ascontiguousarray(pixels), np.ascontiguousarray(whole), known is None)
        grey, valid = np.zeros(shape, np.uint16), np.zeros(shape, np.uint8)
        place = Window(part.row - window.row + margin, part.col - window.col + margin, part.rows, part.cols)
        grey[place.slices] = pixels
        valid[place.slices] = 1 if known is None else known
        return GreyTile(grey, valid, False)
