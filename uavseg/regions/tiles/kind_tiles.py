"""Segments of levels and states: tiles are labelled and traced one by one, then stitched."""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.execution.lazy_sequence import LazySequence
from uavseg.raster.grid.tiling import TilePass, Window, cells_around, whole_blocks
from uavseg.regions.outline.rings import RegionOutlines
from uavseg.regions.outline.stitch import TileOutlines, outline_tile, stitch_tiles
from uavseg.segmentation.blocks.leaves import cells_to_pixels
from uavseg.segmentation.components import label_components, label_equal_values
from uavseg.segmentation.source import GreySource
from uavseg.segmentation.states.state_image import StateImage
from uavseg.segmentation.states.state_scans import decode_states
from uavseg.units import CELL

_Job = tuple[Window, NDArray[Any]]


def outline_segments(
    source: GreySource,
    cells: NDArray[Any],
    tile_pass: TilePass,
) -> RegionOutlines:
    """Outline segments: cells of the same kind that share an edge, not refined.

    Parameters
    ----------
    source : GreySource
    cells : (m, n) uint8 or uint32 array
        The kind of each cell, such as its level; 0 for no segment.
    tile_pass : TilePass
    """
    tiles = tile_pass.run(partial(_outline_cells, source), cell_jobs(cells, tile_pass.windows, CELL))
    return stitch_tiles(source.shape, tile_pass.windows, tiles).finish(cells)


def outline_state(
    source: GreySource,
    image: StateImage,
    state: int,
    tile_pass: TilePass,
    leaves: NDArray[np.uint8] | None = None,
) -> RegionOutlines:
    """Outline the connected components of the pixels of one state.

    Parameters
    ----------
    source : GreySource
    image : StateImage
    state : int
    tile_pass : TilePass
        It is quickest if tiles of the same rows follow each other.
    leaves : (m, n) uint8 array, optional
        The states of cells, where they were not refined: leaves that share an edge are then one object.
    """
    tiles = tile_pass.run(partial(_outline_pixels, source), _state_jobs(image, state, tile_pass.windows))
    of_state = None if leaves is None else (leaves == state).view(np.uint8)
    return stitch_tiles(source.shape, tile_pass.windows, tiles).finish(of_state)


def cell_jobs(cells: NDArray[Any], windows: Sequence[Window], halo: int) -> LazySequence[_Job]:
    """Tiles with the kinds of their cells and of those within `halo` pixels around them."""
    return LazySequence(len(windows), partial(_cell_job, cells, windows, halo))


def _cell_job(cells: NDArray[Any], windows: Sequence[Window], halo: int, k: int) -> _Job:
    return windows[k], cells_around(cells, windows[k], halo)


def _state_jobs(image: StateImage, state: int, windows: Sequence[Window]) -> LazySequence[_Job]:
    """Tiles with a mask of their pixels of one state, and of 8 pixels around them, one bit each."""
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
    tile = source.read(window, CELL, beyond=True)
    kinds = cells_to_pixels(cells, tile.valid)
    return outline_tile(kinds, *label_equal_values(kinds, CELL), tile, window, source.shape[1])


def _outline_pixels(source: GreySource, job: _Job) -> TileOutlines | None:
    window, bits = job
    if not bits.any():
        return None
    tile = source.read(window, CELL, beyond=True)
    pixels = np.unpackbits(bits, axis=1, count=tile.grey.shape[1])
    return outline_tile(pixels, *label_components(pixels, CELL), tile, window, source.shape[1])
