"""Upper part of the dock: the raster, the range over its histogram, and a sample on the map."""

from __future__ import annotations

from qgis.core import (
    QgsCoordinateTransform,
    QgsCsException,
    QgsDistanceArea,
    QgsMapLayerProxyModel,
    QgsPointXY,
    QgsProject,
    QgsRasterLayer,
)
from qgis.gui import QgsMapCanvas, QgsMapLayerComboBox
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from ..flags import field_name, in_dialog
from .block_means import BlockMeans
from .draw_tools import DiscTool
from .finder import DIVIDING, Found, RegionFinder
from .histogram_slider import HistogramSlider
from .intensity import LABELS, IntensityBox
from .preview_item import PreviewItem

SAMPLE = "Draw a sample on the map"
FIELDS = {
    **{flag: field_name(label) for flag, label in LABELS.items()},
    "--range": "“v from” and “to”",
    "--like": field_name(SAMPLE),
}


class RangePanel(QWidget):
    """Chooses what regions are looked for; `finder` finds them.

    While the range is dragged, cells of 8 x 8 pixels answer at once. When the hand lets go, the program finds
    the regions to the pixel, and stops if the range is moved again.
    """

    def __init__(self, canvas: QgsMapCanvas, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._canvas = canvas
        self.finder = RegionFinder(self)
        self.preview = PreviewItem(canvas)
        self.disc_tool = DiscTool(canvas)
        self.rasters, self.intensity = QgsMapLayerComboBox(), IntensityBox()
        self.slider, self.low, self.high = HistogramSlider(), _end("From v"), _end("To v")
        self.state, self.bar = QLabel(), QProgressBar()
        self.stop_button = QPushButton("Stop")
        self.sample = QPushButton(f"{SAMPLE}...")
        self._lay_out()
        self._connect()
        self._enable(False)

    def _lay_out(self) -> None:
        self.rasters.setFilters(QgsMapLayerProxyModel.RasterLayer)
        self.rasters.setAllowEmptyLayer(True)
        self.rasters.setLayer(None)
        for combo in (self.rasters, *self.intensity.findChildren(QComboBox)):
            narrow(combo)
        self.state.setWordWrap(True)
        self.state.setTextFormat(Qt.TextFormat.PlainText)  # names of files are in it
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.sample.setCheckable(True)
        self.sample.setToolTip(
            "Press in the middle of a sample on the map, drag to its edge: regions like it"
        )
        self.intensity.form.insertRow(0, "Raster", self.rasters)
        ends = QHBoxLayout()
        for widget in (QLabel("v from"), self.low, QLabel("to"), self.high):
            ends.addWidget(widget)
        ends.addStretch(1)
        work = QHBoxLayout()
        work.addWidget(self.bar, 1)
        work.addWidget(self.stop_button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.intensity)
        layout.addWidget(self.slider)
        layout.addLayout(ends)
        layout.addWidget(self.sample)
        layout.addLayout(work)
        layout.addWidget(self.state)
        self._progress(100)

    def _connect(self) -> None:
        self.rasters.layerChanged.connect(self._take_layer)
        self.intensity.changed.connect(self.take_raster)
        self.slider.moved.connect(self.show_range)
        self.slider.released.connect(self.find)
        for spin in (self.low, self.high):
            spin.valueChanged.connect(self._typed)
        self.sample.toggled.connect(self._draw)
        self.disc_tool.drawn.connect(self._match)
        self.disc_tool.deactivated.connect(lambda: self.sample.setChecked(False))
        self.stop_button.clicked.connect(self._stopped)
        self.finder.said.connect(self.state.setText)
        self.finder.failed.connect(self._failed)
        self.finder.progressed.connect(self._progress)
        self.finder.means_ready.connect(self._take_means)
        self.finder.regions_ready.connect(self._found)

    def _take_layer(self, layer: QgsRasterLayer | None) -> None:
        self.intensity.set_layer(layer)
        self.take_raster()

    def take_raster(self) -> None:
        """Take the raster that is chosen, and what its intensity is."""
        self.preview.clear()
        self.slider.set_histogram((), (0.0, 1.0))
        self._enable(False)
        layer = self.rasters.currentLayer()
        missing = self.intensity.missing
        self.state.setText(missing if layer else "Choose a raster")
        self.finder.set_raster(None if missing else layer, self.intensity.value())

    def show_range(self, low: float, high: float) -> None:
        """Show the cells of a range; a search for the regions of another is ended."""
        self.finder.cancel_search()
        self._progress(100)
        for spin, value in ((self.low, low), (self.high, high)):
            spin.blockSignals(True)
            spin.setValue(value)
            spin.blockSignals(False)
        if self.finder.means is not None:
            self.preview.show_range(self.finder.means, low, high)

    def find(self, low: float, high: float) -> None:
        """Find the exact regions of a range."""
        self.finder.find(low, high)

    def clean_up(self) -> None:
        """End processes and remove what is on the map."""
        self.finder.stop()
        self._canvas.unsetMapTool(self.disc_tool)
        self._canvas.scene().removeItem(self.preview)

    def _take_means(self, means: BlockMeans) -> None:
        self.slider.set_histogram(*means.histogram())
        self._enable(True)
        if self.state.text() in ("", DIVIDING):  # a warning stays
            self.state.setText("Drag the range, or draw a sample on the map")
        if not self.finder.is_running:  # regions like a sample may be looked for meanwhile
            self.show_range(self.slider.low, self.slider.high)

    def _enable(self, on: bool) -> None:
        for widget in (self.slider, self.low, self.high):
            widget.setEnabled(on)
        is_chosen = self.rasters.currentLayer() is not None and not self.intensity.missing
        self.sample.setEnabled(is_chosen)

    def _typed(self) -> None:
        self.slider.set_range(self.low.value(), self.high.value())
        self.show_range(self.slider.low, self.slider.high)
        self.find(self.slider.low, self.slider.high)

    def _draw(self, on: bool) -> None:
        if on:
            self._canvas.setMapTool(self.disc_tool)
            self.state.setText("Press in the middle of the sample on the map, and drag to its edge")
        else:
            self._canvas.unsetMapTool(self.disc_tool)

    def _match(self, center: QgsPointXY, edge: QgsPointXY) -> None:
        """Regions like a disc that was drawn in the CRS of the map."""
        self.sample.setChecked(False)
        crs = self.rasters.currentLayer().crs()
        settings = self._canvas.mapSettings()
        to_raster = QgsCoordinateTransform(settings.destinationCrs(), crs, QgsProject.instance())
        try:
            middle, rim = to_raster.transform(center), to_raster.transform(edge)
        except QgsCsException as error:
            self._failed(str(error))
            return
        radius = middle.distance(rim)
        if crs.isGeographic():
            earth = QgsDistanceArea()
            earth.setSourceCrs(crs, QgsProject.instance().transformContext())
            earth.setEllipsoid(crs.ellipsoidAcronym() or "EPSG:7030")
            radius = earth.measureLine(middle, rim)
        self.preview.clear()
        self.finder.match(middle, radius)

    def _found(self, found: Found) -> None:
        self.preview.clear()
        kinds = ("note: ", "warning: ", "uavseg: warning: ")
        said = " ".join(line for line in found.said if line.startswith(kinds))
        self.state.setText(in_dialog(said, FIELDS))

    def _stopped(self) -> None:
        self.finder.cancel()
        is_ready = self.finder.means is not None
        self.state.setText(
            "Stopped" if is_ready else "Stopped; choose the raster again to make its block map"
        )

    def _failed(self, text: str) -> None:
        self.state.setText(in_dialog(text, FIELDS))

    def _progress(self, share: int) -> None:
        self.bar.setValue(share)
        for widget in (self.bar, self.stop_button):
            widget.setVisible(share < 100)


def narrow(combo: QComboBox) -> None:
    """Let a combo box be narrower than its texts, so that the dock can be narrow."""
    combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    combo.setMinimumContentsLength(8)


def _end(name: str) -> QDoubleSpinBox:
    spin = QDoubleSpinBox()
    spin.setRange(0, 1)
    spin.setDecimals(3)
    spin.setSingleStep(0.01)
    spin.setKeyboardTracking(False)
    spin.setAccessibleName(name)
    spin.setValue(0.55 if name.startswith("From") else 1.0)
    return spin
