"""Layer of ranges: the cells or pixels of each range in its colour, translucent over grey."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from uavseg.plot.layers.raster_layer import draw_image
from uavseg.plot.page.frame import Frame
from uavseg.raster.grid.geobox import GeoBox, scaled
from uavseg.raster.grid.tiling import Window
from uavseg.raster.intensity.stretch import Stretch
from uavseg.raster.read.dataset import Dataset
from uavseg.units import CELL, GREY_MAX

RANGE_COLORS = ("#3b5bdb", "#19c3f0", "#2fd05f", "#b5e61d", "#ffe119", "#ff8c1a", "#e8362e", "#f032e6")
DARK_PART_COLOR, BRIGHT_PART_COLOR = "#19c3f0", "#f032e6"  # of ranges that are parts of the outermost ones
_ALPHA = 0.42
_ZORDER = 2.2  # zorder


def range_colors(count: int) -> list[str]:
    """Colours of `count` ranges, the darkest range first.

    Examples
    --------
    >>> range_colors(2)
    ['#3b5bdb', '#e8362e']
    """
    last = len(RANGE_COLORS) - 2 if count < len(RANGE_COLORS) else len(RANGE_COLORS) - 1
    return [RANGE_COLORS[round(k * last / max(count - 1, 1))] for k in range(count)]


@dataclass(frozen=True)
class RangeLayer:
    """Ranges in plot coordinates.

    Parameters
    ----------
    intervals : (rows, cols) uint8 array
        The range of each pixel of the layer, counted from 1; 0 for none.
    pixels : Affine
        From pixel corners (col, row) of the layer to plot coordinates.
    colors : sequence of str
        Of the ranges.
    """

    intervals: NDArray[np.uint8]
    plot_from_pixel: Affine
    colors: Sequence[str]

    @classmethod
    def of(
        cls, intervals: NDArray[np.uint8], colors: Sequence[str], frame: Frame, max_side: int
    ) -> "RangeLayer":
        """The ranges of cells of 8 x 8 pixels, upsampled to at most `max_side` rows and columns."""
        return cls(*upsample_cells(intervals, frame, max_side), colors)

    @classmethod
    def of_pixels(
        cls, coarse: Dataset, stretch: Stretch, ranges: Sequence[Any], colors: Sequence[str], frame: Frame
    ) -> "RangeLayer":
        """The ranges (low, high) of the pixels of a downsampled dataset, by their own v."""
        values, valid = coarse.read(Window(0, 0, *coarse.geobox.shape))
        v = stretch.apply(values, valid) / GREY_MAX
        intervals = np.zeros(v.shape, np.uint8)
        for kind, (low, high) in enumerate(ranges, 1):
            intervals[(v >= low) & (v <= high)] = kind
        intervals *= np.uint8(1) if valid is None else valid
        return cls(intervals, frame.plot_from_map * coarse.geobox.transform, colors)

    def draw(self, ax: Any) -> None:
        """Draw on axes."""
        from matplotlib.colors import to_rgba

        table = np.zeros((len(self.colors) + 1, 4), np.uint8)
        for k, color in enumerate(self.colors, start=1):
            table[k] = np.round(255 * np.array(to_rgba(color, _ALPHA)))
        draw_image(ax, table[self.intervals], self.plot_from_pixel, zorder=_ZORDER)


def draw_cells(
    ax: Any, greys: NDArray[np.uint8], known: NDArray[np.bool_], frame: Frame, max_side: int
) -> None:
    """Draw cells of 8 x 8 pixels in grey, in place of a raster."""
    grey, plot_from_pixel = upsample_cells(greys, frame, max_side)
    alpha, _ = upsample_cells(np.where(known, np.uint8(255), np.uint8(0)), frame, max_side)
    draw_image(ax, np.stack([grey, grey, grey, alpha], axis=-1), plot_from_pixel, zorder=2)


def upsample_cells(cells: NDArray[np.uint8], frame: Frame, max_side: int) -> tuple[NDArray[np.uint8], Affine]:
    """Upsample cells of 8 x 8 pixels to the extent of the raster (nearest neighbour).

    Parameters
    ----------
    cells : (m, n) uint8 array
    frame : Frame
    max_side : int
        Largest number of rows and columns of the result.

    Returns
    -------
    picture : (rows, cols) uint8 array
    pixels : Affine
        From its pixel corners (col, row) to plot coordinates.
    """
    box: GeoBox = frame.geobox
    step = max(-(-max(box.shape) // max_side), 1)
    rows, cols = (max(length // step, 1) for length in box.shape)
    row, col = (
        ((np.arange(n) + 0.5) * length / n).astype(np.int64) // CELL
        for n, length in zip((rows, cols), box.shape, strict=True)
    )
    plot_from_pixel = frame.plot_from_map * scaled(box.transform, box.shape[0] / rows, box.shape[1] / cols)
    return cells[np.ix_(row, col)], plot_from_pixel
