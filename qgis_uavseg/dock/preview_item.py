"""The cells in a range, painted over the map while the slider is dragged."""

from __future__ import annotations

import math
from typing import Any

from qgis.core import QgsCoordinateTransform, QgsCsException, QgsPointXY, QgsProject
from qgis.gui import QgsMapCanvas, QgsMapCanvasItem
from qgis.PyQt.QtCore import QPointF, QRectF
from qgis.PyQt.QtGui import QPainter, QPolygonF, QTransform

from .block_means import BlockMeans, Part


class PreviewItem(QgsMapCanvasItem):
    """An image of cells at its place on the map; another CRS of the project is met at the corners."""

    def __init__(self, canvas: QgsMapCanvas) -> None:
        super().__init__(canvas)
        self._canvas = canvas
        self._means: BlockMeans | None = None
        self._range = (0.0, 1.0)

    def show_range(self, means: BlockMeans, low: float, high: float) -> None:
        """Show the cells of a range."""
        self._means, self._range = means, (low, high)
        self.updatePosition()
        self.show()

    def clear(self) -> None:
        """Show nothing."""
        self._means = None
        self.hide()

    def boundingRect(self) -> QRectF:
        """All of the canvas."""
        return QRectF(0, 0, self._canvas.width(), self._canvas.height())

    def updatePosition(self) -> None:
        """Follow the map."""
        self.prepareGeometryChange()
        self.setPos(0, 0)
        self.update()

    def paint(self, painter: QPainter, option: Any = None, widget: Any = None) -> None:
        if self._means is None:
            return
        placed = self._placed(self._means)
        if placed is None:
            return
        back, invertible = placed.inverted()
        rows, cols = self._means.shape
        whole = QRectF(0, 0, cols, rows)
        seen = back.mapRect(self.boundingRect()).intersected(whole) if invertible else whole
        if seen.isEmpty():
            return
        step = max(int((seen.width() * seen.height() / _area(self.boundingRect())) ** 0.5), 1)
        part = _part(seen, step, (rows, cols))
        image = self._means.image(*self._range, part)
        target = QRectF(part.cols.start, part.rows.start, image.width() * step, image.height() * step)
        painter.save()
        painter.setTransform(placed, True)
        painter.drawImage(target, image, QRectF(image.rect()))
        painter.restore()

    def _placed(self, means: BlockMeans) -> QTransform | None:
        """From cells to pixels of the canvas; None where the corners cannot be transformed."""
        settings = self._canvas.mapSettings()
        to_map = QgsCoordinateTransform(means.crs, settings.destinationCrs(), QgsProject.instance())
        box = means.extent
        corners = (
            (box.xMinimum(), box.yMaximum()),
            (box.xMaximum(), box.yMaximum()),
            (box.xMaximum(), box.yMinimum()),
            (box.xMinimum(), box.yMinimum()),
        )
        try:
            places = [to_map.transform(QgsPointXY(x, y)) for x, y in corners]
        except QgsCsException:
            return None
        target = QPolygonF([self.toCanvasCoordinates(place) for place in places])
        height, width = means.shape
        ends = ((0, 0), (width, 0), (width, height), (0, height))
        source = QPolygonF([QPointF(x, y) for x, y in ends])
        transform = QTransform()
        return transform if QTransform.quadToQuad(source, target, transform) else None


def _part(seen: QRectF, step: int, shape: tuple[int, int]) -> Part:
    """The cells of a rectangle, from a multiple of the step, so that they stay when the map moves."""
    top, left = int(seen.top()) // step * step, int(seen.left()) // step * step
    bottom, right = min(math.ceil(seen.bottom()), shape[0]), min(math.ceil(seen.right()), shape[1])
    return Part(slice(top, bottom, step), slice(left, right, step))


def _area(rect: QRectF) -> float:
    return max(rect.width() * rect.height(), 1.0)
