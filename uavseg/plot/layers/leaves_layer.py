"""Leaves in a picture: the blocks of the quadtree, outlined."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RasterError
from uavseg.plot.frame import Frame
from uavseg.plot.layers.raster_layer import coarse_over
from uavseg.raster.tiling import Window
from uavseg.units import CELL

SIDES = (64, 32, 16, 8)
SIDE_BAND = 2  # of a block map: the side of each leaf
COLOR = "#ffd43b"


@dataclass(frozen=True)
class LeavesLayer:
    """Leaves on the sheet.

    Parameters
    ----------
    corners : (n, 4, 2) float64 array
        Of each leaf, on the sheet; cut off at the edge of the raster.
    sides : (n,) int64 array
        64, 32, 16 or 8 pixels.
    """

    corners: NDArray[np.float64]
    sides: NDArray[np.int64]

    @classmethod
    def of(cls, source: str | os.PathLike[str], frame: Frame, most: int) -> "LeavesLayer":
        """Leaves of a block map that `uavseg divide` wrote, of the raster in the picture.

        Parameters
        ----------
        most : int
            Rows and columns of cells that may be read.

        Raises
        ------
        RasterError
            If it is no block map, or that of another raster.
        ParameterError
            If even the largest leaves are too small to be seen.
        """
        box = frame.geobox
        cells = box.coarsen(CELL)
        if max(cells.shape) > most:
            raise ParameterError(
                f"leaves of a raster of {box.shape[1]:,} x {box.shape[0]:,} pixels are too small to be seen; "
                "give a larger --width, or draw a part of it (gdal_translate -srcwin)"
            )
        coarse = coarse_over(source, frame, most, SIDE_BAND)
        if coarse.geobox.shape != cells.shape or not coarse.geobox.transform.almost_equals(cells.transform):
            raise RasterError(f"{coarse.source} is not the block map of this raster; uavseg divide makes one")
        values, valid = coarse.read(Window(0, 0, *cells.shape))
        sides = values[0] if valid is None else np.where(valid, values[0], 0)
        if not np.isin(sides, SIDES).all():
            raise RasterError(f"{coarse.source} is not a block map; uavseg divide makes one")
        squares, lengths = squares_of(sides.astype(np.int64), box.shape)
        xy = np.stack(box.xy_from_pixel(*squares.reshape(-1, 2).T), axis=1)
        return cls(frame.sheet_from_xy(xy).reshape(-1, 4, 2), lengths)

    def told(self, on_globe: bool) -> list[str]:
        """How many leaves there are."""
        return [f"{len(self.sides):,} {'leaf' if len(self.sides) == 1 else 'leaves'}"]

    def draw(self, ax: Any, unit: float) -> None:
        """Draw on axes, where `unit` is the length on the sheet of one point (1/72 inch)."""
        from matplotlib.collections import PolyCollection

        how: dict[str, Any] = {
            "facecolor": "none",
            "edgecolor": COLOR,
            "lw": 0.5,
            "alpha": 0.85,
            "zorder": 2.8,
        }
        ax.add_collection(PolyCollection(list(self.corners), label="leaf", **how))


def squares_of(
    sides: NDArray[np.int64], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The leaves in which cells of 8 x 8 pixels lie.

    Parameters
    ----------
    sides : (m, n) int64 array
        Side of the leaf of each cell, in pixels.
    shape : (int, int)
        Of the raster, where leaves are cut off.

    Returns
    -------
    corners : (k, 4, 2) int64 array
        Row and column of each leaf's corners in pixels.
    sides : (k,) int64 array

    Examples
    --------
    >>> corners, sides = squares_of(np.array([[16, 16, 8], [16, 16, 8]]), (16, 20))
    >>> corners[:, [0, 2]].tolist(), sides.tolist()
    ([[[0, 0], [16, 16]], [[0, 16], [8, 20]], [[8, 16], [16, 20]]], [16, 8, 8])
    """
    row, col = np.ogrid[: sides.shape[0], : sides.shape[1]]
    first = (CELL * row % sides == 0) & (CELL * col % sides == 0)
    top, left = (CELL * cells for cells in np.nonzero(first))
    side = sides[first]
    bottom, right = np.minimum(top + side, shape[0]), np.minimum(left + side, shape[1])
    corners = [(top, left), (top, right), (bottom, right), (bottom, left)]
    return np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1), side
