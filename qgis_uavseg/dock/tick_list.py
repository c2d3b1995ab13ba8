"""Regions to tick: a list beside the map, and how ticked and other regions are drawn."""

from __future__ import annotations

from collections.abc import Iterable

from qgis.core import QgsFeature, QgsFeatureRequest, QgsFillSymbol, QgsRuleBasedRenderer, QgsVectorLayer
from qgis.PyQt.QtCore import Qt, pyqtSignal
from qgis.PyQt.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem, QWidget

MOST = 5000
"""Regions that are listed: the largest."""

_ID = Qt.ItemDataRole.UserRole
_TICKED = {"color": "255,165,0,90", "outline_color": "#c46a00", "outline_width": "0.6"}
_OTHER = {
    "color": "0,0,0,0",
    "outline_color": "#1f5fa8",
    "outline_width": "0.5",
    "outline_style": "dash",
}
COLUMNS = (
    ("area_m2", "Area in m²", "{:,.0f}"),
    ("mean", "Mean v", "{:.3f}"),
    ("similarity", "Similarity", "{:.3f}"),
)


class TickList(QTreeWidget):
    """A row with a box for each region.

    Signals
    -------
    ticked : set of int
        Ids of the regions that are ticked, when they change.
    """

    ticked = pyqtSignal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setAlternatingRowColors(True)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setMinimumHeight(110)
        self.setAccessibleName("Regions; those that are ticked are flown over")
        self.total = 0
        self._rows: dict[int, QTreeWidgetItem] = {}
        self.itemChanged.connect(lambda item, column: self.ticked.emit(self.ids()))

    def show_regions(self, layer: QgsVectorLayer | None) -> None:
        """List the regions of a layer, all of them ticked."""
        self.blockSignals(True)
        self.clear()
        self._rows = {}
        attributes = QgsFeatureRequest().setFlags(QgsFeatureRequest.NoGeometry)
        features = [] if layer is None else list(layer.getFeatures(attributes))
        self.total = len(features)
        shown = [column for column in COLUMNS if layer is not None and layer.fields().indexOf(column[0]) >= 0]
        self.setHeaderLabels(["Region", *(label for _, label, _ in shown)])
        features.sort(key=lambda feature: feature["id"])  # by area, the largest first
        for feature in features[:MOST]:
            self._add(feature, shown)
        for column in range(self.columnCount()):
            self.header().setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        self.blockSignals(False)
        self.ticked.emit(self.ids())

    def ids(self) -> set[int]:
        """Ids of the regions that are ticked."""
        return {key for key, row in self._rows.items() if row.checkState(0) == Qt.CheckState.Checked}

    def are_all_ticked(self) -> bool:
        """Whether every region is ticked, and none is left out of the list."""
        return bool(self._rows) and len(self.ids()) == self.total

    def tick(self, ids: Iterable[int], on: bool) -> None:
        """Tick regions, or untick them."""
        state = Qt.CheckState.Checked if on else Qt.CheckState.Unchecked
        self.blockSignals(True)
        for key in ids:
            if key in self._rows:
                self._rows[key].setCheckState(0, state)
        self.blockSignals(False)
        self.viewport().update()
        self.ticked.emit(self.ids())

    def tick_all(self, on: bool) -> None:
        """Tick all that are listed, or none."""
        self.tick(list(self._rows), on)

    def toggle(self, key: int) -> None:
        """Tick a region that is not ticked, and the other way round."""
        if key in self._rows:
            self.tick([key], key not in self.ids())
            self.scrollToItem(self._rows[key])

    def _add(self, feature: QgsFeature, columns: list[tuple[str, str, str]]) -> None:
        key = int(feature["id"])
        texts = [
            form.format(feature[name]) if isinstance(feature[name], (int, float)) else ""
            for name, _, form in columns
        ]
        row = QTreeWidgetItem(self, [str(key), *texts])
        row.setCheckState(0, Qt.CheckState.Checked)
        row.setData(0, _ID, key)
        for column in range(1, 1 + len(columns)):
            row.setTextAlignment(column, int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter))
        self._rows[key] = row


def show_ticks(layer: QgsVectorLayer, ids: set[int]) -> None:
    """Draw ticked regions filled, the others as dashed outlines."""
    root = QgsRuleBasedRenderer.Rule(None)
    condition = f'"id" IN ({",".join(map(str, sorted(ids)))})' if ids else "FALSE"
    root.appendChild(
        QgsRuleBasedRenderer.Rule(QgsFillSymbol.createSimple(_TICKED), 0, 0, condition, "ticked")
    )
    other = QgsRuleBasedRenderer.Rule(QgsFillSymbol.createSimple(_OTHER), 0, 0, "", "not ticked")
    other.setIsElse(True)
    root.appendChild(other)
    layer.setRenderer(QgsRuleBasedRenderer(root))
    layer.triggerRepaint()
