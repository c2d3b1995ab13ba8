"""Noise of a raster where its refinement depends on it, for people: the median over mixed cells."""

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.tiling import Window
from uavseg.segmentation.refine.noise import estimate_noise
from uavseg.segmentation.source import GreySource
from uavseg.units import BLOCK, CELL, CELLS, GREY_MAX

_SIDE = 8 * BLOCK  # of the part that is looked at


def typical_noise(source: GreySource, mixed: NDArray[np.bool_]) -> float:
    """Median of the estimated noise around the mixed cells of the part of a raster that has most of them.

    Parameters
    ----------
    source : GreySource
    mixed : (8 B, 8 C) bool array
        Which cells of 8 x 8 pixels are mixed.

    Returns
    -------
    deviation : float
        Standard deviation in v; 0 where no cell is mixed.
    """
    side = _SIDE // CELL
    corners = [(row, col) for row in range(0, mixed.shape[0], side) for col in range(0, mixed.shape[1], side)]
    row, col = max(corners, key=lambda at: np.count_nonzero(_part(mixed, at)))
    cells = _part(mixed, (row, col))
    if not cells.any():
        return 0.0
    rows, cols = source.shape
    window = Window(row * CELL, col * CELL, min(_SIDE, rows - row * CELL), min(_SIDE, cols - col * CELL))
    tile = source.read(window, 0)
    active = np.ascontiguousarray(cells[: tile.grey.shape[0] // CELL, : tile.grey.shape[1] // CELL])
    noise = estimate_noise(tile.grey, tile.valid, active.view(np.uint8))
    found = noise[noise > 0]
    return float(np.median(found)) / GREY_MAX if len(found) else 0.0


def _part(mixed: NDArray[np.bool_], at: tuple[int, int]) -> NDArray[np.bool_]:
    side = _SIDE // BLOCK * CELLS
    return mixed[at[0] : at[0] + side, at[1] : at[1] + side]
