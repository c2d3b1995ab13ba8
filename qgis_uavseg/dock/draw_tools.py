"""Map tools of the dock: a disc, a polygon, a place."""

from __future__ import annotations

import math

from qgis.core import QgsGeometry, QgsPointXY, QgsWkbTypes
from qgis.gui import QgsMapCanvas, QgsMapMouseEvent, QgsMapTool, QgsRubberBand
from qgis.PyQt.QtCore import Qt, pyqtSignal
from qgis.PyQt.QtGui import QColor, QKeyEvent

_SIDES = 72
DISC_COLOR, ZONE_COLOR = QColor(31, 120, 180, 90), QColor(227, 26, 28, 90)


def band(canvas: QgsMapCanvas, color: QColor) -> QgsRubberBand:
    """A polygon that is drawn over the map."""
    made = QgsRubberBand(canvas, QgsWkbTypes.PolygonGeometry)
    made.setFillColor(color)
    made.setStrokeColor(QColor(color.red(), color.green(), color.blue()))
    made.setWidth(2)
    return made


def disc(center: QgsPointXY, radius: float) -> QgsGeometry:
    """A disc as a polygon."""
    turns = [2 * math.pi * k / _SIDES for k in range(_SIDES)]
    ring = [
        QgsPointXY(center.x() + radius * math.cos(turn), center.y() + radius * math.sin(turn))
        for turn in turns
    ]
    return QgsGeometry.fromPolygonXY([ring])


class _Drawing(QgsMapTool):
    """A tool with a polygon in progress, which Escape gives up."""

    def __init__(self, canvas: QgsMapCanvas, color: QColor) -> None:
        super().__init__(canvas)
        self.setCursor(Qt.CursorShape.CrossCursor)
        self._band = band(canvas, color)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            event.accept()
            self.give_up()

    def give_up(self) -> None:
        """Forget what was begun."""
        self._band.reset(QgsWkbTypes.PolygonGeometry)

    def deactivate(self) -> None:
        self.give_up()
        super().deactivate()


class DiscTool(_Drawing):
    """Press in the middle, drag to the edge.

    Signals
    -------
    drawn : QgsPointXY, QgsPointXY
        The middle and a point of the edge, in the CRS of the map.
    """

    drawn = pyqtSignal(QgsPointXY, QgsPointXY)

    def __init__(self, canvas: QgsMapCanvas) -> None:
        super().__init__(canvas, DISC_COLOR)
        self._center: QgsPointXY | None = None

    def canvasPressEvent(self, event: QgsMapMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._center = event.mapPoint()

    def canvasMoveEvent(self, event: QgsMapMouseEvent) -> None:
        if self._center is not None:
            shape = disc(self._center, self._center.distance(event.mapPoint()))
            self._band.setToGeometry(shape, None)

    def canvasReleaseEvent(self, event: QgsMapMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or self._center is None:
            return
        center, edge = self._center, event.mapPoint()
        self.give_up()
        if center.distance(edge) > 0:
            self.drawn.emit(center, edge)

    def give_up(self) -> None:
        super().give_up()
        self._center = None


class PolygonTool(_Drawing):
    """A click sets a corner, a right click or a double click ends, Backspace takes the last corner back.

    Signals
    -------
    drawn : QgsGeometry
        In the CRS of the map.
    """

    drawn = pyqtSignal(QgsGeometry)

    def __init__(self, canvas: QgsMapCanvas) -> None:
        super().__init__(canvas, ZONE_COLOR)
        self._corners: list[QgsPointXY] = []

    def canvasReleaseEvent(self, event: QgsMapMouseEvent) -> None:
        if event.button() == Qt.MouseButton.RightButton:
            self._end()
        elif event.button() == Qt.MouseButton.LeftButton:
            place = event.mapPoint()
            if not self._corners or self._corners[-1] != place:
                self._corners.append(place)
            self._show([*self._corners, place])

    def canvasMoveEvent(self, event: QgsMapMouseEvent) -> None:
        if self._corners:
            self._show([*self._corners, event.mapPoint()])

    def canvasDoubleClickEvent(self, event: QgsMapMouseEvent) -> None:
        self._end()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Backspace:
            event.accept()
            self._corners = self._corners[:-1]
            self._show(self._corners)
        else:
            super().keyPressEvent(event)

    def give_up(self) -> None:
        super().give_up()
        self._corners = []

    def _show(self, corners: list[QgsPointXY]) -> None:
        self._band.setToGeometry(QgsGeometry.fromPolygonXY([corners]), None)

    def _end(self) -> None:
        corners = self._corners
        self.give_up()
        if len(corners) >= 3:
            self.drawn.emit(QgsGeometry.fromPolygonXY([corners]))


class PlaceTool(QgsMapTool):
    """A click chooses a place.

    Signals
    -------
    chosen : QgsPointXY
        In the CRS of the map.
    """

    chosen = pyqtSignal(QgsPointXY)

    def __init__(self, canvas: QgsMapCanvas) -> None:
        super().__init__(canvas)
        self.setCursor(Qt.CursorShape.CrossCursor)

    def canvasReleaseEvent(self, event: QgsMapMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.chosen.emit(event.mapPoint())
