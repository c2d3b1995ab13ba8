"""Means of blocks: the histogram, and the cells in a range as an image. The only module that needs numpy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from qgis.core import QgsCoordinateReferenceSystem, QgsRasterLayer, QgsRectangle
from qgis.PyQt.QtGui import QColor, QImage

BINS = 128
COLOR = QColor(255, 140, 0, 170)


class BlockMeansError(Exception):
    """The file is not a block map."""


class BlockMeans:
    """The mean v of each cell of 8 x 8 pixels, as `uavseg divide` writes it.

    Parameters
    ----------
    path : path
        A block map.

    Raises
    ------
    BlockMeansError
        If the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        layer = QgsRasterLayer(str(path), "blocks", "gdal")
        if not layer.isValid() or layer.bandCount() != 2:
            raise BlockMeansError(f"{path} is not a block map")
        self.extent: QgsRectangle = layer.extent()
        self.crs: QgsCoordinateReferenceSystem = layer.crs()
        rows, cols = layer.height(), layer.width()
        block = layer.dataProvider().block(1, self.extent, cols, rows)
        # One copy: the buffer belongs to the block.
        self.values: Any = np.frombuffer(bytes(block.data()), np.float32).reshape(rows, cols)
        self._inside = np.zeros((rows, cols), np.uint8)

    def histogram(self, bins: int = BINS) -> tuple[list[int], tuple[float, float]]:
        """Number of cells in equal bins of v, and the range of v that the bins span: that of the cells."""
        found = self.values[np.isfinite(self.values)]
        if not found.size:
            return [0] * bins, (0.0, 1.0)
        low, high = float(found.min()), float(found.max())
        if high - low < 1e-3:
            low, high = max(low - 0.01, 0.0), min(high + 0.01, 1.0)
        counts, _ = np.histogram(found, bins, (low, high))
        return [int(count) for count in counts], (low, high)

    def in_range(self, low: float, high: float) -> Any:
        """Cells whose mean lies in a range, ends included: 1, others 0.

        The file holds v to 32 bits, so the ends are rounded likewise.
        """
        ends = np.float32(low), np.float32(high)
        inside: Any = self._inside.view(bool)
        np.greater_equal(self.values, ends[0], out=inside)
        inside &= self.values <= ends[1]
        return self._inside

    def image(self, low: float, high: float) -> QImage:
        """The cells in a range as an image of two colours, one of them transparent.

        The image shares its memory with the next one.
        """
        inside = self.in_range(low, high)
        rows, cols = inside.shape
        image = QImage(inside.data, cols, rows, cols, QImage.Format.Format_Indexed8)
        image.setColorTable([0, COLOR.rgba()])
        return image
