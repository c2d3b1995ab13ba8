"""Segments of several intervals together: the kinds of cells, refined to the pixel tile by tile."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import Window
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cell_kinds, cells_to_pixels, mixed_cells_of_kinds
from uavseg.segmentation.params import Refinement, SegmentParams
from uavseg.segmentation.partition import Partition
from uavseg.segmentation.pipeline import every_cell
from uavseg.segmentation.refine.range_scans import REFINE_HALO
from uavseg.segmentation.refine.tv import refine_kinds_by_tv
from uavseg.segmentation.source import GreySource, GreyTile
from uavseg.units import MAX_KINDS

_KIND = np.uint8(MAX_KINDS)
_MIXED = np.uint8(MAX_KINDS + 1)  # a bit that no kind has


def kinds_to_refine(blocks: BlockMap, partition: Partition, params: SegmentParams) -> NDArray[Any]:
    """The kind of each cell by the mean of its leaf; with a bit where each pixel is classified.

    Parameters
    ----------
    blocks : BlockMap
    partition : Partition
        Of at most `MAX_KINDS` kinds, unless cells are not refined.
    params : SegmentParams

    Returns
    -------
    cells : (8 B, 8 C) uint8 or uint32 array
        For `refine_kinds_of_tile`, or kinds alone if cells are not refined.
    """
    if params.refine == "pixels":
        return every_cell(blocks.shape)
    kinds = cell_kinds(blocks, partition, params.division)
    if params.refine == "tv":
        kinds |= _MIXED * mixed_cells_of_kinds(blocks, kinds, partition)
    return kinds


def refine_kinds_of_tile(
    source: GreySource, cells: NDArray[np.uint8], table: NDArray[np.uint8], refine: Refinement, window: Window
) -> tuple[NDArray[np.uint8], GreyTile] | None:
    """Refine the segments of a tile to the pixel; see `pipeline.refine_tile`.

    Parameters
    ----------
    source : GreySource
    cells : (m, n) uint8 array
        Cells of the window with a halo of REFINE_HALO, from `kinds_to_refine`; 0 outside the raster.
    table : (65536,) uint8 array
        The kind of each grey.
    refine : {"tv", "pixels"}
    window : Window

    Returns
    -------
    kinds : (M + 2 REFINE_HALO, N + 2 REFINE_HALO) uint8 array
        The kind of each pixel, 0 for none; exact on the window and a border of one pixel.
    tile : GreyTile
        Grey of the same pixels; None in place of both where no cell has a kind.
    """
    if not cells.any():
        return None
    tile = source.read(window, REFINE_HALO, beyond=True)
    if refine == "pixels":
        return table[tile.grey] * tile.valid, tile
    kinds = cells_to_pixels(cells & _KIND, tile.valid)
    refine_kinds_by_tv(kinds, cells & _MIXED, tile.valid, tile.grey, table)
    return kinds, tile
