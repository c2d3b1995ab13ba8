"""Segments of whole cells, and of the pixels of a state: outlined tile by tile, or from a block map alone."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.executors import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, whole_blocks
from uavseg.regions.outline.rasterise import rasterise
from uavseg.regions.outline.rings import RegionOutlines, renumber_by_size
from uavseg.regions.outline.stitch import TileOutlines, TileStitcher, outline_tile
from uavseg.regions.outline.trace import trace
from uavseg.segmentation.blocks.block_map import BlockMap
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.components import Sums, label_components, label_equal_values
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.state_image import StateImage
from uavseg.segmentation.states.state_scans import decode_states
from uavseg.units import CELL

_Job = tuple[Window, NDArray[Any]]


def outline_segments(source: GreySource, cells: NDArray[Any], tile_pass: TilePass) -> RegionOutlines:
    """Outline segments: cells of the same class that share an edge, not refined.

    `cells`, (m, n), are the class of each cell, such as its level; 0 for no segment.
    """
    tiles = tile_pass.run(partial(_outline_cells, source), cell_jobs(cells, tile_pass.windows, CELL))
    return TileStitcher(source.shape, tile_pass.windows, tiles).finish(cells)


def outline_state(
    source: GreySource,
    image: StateImage,
    state: int,
    tile_pass: TilePass,
    leaves: NDArray[np.uint8] | None = None,
) -> RegionOutlines:
    """Outline the connected components of the pixels of one state.

    It is quickest if tiles of the same rows follow each other. `leaves`, (m, n), are the states of cells,
    where they were not refined: those that share an edge are then one object.
    """
    tiles = tile_pass.run(partial(_outline_pixels, source), _state_jobs(image, state, tile_pass.windows))
    of_state = None if leaves is None else (leaves == state).view(np.uint8)
    return TileStitcher(source.shape, tile_pass.windows, tiles).finish(of_state)


def cell_jobs(cells: NDArray[Any], windows: Sequence[Window], halo: int) -> LazySequence[_Job]:
    """Return tiles with their values of the (m, n) cells, and those within `halo` pixels around them."""
    return LazySequence(len(windows), partial(_cell_job, cells, windows, halo))


def _cell_job(cells: NDArray[Any], windows: Sequence[Window], halo: int, k: int) -> _Job:
    return windows[k], cells_around(cells, windows[k], halo)


def _state_jobs(image: StateImage, state: int, windows: Sequence[Window]) -> LazySequence[_Job]:
    """Return tiles with a mask of one state, and 8 pixels around them, one bit per pixel."""
    # Tiles of the same rows follow each other, so the mask of the last rows is cached.
    mask_of_rows = lru_cache(maxsize=1)(partial(_state_mask, image, state))
    return LazySequence(len(windows), partial(_state_job, mask_of_rows, windows))


def _state_mask(image: StateImage, state: int, row: int, rows: int) -> NDArray[np.bool_]:
    inside = decode_states(image.read_codes(row, rows)) == state
    return np.pad(inside, ((0, 0), (CELL, CELL)))


def _state_job(
    mask_of_rows: Callable[[int, int], NDArray[np.bool_]], windows: Sequence[Window], k: int
) -> _Job:
    window = windows[k]
    mask = mask_of_rows(window.row - CELL, whole_blocks(window.rows) + 2 * CELL)
    part = mask[:, window.col : window.col + whole_blocks(window.cols) + 2 * CELL]
    return window, np.packbits(part, axis=1)


def _outline_cells(source: GreySource, job: _Job) -> TileOutlines | None:
    window, cells = job
    if not cells.any():
        return None
    tile = source.read(window, CELL, excess=True)
    pixels = cells_to_pixels(cells, tile.valid)
    return outline_tile(pixels, *label_equal_values(pixels, CELL), tile, window, source.shape[1])


def _outline_pixels(source: GreySource, job: _Job) -> TileOutlines | None:
    window, bits = job
    if not bits.any():
        return None
    tile = source.read(window, CELL, excess=True)
    pixels = np.unpackbits(bits, axis=1, count=tile.grey.shape[1])
    return outline_tile(pixels, *label_components(pixels, CELL), tile, window, source.shape[1])


def outline_block_map(blocks: BlockMap, classes: NDArray[Any]) -> RegionOutlines:
    """Outline segments of adjacent cells of one class; cells without valid pixels are left out.

    `classes`, (8 B, 8 C), are 1 for cells in range, or the level of each; 0 for no segment. Outlines are in
    pixels.
    """
    rows, cols = _cell_shape(blocks)
    leaves, count = label_equal_values(np.ascontiguousarray(classes[:rows, :cols]))
    leaves[blocks.counts[:rows, :cols] == 0] = 0
    rings = trace(leaves)
    limit = np.array(blocks.shape, np.int32)
    on_pixels = replace(rings, vertices=np.minimum(rings.vertices * np.int32(CELL), limit))
    return renumber_by_size(on_pixels, _sum_cells(blocks, leaves, count))


def count_segments(blocks: BlockMap, classes: NDArray[Any], count: int) -> NDArray[np.int64]:
    """Count the segments of `outline_block_map` by class, (count,) int64, without outlining them.

    `classes`, (8 B, 8 C), are 1..count for each cell; 0 for no segment.
    """
    rows, cols = _cell_shape(blocks)
    cells = np.ascontiguousarray(classes[:rows, :cols])
    labels, segments = label_equal_values(cells)
    of_segment = np.zeros(segments + 1, cells.dtype)
    of_segment[labels] = cells
    return np.bincount(of_segment[1:], minlength=count + 1)[1:].astype(np.int64)


def sum_enclosed_cells(blocks: BlockMap, outlined: RegionOutlines) -> RegionOutlines:
    """Return the outlines of `outline_block_map` with the sums of all cells that they enclose."""
    on_cells = replace(outlined.rings, vertices=-(-outlined.rings.vertices // np.int32(CELL)))
    labels = rasterise(on_cells, Window(0, 0, *_cell_shape(blocks)))
    return replace(outlined, sums=_sum_cells(blocks, labels, len(outlined.sums.counts)))


def _cell_shape(blocks: BlockMap) -> tuple[int, int]:
    """Return the rows and columns of cells that hold pixels of the raster."""
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
