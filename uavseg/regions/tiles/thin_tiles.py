"""Thin lines of a tile, added to what was refined."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window, whole_blocks
from uavseg.segmentation.params.segment import IntensityRange
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.thin_lines import MARGIN, find_thin_lines
from uavseg.segmentation.source import GreySource, GreyTile

Refined = tuple[NDArray[np.uint8], GreyTile]


def with_thin_lines(
    source: GreySource, found: Refined | None, interval: IntensityRange, window: Window
) -> Refined | None:
    """The refined pixels of a tile with thin lines; None where there is nothing.

    Parameters
    ----------
    source : GreySource
    found : (pixels, tile), optional
        From `pipeline.refine_tile`.
    interval : IntensityRange
    window : Window
    """
    if found is None:
        if source.dataset.is_empty(window.grown(REFINE_HALO).clipped(source.shape)):
            return None
        side = 2 * REFINE_HALO
        shape = whole_blocks(window.rows) + side, whole_blocks(window.cols) + side
        found = np.zeros(shape, np.uint8), source.read(window, REFINE_HALO, beyond=True)
    pixels, tile = found
    inner = np.s_[REFINE_HALO - MARGIN : MARGIN - REFINE_HALO, REFINE_HALO - MARGIN : MARGIN - REFINE_HALO]
    pixels[inner] |= find_thin_lines(tile.grey, tile.valid, interval.greys, REFINE_HALO)
    return pixels, tile
