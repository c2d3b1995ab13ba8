"""Bilinear interpolation of one band at positions: only the tiles around them are read, a few are kept."""

from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavseg.raster.grid.tiling import Window
from uavseg.raster.read.dataset import Dataset

Floats = NDArray[np.float64]

SIDE = 256
"""Pixels by which neighbouring tiles are apart; each also holds the first row and column of the next."""
MAX_TILES = 64
"""Tiles that are kept: 34 MB."""


@dataclass(eq=False)
class BilinearSampler:
    """Values of a band between the centres of its pixels.

    Parameters
    ----------
    dataset : Dataset
        With one band.
    """

    dataset: Dataset
    _tiles: OrderedDict[tuple[int, int], Floats] = field(default_factory=OrderedDict, repr=False)

    def sample(self, row: Floats, col: Floats) -> Floats:
        """Values at positions, NaN outside of the raster and where a pixel that counts is invalid.

        In the outer half of the pixels at the edge, beyond their centres, the value is that at the nearest
        point of the line between the centres.

        Parameters
        ----------
        row, col : (n,) float64 arrays
            Pixel corners are integers, centres are at + 0.5; see `GeoBox.xy_from_pixel`.

        Returns
        -------
        values : (n,) float64 array
        """
        rows, cols = self.dataset.geobox.shape
        values = np.full(row.shape, np.nan)
        inside = np.flatnonzero((row >= 0) & (row <= rows) & (col >= 0) & (col <= cols))
        top, down = _between(row[inside], rows)
        left, right = _between(col[inside], cols)
        tile_row, tile_col = top // SIDE, left // SIDE
        order = np.lexsort((tile_col, tile_row))
        changes = np.diff(tile_row[order]).astype(bool) | np.diff(tile_col[order]).astype(bool)
        for group in np.split(order, np.flatnonzero(changes) + 1):
            if not len(group):
                continue
            i, j = int(tile_row[group[0]]), int(tile_col[group[0]])
            local = top[group] - i * SIDE, left[group] - j * SIDE
            values[inside[group]] = _interpolate(self._tile(i, j), *local, down[group], right[group])
        return values

    def _tile(self, i: int, j: int) -> Floats:
        """Pixels of a tile, NaN where invalid; the least recently used is dropped."""
        key = i, j
        if key not in self._tiles:
            window = Window(i * SIDE, j * SIDE, SIDE + 1, SIDE + 1).clipped(self.dataset.geobox.shape)
            pixels, valid = self.dataset.read(window)
            found = pixels[0].astype(np.float64)
            if valid is not None:
                found[~valid] = np.nan
            self._tiles[key] = found
            if len(self._tiles) > MAX_TILES:
                self._tiles.popitem(last=False)
        self._tiles.move_to_end(key)
        return self._tiles[key]


def _between(position: Floats, count: int) -> tuple[NDArray[np.int64], Floats]:
    """The pixel whose centre comes before each position, and the share of the way to the next one."""
    centre = np.clip(position - 0.5, 0, count - 1)
    before = np.minimum(centre.astype(np.int64), max(count - 2, 0))
    return before, centre - before


def _interpolate(
    tile: Floats, row: NDArray[np.int64], col: NDArray[np.int64], down: Floats, right: Floats
) -> Floats:
    below, beside = np.minimum(row + 1, tile.shape[0] - 1), np.minimum(col + 1, tile.shape[1] - 1)
    total = np.zeros(row.shape)
    for i, j, weight in (
        (row, col, (1 - down) * (1 - right)),
        (row, beside, (1 - down) * right),
        (below, col, down * (1 - right)),
        (below, beside, down * right),
    ):
        total += np.where(weight > 0, weight * tile[i, j], 0.0)  # an invalid pixel without weight is none
    return total
