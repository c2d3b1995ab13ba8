"""Cells of 8 pixels that lie within regions as a whole."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.regions.outline.rasterise import EdgeTable, edge_tables
from uavseg.regions.outline.rings import Rings
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.units import CELL


def inner_cells(rings: Rings, shape: tuple[int, int], tile_pass: TilePass) -> NDArray[np.bool_]:
    """Cells all of whose pixels lie in regions.

    Parameters
    ----------
    rings : Rings
        Outlines of the regions.
    shape : (int, int)
        Rows and columns of the raster.
    tile_pass : TilePass

    Returns
    -------
    inner : (8 B, 8 C) bool array
        False for cells that reach past the ends of the raster.
    """
    inner = np.zeros(BlockMap.empty(shape).counts.shape, bool)
    found = tile_pass.run(_whole_cells, edge_tables(rings, tile_pass.windows))
    for window, cells in zip(tile_pass.windows, found, strict=True):
        first = Window(window.row // CELL, window.col // CELL, *cells.shape)
        inner[first.slices] = cells
    return inner


def _whole_cells(table: EdgeTable) -> NDArray[np.bool_]:
    labels = table.rasterise()
    rows, cols = (length // CELL for length in labels.shape)
    inside = labels[: rows * CELL, : cols * CELL].reshape(rows, CELL, cols, CELL) > 0
    return np.asarray(inside.all((1, 3)))
