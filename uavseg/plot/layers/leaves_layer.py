"""Layer of leaves: the outlines of the quadtree's blocks."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavseg.errors import ParameterError, RasterError
from uavseg.plot.layers.raster_layer import open_coarse
from uavseg.plot.page.frame import Frame
from uavseg.raster.grid.tiling import Window
from uavseg.units import CELL

_SIDES = (64, 32, 16, 8)
_SIDE_BAND = 2  # band of a block map that holds the side of each leaf
_COLOR = "#ffd43b"


@dataclass(frozen=True)
class LeavesLayer:
    """Leaves in plot coordinates.

    Parameters
    ----------
    corners : (n, 4, 2) float64 array
        Of each leaf, clipped to the raster.
    sides : (n,) int64 array
        64, 32, 16 or 8 pixels.
    """

    corners: NDArray[np.float64]
    sides: NDArray[np.int64]

    @classmethod
    def of(cls, source: str | os.PathLike[str], frame: Frame, max_side: int) -> "LeavesLayer":
        """Leaves of the block map that `uavseg divide` wrote for this raster.

        Parameters
        ----------
        most : int
            Largest number of rows and columns of cells that is read.

        Raises
        ------
        RasterError
            If it is not a block map, or that of another raster.
        ParameterError
            If even the largest leaves are too small to be visible.
        """
        box = frame.geobox
        cells = box.coarsen(CELL)
        if max(cells.shape) > max_side:
            raise ParameterError(
                f"leaves of a raster of {box.shape[1]:,} x {box.shape[0]:,} pixels are too small to be seen; "
                "give a larger --width, or draw a part of it (gdal_translate -srcwin)"
            )
        coarse = open_coarse(source, frame, max_side, _SIDE_BAND)
        if coarse.geobox.shape != cells.shape or not coarse.geobox.transform.almost_equals(cells.transform):
            raise RasterError(f"{coarse.source} is not the block map of this raster; uavseg divide makes one")
        values, valid = coarse.read(Window(0, 0, *cells.shape))
        sides = values[0] if valid is None else np.where(valid, values[0], 0)
        if not np.isin(sides, _SIDES).all():
            raise RasterError(f"{coarse.source} is not a block map; uavseg divide makes one")
        squares, lengths = leaf_squares(sides.astype(np.int64), box.shape)
        xy = np.stack(box.xy_from_pixel(*squares.reshape(-1, 2).T), axis=1)
        return cls(frame.plot_from_xy(xy).reshape(-1, 4, 2), lengths)

    def title_parts(self, has_crs: bool) -> list[str]:
        """The number of leaves."""
        return [f"{len(self.sides):,} {'leaf' if len(self.sides) == 1 else 'leaves'}"]

    def draw(self, ax: Any, point: float) -> None:
        """Draw on axes; `point` is the length of one point (1/72 inch) in plot coordinates."""
        from matplotlib.collections import PolyCollection

        how: dict[str, Any] = {
            "facecolor": "none",
            "edgecolor": _COLOR,
            "lw": 0.5,
            "alpha": 0.85,
            "zorder": 2.8,
        }
        ax.add_collection(PolyCollection(list(self.corners), label="leaf", **how))


def leaf_squares(
    sides: NDArray[np.int64], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The leaves that cells of 8 x 8 pixels belong to.

    Parameters
    ----------
    sides : (m, n) int64 array
        Side of the leaf of each cell, in pixels.
    shape : (int, int)
        Of the raster, to which leaves are clipped.

    Returns
    -------
    corners : (k, 4, 2) int64 array
        Row and column of each leaf's corners in pixels.
    sides : (k,) int64 array

    Examples
    --------
    >>> corners, sides = leaf_squares(np.array([[16, 16, 8], [16, 16, 8]]), (16, 20))
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
