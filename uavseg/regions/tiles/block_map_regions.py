"""Regions of whole cells, from a block map alone."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import Window
from uavseg.regions.edit.small import numbered_by_size
from uavseg.regions.outline.rasterise import rasterise
from uavseg.regions.outline.stitch import Outlined
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.components import Sums, label_equal_values
from uavseg.units import CELL


def outline_cells(blocks: BlockMap, kinds: NDArray[Any]) -> Outlined:
    """Segments of adjacent cells of one kind, as far as they have valid pixels.

    Parameters
    ----------
    blocks : BlockMap
    kinds : (8 B, 8 C) uint8 or uint32 array
        1 for what is in range, or the level; 0 for nothing.

    Returns
    -------
    Outlined
        In pixels of the raster.
    """
    rows, cols = _cells_of(blocks)
    leaves, count = label_equal_values(np.ascontiguousarray(kinds[:rows, :cols]))
    leaves[blocks.counts[:rows, :cols] == 0] = 0
    rings = trace(leaves)
    limit = np.array(blocks.shape, np.int32)
    on_pixels = replace(rings, vertices=np.minimum(rings.vertices * np.int32(CELL), limit))
    return numbered_by_size(on_pixels, _sums_of_cells(blocks, leaves, count))


def count_segments(blocks: BlockMap, kinds: NDArray[Any], most: int) -> NDArray[np.int64]:
    """How many segments of each kind 1..most `outline_cells` finds, (most,) int64; nothing is outlined."""
    rows, cols = _cells_of(blocks)
    cells = np.ascontiguousarray(kinds[:rows, :cols])
    labels, count = label_equal_values(cells)
    own = np.zeros(count + 1, kinds.dtype)
    own[labels] = cells
    return np.bincount(own[1:], minlength=most + 1)[1:].astype(np.int64)


def summed_cells(blocks: BlockMap, outlined: Outlined) -> Outlined:
    """The same regions with the sums of all cells that they enclose."""
    on_cells = replace(outlined.rings, vertices=-(-outlined.rings.vertices // np.int32(CELL)))
    labels = rasterise(on_cells, Window(0, 0, *_cells_of(blocks)))
    return replace(outlined, sums=_sums_of_cells(blocks, labels, len(outlined.sums.counts)))


def _cells_of(blocks: BlockMap) -> tuple[int, int]:
    """Rows and columns of the cells that the raster reaches into."""
    return -(-blocks.shape[0] // CELL), -(-blocks.shape[1] // CELL)


def _sums_of_cells(blocks: BlockMap, labels: NDArray[np.uint32], count: int) -> Sums:
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
