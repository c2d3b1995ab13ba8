"""A histogram with two handles: the range slider of the dock."""

from __future__ import annotations

from collections.abc import Sequence

from qgis.PyQt.QtCore import QPointF, QRectF, QSize, Qt, pyqtSignal
from qgis.PyQt.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPolygonF
from qgis.PyQt.QtWidgets import QSizePolicy, QWidget

INSIDE, OUTSIDE = QColor(255, 140, 0), QColor(150, 150, 150)
_MARGIN, _HANDLE = 9, 12
LEAST = 0.001
"""Least width of a range; an empty one is refused by the program."""

_LEFT, _RIGHT = Qt.Key.Key_Left, Qt.Key.Key_Right


class HistogramSlider(QWidget):
    """A range of v over the histogram of a raster.

    The handle that is nearer is dragged; between the handles the whole range is moved. Arrow keys move the
    handle that was used last, with Shift ten times as far.

    Signals
    -------
    moved : float, float
        The range, while it is dragged.
    released : float, float
        The range, when the hand lets go.
    """

    moved = pyqtSignal(float, float)
    released = pyqtSignal(float, float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.low, self.high = 0.55, 1.0
        self._bins: Sequence[int] = ()
        self._span = (0.0, 1.0)
        self._held = "high"
        self._from: float | None = None
        self.setMinimumHeight(96)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Range of v over the histogram of the raster")
        self.setToolTip("Drag a handle, or what lies between them; arrow keys move the handle used last")

    def sizeHint(self) -> QSize:
        return QSize(280, 110)

    def set_histogram(self, bins: Sequence[int], span: tuple[float, float]) -> None:
        """Show a histogram.

        Parameters
        ----------
        bins : sequence of int
        span : (float, float)
            The range of v that the bins span.
        """
        self._bins, self._span = bins, span
        self.update()

    def set_range(self, low: float, high: float) -> None:
        """Show a range, without a signal."""
        self.low = min(low, high, 1.0 - LEAST)
        self.high = max(low, high, round(self.low + LEAST, 3))
        self.update()

    def x_of(self, value: float) -> float:
        """Where a value lies, in pixels of the widget."""
        low, high = self._span
        share = (value - low) / (high - low)
        return _MARGIN + min(max(share, 0.0), 1.0) * (self.width() - 2 * _MARGIN)

    def value_at(self, x: float) -> float:
        """The value at a place; beyond the histogram 0 or 1, so that a range can be open."""
        low, high = self._span
        share = (x - _MARGIN) / max(self.width() - 2 * _MARGIN, 1)
        if share <= 0:
            return 0.0
        return 1.0 if share >= 1 else round(low + share * (high - low), 3)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        x = event.pos().x()
        to_low, to_high = abs(x - self.x_of(self.low)), abs(x - self.x_of(self.high))
        between = self.x_of(self.low) + _HANDLE < x < self.x_of(self.high) - _HANDLE
        if between:
            self._held = "both"
        else:
            self._held = "low" if to_low < to_high or (to_low == to_high and x < to_low) else "high"
        self._from = self.value_at(x)
        if not between:
            self._drag(self._from)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._from is not None:
            self._drag(self.value_at(event.pos().x()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._from is not None and event.button() == Qt.MouseButton.LeftButton:
            self._from = None
            self.released.emit(self.low, self.high)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() not in (_LEFT, _RIGHT):
            super().keyPressEvent(event)
            return
        step = 0.01 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 0.001
        step = -step if event.key() == _LEFT else step
        self._shift(step) if self._held == "both" else self._drag(getattr(self, self._held) + step)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        if event.key() in (_LEFT, _RIGHT) and not event.isAutoRepeat():
            self.released.emit(self.low, self.high)
        else:
            super().keyReleaseEvent(event)

    def _drag(self, value: float) -> None:
        """Take what is held to a value; a handle does not pass the other."""
        value = min(max(round(value, 3), 0.0), 1.0)
        if self._held == "both":
            step, self._from = value - (value if self._from is None else self._from), value
            self._shift(step)
            return
        if self._held == "low":
            self.low = min(value, round(self.high - LEAST, 3))
        else:
            self.high = max(value, round(self.low + LEAST, 3))
        self._tell()

    def _shift(self, step: float) -> None:
        step = min(max(step, -self.low), 1.0 - self.high)
        self.low, self.high = round(self.low + step, 3), round(self.high + step, 3)
        self._tell()

    def _tell(self) -> None:
        self.update()
        self.moved.emit(self.low, self.high)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        base = self.height() - _HANDLE - 4
        self._paint_bars(painter, base)
        painter.setPen(self.palette().text().color())
        painter.drawLine(QPointF(_MARGIN, base), QPointF(self.width() - _MARGIN, base))
        for value in (self.low, self.high):
            x = self.x_of(value)
            painter.setPen(self.palette().text().color())
            painter.drawLine(QPointF(x, 2), QPointF(x, base))
            painter.setBrush(INSIDE)
            half = _HANDLE / 2
            below = base + _HANDLE
            painter.drawPolygon(
                QPolygonF([QPointF(x, base), QPointF(x - half, below), QPointF(x + half, below)])
            )
        if self.hasFocus():
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(self.palette().highlight().color())
            painter.drawRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5))
        painter.end()

    def _paint_bars(self, painter: QPainter, base: float) -> None:
        """The histogram; heights are square roots, so that small peaks are seen beside large ones."""
        if not self._bins:
            return
        tallest = max(self._bins) ** 0.5 or 1.0
        width = (self.width() - 2 * _MARGIN) / len(self._bins)
        low, high = self._span
        painter.setPen(Qt.PenStyle.NoPen)
        for k, count in enumerate(self._bins):
            middle = low + (k + 0.5) / len(self._bins) * (high - low)
            painter.setBrush(INSIDE if self.low <= middle <= self.high else OUTSIDE)
            height = (base - 4) * count**0.5 / tallest
            painter.drawRect(QRectF(_MARGIN + k * width, base - height, width, height))
