"""From levels and states to their segments: tiles numbered and outlined one by one, joined without seams."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import TilePass, Window, cells_around, whole_blocks
from uavseg.regions.outline.stitch import Outlined, Tile, joined, outlined_tile
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
) -> Outlined:
    """Segments of a raster: cells that share an edge and are of the same kind, not refined.

    Parameters
    ----------
    source : GreySource
    cells : (m, n) uint8 or uint32 array
        The kind of each cell, such as its level; 0 for nothing.
    tile_pass : TilePass
    """
    tiles = tile_pass.run(partial(_outline_cells, source), CellJobs(cells, tile_pass.windows))
    return joined(source.shape, tile_pass.windows, tiles).outlined(cells)


def outline_state(
    source: GreySource,
    image: StateImage,
    state: int,
    tile_pass: TilePass,
    leaves: NDArray[np.uint8] | None = None,
) -> Outlined:
    """Connected pixels of one state.

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
    tiles = tile_pass.run(partial(_outline_pixels, source), _PixelJobs(image, state, tile_pass.windows))
    of_state = None if leaves is None else (leaves == state).view(np.uint8)
    return joined(source.shape, tile_pass.windows, tiles).outlined(of_state)


class CellJobs(Sequence[_Job]):
    """Tiles with the kinds of their cells and of those within `margin` pixels around them."""

    def __init__(self, cells: NDArray[Any], windows: Sequence[Window], margin: int = CELL) -> None:
        self._cells = cells
        self._windows = windows
        self._margin = margin

    def __len__(self) -> int:
        return len(self._windows)

    def __getitem__(self, k: Any) -> Any:
        window = self._windows[k]
        return window, cells_around(self._cells, window, self._margin)


class _PixelJobs(Sequence[_Job]):
    """Tiles with their pixels of one state and 8 more around them, a bit each."""

    def __init__(self, image: StateImage, state: int, windows: Sequence[Window]) -> None:
        self._image = image
        self._state = state
        self._windows = windows
        self._held: tuple[tuple[int, int], NDArray[np.bool_]] = ((0, 0), np.empty((0, 0), bool))

    def __len__(self) -> int:
        return len(self._windows)

    def __getitem__(self, k: Any) -> Any:
        window = self._windows[k]
        rows = (window.row - CELL, whole_blocks(window.rows) + 2 * CELL)
        if self._held[0] != rows:
            inside = decode_states(self._image.read_codes(*rows)) == self._state
            self._held = rows, np.pad(inside, ((0, 0), (CELL, CELL)))
        part = self._held[1][:, window.col : window.col + whole_blocks(window.cols) + 2 * CELL]
        return window, np.packbits(part, axis=1)


def _outline_cells(source: GreySource, job: _Job) -> Tile | None:
    window, cells = job
    if not cells.any():
        return None
    tile = source.read(window, CELL)
    kinds = cells_to_pixels(cells, tile.valid)
    return outlined_tile(kinds, *label_equal_values(kinds, CELL), tile.grey, window, source.shape[1])


def _outline_pixels(source: GreySource, job: _Job) -> Tile | None:
    window, bits = job
    if not bits.any():
        return None
    tile = source.read(window, CELL)
    pixels = np.unpackbits(bits, axis=1, count=tile.grey.shape[1])
    return outlined_tile(pixels, *label_components(pixels, CELL), tile.grey, window, source.shape[1])
