"""The cells in a range, painted over the map while the slider is dragged."""

from __future__ import annotations

from typing import Any

from qgis.core import QgsCoordinateTransform, QgsCsException, QgsPointXY, QgsProject
from qgis.gui import QgsMapCanvas, QgsMapCanvasItem
from qgis.PyQt.QtCore import QPointF, QRectF
from qgis.PyQt.QtGui import QImage, QPainter, QPolygonF, QTransform

from .block_means import BlockMeans


class PreviewItem(QgsMapCanvasItem):
    """An image of cells at its place on the map; another CRS of the project is met at the corners."""

    def __init__(self, canvas: QgsMapCanvas) -> None:
        super().__init__(canvas)
        self._canvas = canvas
        self._image: QImage | None = None
        self._means: BlockMeans | None = None

    def show_range(self, means: BlockMeans, low: float, high: float) -> None:
        """Show the cells of a range."""
        self._means, self._image = means, means.image(low, high)
        self.updatePosition()
        self.show()

    def clear(self) -> None:
        """Show nothing."""
        self._means = self._image = None
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
        if self._means is None or self._image is None:
            return
        placed = self._placed(self._means, self._image)
        if placed is None:
            return
        back, invertible = placed.inverted()
        whole = QRectF(0, 0, self._image.width(), self._image.height())
        seen = back.mapRect(self.boundingRect()).intersected(whole) if invertible else whole
        if seen.isEmpty():
            return
        seen = QRectF(seen.toAlignedRect()).intersected(whole)
        painter.save()
        painter.setTransform(placed, True)
        painter.drawImage(seen, self._image, seen)
        painter.restore()

    def _placed(self, means: BlockMeans, image: QImage) -> QTransform | None:
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
        width, height = image.width(), image.height()
        ends = ((0, 0), (width, 0), (width, height), (0, height))
        source = QPolygonF([QPointF(x, y) for x, y in ends])
        transform = QTransform()
        return transform if QTransform.quadToQuad(source, target, transform) else None
