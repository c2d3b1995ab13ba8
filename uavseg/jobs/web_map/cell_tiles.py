"""Cells of a range for tiles of a web map, where a raster has too many cells for a page."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavseg.jobs.web_map.content import CellCodes, FieldMap
from uavseg.raster.grid.geobox import GeoBox
from uavseg.raster.grid.ground_grid import GroundGrid
from uavseg.raster.read.tile_pixels import tile_pixels
from uavseg.segmentation.blocks.leaf_codes import NO_CODE, STEPS
from uavseg.units import CELL


@dataclass(frozen=True)
class CellTiles:
    """Tiles of the codes of cells, which a page colours for any range of a slider.

    Parameters
    ----------
    codes : (m, n) uint16 array
        See `leaf_codes`; 65535 where a cell has no valid pixel.
    geobox : GeoBox
        Of the raster.
    areas : (2001,) float64 array
        Square metres of the cells of each code.
    """

    codes: NDArray[np.uint16]
    geobox: GeoBox
    areas: NDArray[np.float64]

    @classmethod
    def of(cls, found: FieldMap) -> "CellTiles":
        """Tiles of the cells of a web map, which has them."""
        assert found.cells is not None
        codes = np.where(found.cells.counts > 0, found.cells.codes, np.uint16(NO_CODE))
        return cls(codes, found.info.geobox, areas_by_code(found.cells, found.ground))

    def tile(self, place: tuple[int, int, int]) -> bytes | None:
        """The code of the cell below the centre of each pixel of a tile.

        Parameters
        ----------
        place : (zoom, x, y)
            In the usual numbering of tiles of Web Mercator.

        Returns
        -------
        content : bytes or None
            256 rows of 256 little-endian 16-bit integers, 65535 beside the raster; None where all are.
        """
        pixels = tile_pixels(self.geobox, place)
        if pixels is None:
            return None
        below = self.codes[pixels.rows // CELL, pixels.cols // CELL]
        return np.where(pixels.inside, below, np.uint16(NO_CODE)).astype("<u2").tobytes()


def areas_by_code(cells: CellCodes, ground: GroundGrid) -> NDArray[np.float64]:
    """Square metres of the cells with valid pixels, by their codes from 0 to 2000.

    Parameters
    ----------
    cells : CellCodes
    ground : GroundGrid
        Its areas of pixels are those of the parts in which the centres of cells lie.

    Returns
    -------
    areas : (2001,) float64 array
    """
    heights, widths = (_sides(length) for length in cells.shape)
    row, col = (
        _parts(length, parts) for length, parts in zip(cells.shape, ground.pixel_m2.shape, strict=True)
    )
    areas = np.zeros(NO_CODE + 1)
    for n, (codes, counts) in enumerate(zip(cells.codes, cells.counts, strict=True)):
        weights = heights[n] * widths * ground.pixel_m2[row[n], col]
        valid = counts > 0
        areas += np.bincount(codes[valid], weights[valid], len(areas))
    return areas[: 2 * STEPS + 1]


def _sides(length: int) -> NDArray[np.int64]:
    """Rows of pixels of each row of cells; the same for columns."""
    return np.minimum(CELL, length - CELL * np.arange(-(-length // CELL)))


def _parts(length: int, parts: int) -> NDArray[np.int64]:
    """The part of the ground in which the middle of each row of cells lies; the same for columns."""
    middles = CELL * np.arange(-(-length // CELL)) + CELL // 2
    return np.minimum(middles * parts // length, parts - 1)
