"""Means of blocks: the histogram, and the cells in a range as an image. The only module that needs numpy."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from qgis.core import QgsCoordinateReferenceSystem, QgsRasterLayer, QgsRectangle
from qgis.PyQt.QtGui import QColor, QImage

BINS = 128
COLOR = QColor(255, 140, 0, 170)


class Part(NamedTuple):
    """Cells that are seen: slices of rows and of columns, with a step where cells are smaller than pixels."""

    rows: slice
    cols: slice


WHOLE = Part(slice(None), slice(None))


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

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        rows, cols = self.values.shape
        return rows, cols

    def in_range(self, low: float, high: float, part: Part = WHOLE) -> Any:
        """Cells whose mean lies in a range, ends included: 1, others 0.

        The file holds v to 32 bits, so the ends are rounded likewise.
        """
        values = self.values[part.rows, part.cols]
        inside: Any = values >= np.float32(low)
        inside &= values <= np.float32(high)
        return inside.view(np.uint8)

    def image(self, low: float, high: float, part: Part = WHOLE) -> QImage:
        """The cells in a range as an image of two colours, one of them transparent."""
        inside = self.in_range(low, high, part)
        rows, cols = inside.shape
        image = QImage(inside.data, cols, rows, cols, QImage.Format.Format_Indexed8)
        image.setColorTable([0, COLOR.rgba()])
        return image.copy()  # with memory of its own
