"""Regions of whole cells, outlined and summed from a block map alone."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.regions.outline.rasterise import rasterise
from uavseg.regions.outline.rings import RegionOutlines, renumber_by_size
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.components import Sums, label_equal_values
from uavseg.units import CELL


def outline_block_map(blocks: BlockMap, kinds: NDArray[Any]) -> RegionOutlines:
    """Outline segments of adjacent cells of one kind; cells without valid pixels are left out.

    Parameters
    ----------
    blocks : BlockMap
    kinds : (8 B, 8 C) uint8 or uint32 array
        1 for cells in range, or the level of each cell; 0 for no segment.

    Returns
    -------
    RegionOutlines
        In pixels of the raster.
    """
    rows, cols = _cell_shape(blocks)
    leaves, count = label_equal_values(np.ascontiguousarray(kinds[:rows, :cols]))
    leaves[blocks.counts[:rows, :cols] == 0] = 0
    rings = trace(leaves)
    limit = np.array(blocks.shape, np.int32)
    on_pixels = replace(rings, vertices=np.minimum(rings.vertices * np.int32(CELL), limit))
    return renumber_by_size(on_pixels, _sum_cells(blocks, leaves, count))


def count_segments(blocks: BlockMap, kinds: NDArray[Any], count: int) -> NDArray[np.int64]:
    """Count the segments of `outline_block_map` without outlining them.

    Parameters
    ----------
    blocks : BlockMap
    kinds : (8 B, 8 C) uint8 or uint32 array
        Kinds 1..count of cells; 0 for no segment.
    count : int

    Returns
    -------
    (count,) int64 array
        The number of segments of each kind.
    """
    rows, cols = _cell_shape(blocks)
    cells = np.ascontiguousarray(kinds[:rows, :cols])
    labels, segments = label_equal_values(cells)
    kind_of_segment = np.zeros(segments + 1, kinds.dtype)
    kind_of_segment[labels] = cells
    return np.bincount(kind_of_segment[1:], minlength=count + 1)[1:].astype(np.int64)


def sum_enclosed_cells(blocks: BlockMap, outlined: RegionOutlines) -> RegionOutlines:
    """The same outlines with the sums of all cells that they enclose."""
    on_cells = replace(outlined.rings, vertices=-(-outlined.rings.vertices // np.int32(CELL)))
    labels = rasterise(on_cells, Window(0, 0, *_cell_shape(blocks)))
    return replace(outlined, sums=_sum_cells(blocks, labels, len(outlined.sums.counts)))


def _cell_shape(blocks: BlockMap) -> tuple[int, int]:
    """Rows and columns of cells that hold pixels of the raster."""
    return -(-blocks.shape[0] // CELL), -(-blocks.shape[1] // CELL)


def _sum_cells(blocks: BlockMap, labels: NDArray[np.uint32], count: int) -> Sums:
    flat = labels.reshape(-1)
    rows, cols = labels.shape
    greys = np.zeros(count + 1, np.uint64)
    counts = np.zeros(count + 1, np.int64)
    np.add.at(greys, flat, blocks.sums[:rows, :cols].reshape(-1).astype(np.uint64))
    np.add.at(counts, flat, blocks.counts[:rows, :cols].reshape(-1))
    names, first = np.unique(flat, return_index=True)
    firsts = np.zeros((count + 1, 2), np.int64)
    firsts[names] = CELL * np.stack(np.divmod(first, cols), axis=1)
    return Sums(counts[1:], greys[1:], np.full(count, np.nan), firsts[1:])
