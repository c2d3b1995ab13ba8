"""GreySource: windowed reads of a dataset as 16-bit grey."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.dataset import Dataset
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.tiling import Window, whole_blocks


@dataclass(frozen=True, slots=True)
class GreyTile:
    """Grey of a window with a margin; pixels outside the raster are invalid.

    Parameters
    ----------
    grey : (M + 2 m, N + 2 m) uint16 array
        0 where invalid; M and N are the window's sides, rounded up to whole blocks.
    valid : (M + 2 m, N + 2 m) uint8 array
        1 where a pixel is valid.
    all_valid : bool
        Whether every pixel of the array is valid.
    """

    grey: NDArray[np.uint16]
    valid: NDArray[np.uint8]
    all_valid: bool

    @property
    def mask(self) -> NDArray[np.uint8] | None:
        """`valid`, or None where every pixel is valid."""
        return None if self.all_valid else self.valid


@dataclass(frozen=True)
class GreySource:
    """A dataset and the stretch that maps its values to grey."""

    dataset: Dataset
    stretch: Stretch

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.dataset.geobox.shape

    def read(self, window: Window, margin: int) -> GreyTile:
        """Read the grey of a window with `margin` more pixels on every side."""
        shape = (whole_blocks(window.rows) + 2 * margin, whole_blocks(window.cols) + 2 * margin)
        part = window.grown(margin).clipped(self.shape)
        values, mask = self.dataset.read(part)
        pixels = self.stretch.apply(values, mask)
        if part.rows == shape[0] and part.cols == shape[1]:
            valid = np.ones(shape, np.uint8) if mask is None else mask.view(np.uint8)
            return GreyTile(np.ascontiguousarray(pixels), np.ascontiguousarray(valid), mask is None)
        grey, valid = np.zeros(shape, np.uint16), np.zeros(shape, np.uint8)
        inner = Window(part.row - window.row + margin, part.col - window.col + margin, part.rows, part.cols)
        grey[inner.slices] = pixels
        valid[inner.slices] = 1 if mask is None else mask
        return GreyTile(grey, valid, False)
