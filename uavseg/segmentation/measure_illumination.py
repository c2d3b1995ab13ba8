"""Illumination of a raster, measured in one pass over its tiles."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import TilePass, Window
from uavseg.segmentation.blocks.block_map import cell_sums
from uavseg.segmentation.params.illumination import Illumination, fit_illumination, square_side
from uavseg.segmentation.source import GreySource
from uavseg.units import CELL


def measure_illumination(source: GreySource, width: tuple[int, int], tile_pass: TilePass) -> Illumination:
    """Measure the slow light of a raster; sums are integers, so tiles and their order change nothing.

    Parameters
    ----------
    source : GreySource
        Not flattened.
    width : (int, int)
        Rows and columns of pixels; light that changes within less stays.
    tile_pass : TilePass
        Tiles that cover the raster, the executor and the progress.
    """
    step = square_side(width)
    shape = -(-source.shape[0] // step), -(-source.shape[1] // step)
    sums, counts = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    found = tile_pass.run(partial(_tile_sums, source, step))
    for window, result in zip(tile_pass.windows, found, strict=True):
        if result is not None:
            row, col = window.row // step, window.col // step
            rows, cols = result[0].shape
            sums[row : row + rows, col : col + cols] += result[0]
            counts[row : row + rows, col : col + cols] += result[1]
    return fit_illumination(sums, counts, step, width)


def _tile_sums(
    source: GreySource, step: int, window: Window
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Sum and number of valid pixels of each square that the window touches, of the pixels in the window."""
    if source.dataset.is_empty(window):
        return None
    tile = source.read(window, 0)
    sums, counts = cell_sums(tile.grey, tile.valid)
    cells = -(-window.rows // CELL), -(-window.cols // CELL)
    return tuple(_by_squares(array[: cells[0], : cells[1]], step, window) for array in (sums, counts))  # type: ignore[return-value]


def _by_squares(
    cells: NDArray[np.uint32] | NDArray[np.uint8], step: int, window: Window
) -> NDArray[np.int64]:
    """Cells of a window, added up by the squares in which they lie."""
    total = cells.astype(np.int64)
    for axis, first in enumerate((window.row, window.col)):
        squares = (first // CELL + np.arange(total.shape[axis])) // (step // CELL)
        total = np.add.reduceat(total, np.flatnonzero(np.diff(squares, prepend=-1)), axis=axis)
    return total
