"""Ranges in a picture: the cells of each in its colour, translucent over grey."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.plot.frame import Frame
from uavseg.plot.layers.raster_layer import show
from uavseg.raster.geobox import GeoBox, scaled
from uavseg.units import CELL

COLORS = ("#3b5bdb", "#19c3f0", "#2fd05f", "#b5e61d", "#ffe119", "#ff8c1a", "#e8362e", "#f032e6")
ALPHA = 0.42
OVER_CELLS = 2.2  # zorder


def colors_of(count: int) -> list[str]:
    """A colour for each of some ranges, the darkest range first.

    Examples
    --------
    >>> colors_of(2)
    ['#3b5bdb', '#e8362e']
    """
    last = len(COLORS) - 2 if count < len(COLORS) else len(COLORS) - 1
    return [COLORS[round(k * last / max(count - 1, 1))] for k in range(count)]


@dataclass(frozen=True)
class RangeLayer:
    """Ranges on the sheet.

    Parameters
    ----------
    intervals : (rows, cols) uint8 array
        The range of each pixel of the layer, counted from 1; 0 for none.
    pixels : Affine
        From pixel corners (col, row) of the layer to the sheet.
    count : int
        Number of ranges.
    """

    intervals: NDArray[np.uint8]
    pixels: Affine
    count: int

    @classmethod
    def of(cls, intervals: NDArray[np.uint8], count: int, frame: Frame, most: int) -> "RangeLayer":
        """The ranges of cells of 8 x 8 pixels, in at most `most` rows and columns."""
        return cls(*spread(intervals, frame, most), count)

    def draw(self, ax: Any) -> None:
        """Draw on axes."""
        from matplotlib.colors import to_rgba

        table = np.zeros((self.count + 1, 4), np.uint8)
        for k, color in enumerate(colors_of(self.count), start=1):
            table[k] = np.round(255 * np.array(to_rgba(color, ALPHA)))
        show(ax, table[self.intervals], self.pixels, zorder=OVER_CELLS)


def draw_cells(ax: Any, greys: NDArray[np.uint8], known: NDArray[np.bool_], frame: Frame, most: int) -> None:
    """Cells of 8 x 8 pixels in grey, where there is no raster to draw."""
    shown, pixels = spread(greys, frame, most)
    alpha, _ = spread(np.where(known, np.uint8(255), np.uint8(0)), frame, most)
    show(ax, np.stack([shown, shown, shown, alpha], axis=-1), pixels, zorder=2)


def spread(cells: NDArray[np.uint8], frame: Frame, most: int) -> tuple[NDArray[np.uint8], Affine]:
    """Cells as a picture of exactly the raster's ground: each pixel shows the cell that its middle is in.

    Returns
    -------
    picture : (rows, cols) uint8 array
        At most `most` of both.
    pixels : Affine
        From its pixel corners (col, row) to the sheet.
    """
    box: GeoBox = frame.geobox
    step = max(-(-max(box.shape) // most), 1)
    rows, cols = (max(length // step, 1) for length in box.shape)
    row, col = (
        ((np.arange(n) + 0.5) * length / n).astype(np.int64) // CELL
        for n, length in zip((rows, cols), box.shape, strict=True)
    )
    pixels = frame.affine * scaled(box.transform, box.shape[0] / rows, box.shape[1] / cols)
    return cells[np.ix_(row, col)], pixels
