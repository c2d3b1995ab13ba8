"""Further bands in the search for regions like a sample: bounds of windows, histograms for pixels.

Texture is that of one intensity; each further band adds its bounds to the criterion of a window, and its
histogram to the decision of a pixel.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.dataclass import dataclass
from uavseg.errors import SampleError
from uavseg.raster.grid.tiling import Window
from uavseg.regions.sample.model import bounds_around
from uavseg.regions.sample.place import SampleMask
from uavseg.segmentation.sample.g_scores import GREY_BINS, MAX_SCORE, NO_SCORE, GreyBounds, min_count
from uavseg.segmentation.sample.likelihood_weights import window_sums
from uavseg.segmentation.sample.pixel_decision import ColorPlane, log_ratio
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL

Counts = NDArray[np.int64]


@dataclass(frozen=True)
class ColorBand:
    """One band of a sample: bounds of the mean of a window that is like it, and its histogram, (64,)."""

    source: GreySource
    bounds: GreyBounds
    counts: Counts


def fit_colors(sources: Sequence[GreySource], place: SampleMask, deviations: float) -> tuple[ColorBand, ...]:
    """Measure a sample in each band; refuse one without valid pixels in a band, with a SampleError.

    The mean of a window may differ by a number of standard `deviations` of the sample.
    """
    return tuple(_fit_band(source, place, deviations) for source in sources)


def _fit_band(source: GreySource, place: SampleMask, deviations: float) -> ColorBand:
    tile, rows, cols = source.read(place.window, 0), place.window.rows, place.window.cols
    grey = tile.grey[:rows, :cols][place.mask & (tile.valid[:rows, :cols] != 0)]
    if len(grey) == 0:
        raise SampleError(f"the sample has no valid pixel in {source.dataset.band_names}")
    bounds = bounds_around(float(grey.mean()), float(grey.std()), deviations)
    return ColorBand(source, bounds, np.bincount(grey >> 10, minlength=GREY_BINS).astype(np.int64))


def limit_scores(
    colors: Sequence[ColorBand], scores: NDArray[np.uint16], window: Window, side: int
) -> NDArray[np.uint16]:
    """Set scores of windows around a tile to the maximum where the mean of a band is out of bounds.

    The scores are those of `window_scores`, of the tile at `window` with a halo of ``side - 1`` cells.
    """
    for color in colors:
        tile = color.source.read(window, CELL * (side - 1))
        totals, counts = window_sums(_cell_sums(tile.grey), side), window_sums(_cell_sums(tile.valid), side)
        out = (totals < color.bounds.low * counts) | (totals > color.bounds.high * counts)
        scores = np.where(out & (scores != NO_SCORE), np.uint16(MAX_SCORE), scores)
        scores[counts < min_count(side)] = NO_SCORE
    return scores


def _cell_sums(pixels: NDArray[np.integer[Any]]) -> Counts:
    rows, cols = (length // CELL for length in pixels.shape)
    sums: Counts = pixels.reshape(rows, CELL, cols, CELL).sum(axis=(1, 3), dtype=np.int64)
    return sums


def count_colors(colors: Sequence[ColorBand], window: Window, cells: NDArray[np.bool_]) -> Counts:
    """Return histograms of the chosen cells of the tile at `window` in each band, (bands, 64) int64."""
    counts = np.zeros((len(colors), GREY_BINS), np.int64)
    chosen = cells.repeat(CELL, 0).repeat(CELL, 1)
    for k, color in enumerate(colors):
        tile = color.source.read(window, 0)
        counts[k] = np.bincount(tile.grey[chosen & (tile.valid != 0)] >> 10, minlength=GREY_BINS)
    return counts


def color_planes(
    colors: Sequence[ColorBand], rest: Counts, window: Window, margin: int
) -> tuple[ColorPlane, ...]:
    """Read the bands of a tile with a margin in pixels, each with its weights of the sample against the rest.

    `rest`, (bands, 64), are histograms of unlike cells.
    """
    tiles = (color.source.read(window, margin) for color in colors)
    return tuple(
        ColorPlane(tile.grey, tile.valid, log_ratio(color.counts, others))
        for color, others, tile in zip(colors, rest, tiles, strict=True)
    )
