"""Segments of several intervals together: the kind of each pixel, tile by tile."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.segmentation.params.segment import Refinement
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.tv import refine_kinds_by_tv
from uavseg.segmentation.source import GreySource, GreyTile


def refine_kinds_of_tile(
    source: GreySource, table: NDArray[np.uint8], refine: Refinement, window: Window
) -> tuple[NDArray[np.uint8], GreyTile] | None:
    """Decide the kinds of the pixels of a tile; see `pipeline.refine_tile`.

    Parameters
    ----------
    source : GreySource
    table : (65536,) uint8 array
        The kind of each grey.
    refine : {"tv", "pixels"}
    window : Window

    Returns
    -------
    kinds : (M + 2 REFINE_HALO, N + 2 REFINE_HALO) uint8 array
        The kind of each pixel, 0 for none; exact on the window and a border of one pixel.
    tile : GreyTile
        Grey of the same pixels; None in place of both where no pixel is valid.
    """
    if source.dataset.is_empty(window.grown(REFINE_HALO).clipped(source.shape)):
        return None
    tile = source.read(window, REFINE_HALO, beyond=True)
    kinds = table[tile.grey] * tile.valid
    if refine == "tv":
        refine_kinds_by_tv(kinds, tile.valid, tile.grey, table)
    return kinds, tile
