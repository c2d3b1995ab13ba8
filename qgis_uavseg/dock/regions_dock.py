"""The dock "Regions": from a range or a sample to regions, from ticked regions to a mission."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsCoordinateTransform,
    QgsCsException,
    QgsFeatureRequest,
    QgsGeometry,
    QgsMapLayer,
    QgsPointXY,
    QgsProcessingException,
    QgsProject,
    QgsVectorLayer,
)
from qgis.gui import QgsDockWidget
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import (
    QFileDialog,
    QGridLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from ..algorithms.plan import MISSION_EXTENSIONS, TARGET_FILTER
from ..flags import in_dialog
from .draw_tools import PlaceTool
from .finder import Found
from .mission import MissionPlanner, MissionRequest, Planned, escaped, summary
from .mission_layers import footprints_layer, legs_layer, not_shown
from .mission_panel import FIELDS, MissionPanel
from .range_panel import RangePanel
from .tick_list import TickList, show_ticks

TITLE = "Regions"


class RegionsDock(QgsDockWidget):
    """What the user sees; processes are those of the finder and the planner.

    Parameters
    ----------
    iface : QgisInterface
    """

    def __init__(self, iface: Any) -> None:
        super().__init__(TITLE, iface.mainWindow())
        self.setObjectName("UavsegRegionsDock")
        self._iface, self._canvas = iface, iface.mapCanvas()
        self._shown_ids: dict[str, str] = {}
        self._seen: MissionRequest | None = None
        self._saved_as: Path | None = None
        self.range, self.ticks = RangePanel(self._canvas), TickList()
        self.mission, self.planner = MissionPanel(self._canvas), MissionPlanner(self)
        self.tick_tool = PlaceTool(self._canvas)
        self.all_button, self.none_button = QPushButton("Tick all"), QPushButton("Tick none")
        self.tick_button, self.keep_button = QPushButton("Tick on the map"), QPushButton("Save regions...")
        self.gaps_button = QPushButton("Gaps of photographs...")
        self.gaps_button.setToolTip("After a flight: what its photographs missed, as regions to fly over")
        self.count = QLabel()
        self._lay_out()
        self._connect()
        self.ticks.show_regions(None)

    def _lay_out(self) -> None:
        buttons = QGridLayout()
        self.tick_button.setCheckable(True)
        for k, button in enumerate((self.all_button, self.none_button, self.tick_button, self.keep_button)):
            buttons.addWidget(button, k // 2, k % 2)
        inside = QWidget()
        layout = QVBoxLayout(inside)
        layout.addWidget(self.range)
        layout.addWidget(self.count)
        layout.addWidget(self.ticks, 1)
        layout.addLayout(buttons)
        layout.addWidget(self.gaps_button)
        layout.addWidget(self.mission)
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(inside)
        bar = area.verticalScrollBar().sizeHint().width()
        area.setMinimumWidth(inside.minimumSizeHint().width() + bar + 2 * area.frameWidth())
        self.setWidget(area)

    def _connect(self) -> None:
        self.range.finder.regions_ready.connect(self.show_regions)
        self.ticks.ticked.connect(self._ticked)
        self.all_button.clicked.connect(lambda: self.ticks.tick_all(True))
        self.none_button.clicked.connect(lambda: self.ticks.tick_all(False))
        self.tick_button.toggled.connect(self._tick_on_map)
        self.tick_tool.chosen.connect(self.tick_at)
        self.tick_tool.deactivated.connect(lambda: self.tick_button.setChecked(False))
        self.keep_button.clicked.connect(self.keep_regions)
        self.gaps_button.clicked.connect(self.ask_for_gaps)
        self.mission.on_change(self.forget_mission)
        self.mission.preview_button.clicked.connect(self.preview)
        self.mission.save_button.clicked.connect(self.ask_and_save)
        self.mission.more_button.clicked.connect(self.open_dialog)
        self.planner.shown.connect(self._show_mission)
        self.planner.saved.connect(self._saved)
        self.planner.failed.connect(self._refuse)
        self.closed.connect(self.range.preview.clear)
        QgsProject.instance().layerRemoved.connect(self._layer_removed)

    def layer(self, name: str = "regions") -> QgsVectorLayer | None:
        """A layer that the dock shows: regions, legs or footprints."""
        found = QgsProject.instance().mapLayer(self._shown_ids.get(name, ""))
        return found if isinstance(found, QgsVectorLayer) else None

    def show_regions(self, found: Found) -> None:
        """Show regions in place of those before."""
        self.forget_mission()
        raster = self.range.finder.raster
        title = f"Regions of {raster.stem}, {found.title}" if raster else f"Regions, {found.title}"
        layer = QgsVectorLayer(f"{found.path}|layername={found.path.stem}", title, "ogr")
        if not layer.isValid():
            layer = QgsVectorLayer(str(found.path), title, "ogr")
        self._show("regions", layer)
        self.ticks.show_regions(layer)

    def ask_for_gaps(self) -> None:
        """Compare photographs with a mission in the dialog of Processing, and show their gaps as regions."""
        import processing

        given = {"INPUT": str(self._saved_as)} if self._saved_as else {}
        results = processing.execAlgorithmDialog("uavseg:gaps", given)
        if results and results.get("OUTPUT"):
            self.show_gaps(Path(results["OUTPUT"]))

    def show_gaps(self, path: Path) -> None:
        """Show the gaps of a survey in place of the regions before; a layer of them in the project goes."""
        project = QgsProject.instance()
        for layer in list(project.mapLayers().values()):
            if _file_of(layer) == path:
                project.removeMapLayer(layer)
        self.show_regions(Found(path, "gaps of the photographs", ()))

    def preview(self) -> None:
        """Plan a mission over the ticked regions, to look at."""
        request = self.request()
        if request is not None:
            self.mission.estimate.setText("Planned...")
            self.planner.preview(request)

    def request(self) -> MissionRequest | None:
        """What is to be planned; None where something is missing, which is said then."""
        layer = self.layer()
        options = self.mission.options()
        home = self.mission.places.home
        missing = ""
        if layer is None:
            missing = "Find regions first: choose a raster and drag the range"
        elif not self.ticks.ids():
            missing = "Tick the regions that are to be flown over"
        elif home is None and dict(options)["--home-altitude"]:
            missing = "A height of home is given, but no home: set home on the map"
        zones = None
        try:
            zones = self.mission.places.zone_file()
        except QgsProcessingException as error:
            missing = missing or str(error)
        if layer is None or missing:
            self._refuse(missing)
            return None
        ids = None if self.ticks.are_all_ticked() else tuple(sorted(self.ticks.ids()))
        return MissionRequest(_file_of(layer), ids, options, home, zones)

    def ask_and_save(self) -> None:
        """Ask for a file, and write the mission that was seen."""
        path, chosen = QFileDialog.getSaveFileName(self, "Save mission", "", TARGET_FILTER)
        if path:
            self.save(Path(path) if Path(path).suffix else Path(f"{path}.{_suffix(chosen)}"))

    def save(self, target: Path) -> None:
        """Write the mission that was seen."""
        if self._seen is None:
            self._refuse("Press Plan mission first, and look at it")
        elif target.suffix.lower().lstrip(".") not in MISSION_EXTENSIONS:
            self._refuse(f"{target.name} ends in none of .{', .'.join(MISSION_EXTENSIONS)}")
        else:
            self.planner.save(self._seen, target)

    def forget_mission(self) -> None:
        """What was seen is not what would be saved any more."""
        self.planner.drop_preview()
        self._seen = None
        self.mission.save_button.setEnabled(False)
        self.mission.estimate.setText("")
        for name in ("legs", "footprints"):
            self._remove(name)

    def open_dialog(self) -> None:
        """All options of Plan mission in the dialog of Processing, with the regions chosen."""
        import processing

        layer, zones, home = self.layer(), self.mission.places.layer(), self.mission.places.home
        given: dict[str, Any] = {
            flag.lstrip("-").upper().replace("-", "_"): text for flag, text in self.mission.options() if text
        }
        if layer is not None:
            given["REGIONS"] = layer.id()
        if layer is not None and self.ticks.ids() and not self.ticks.are_all_ticked():
            given["WHERE"] = "id in (" + ", ".join(map(str, sorted(self.ticks.ids()))) + ")"
        if zones is not None:
            given["AVOID"] = [zones.id()]
        if home is not None:
            given["HOME"] = f"{home.x():.9f},{home.y():.9f} [EPSG:4326]"
        processing.execAlgorithmDialog("uavseg:plan", given)

    def keep_regions(self) -> None:
        """Copy the regions to a file that stays."""
        layer = self.layer()
        if layer is None:
            self._refuse("There are no regions to save")
            return
        path, _ = QFileDialog.getSaveFileName(self, "Save regions", "", "GeoPackage (*.gpkg)")
        if not path:
            return
        target = path if path.endswith(".gpkg") else f"{path}.gpkg"
        try:
            shutil.copyfile(_file_of(layer), target)
        except OSError as error:
            self._refuse(f"{target} cannot be written: {error.strerror or error}")
            return
        self.count.setText(f"saved: {target}")

    def tick_at(self, place: QgsPointXY) -> None:
        """Tick or untick the region at a place, in the CRS of the map."""
        layer = self.layer()
        if layer is None:
            return
        crs = self._canvas.mapSettings().destinationCrs()
        try:
            here = QgsCoordinateTransform(crs, layer.crs(), QgsProject.instance()).transform(place)
        except QgsCsException:
            return
        spot = QgsGeometry.fromPointXY(here)
        for feature in layer.getFeatures(QgsFeatureRequest().setFilterRect(spot.boundingBox())):
            if feature.geometry().contains(spot):
                self.ticks.toggle(int(feature["id"]))

    def clean_up(self) -> None:
        """End processes and remove what is on the map; layers stay in the project."""
        QgsProject.instance().layerRemoved.disconnect(self._layer_removed)
        self.planner.stop()
        self._canvas.unsetMapTool(self.tick_tool)
        self.range.clean_up()
        self.mission.clean_up()

    def _ticked(self, ids: set[int]) -> None:
        self.forget_mission()
        layer = self.layer()
        if layer is not None:
            show_ticks(layer, ids)
        listed = self.ticks.topLevelItemCount()
        more = (
            f"; only the {listed} largest are listed and can be flown over"
            if listed < self.ticks.total
            else ""
        )
        none = "No regions yet" if layer is None else "No region has a mean in this range"
        self.count.setText(
            f"{len(ids)} of {self.ticks.total} regions are ticked{more}" if self.ticks.total else none
        )

    def _tick_on_map(self, on: bool) -> None:
        self._canvas.setMapTool(self.tick_tool) if on else self._canvas.unsetMapTool(self.tick_tool)

    def _show_mission(self, planned: Planned) -> None:
        flights = planned.found["flights"]
        self._show("footprints", footprints_layer(flights))
        self._show("legs", legs_layer(planned.files))
        self._seen = planned.request
        self.mission.save_button.setEnabled(True)
        self._say(planned, not_shown(flights))

    def _saved(self, planned: Planned) -> None:
        self._saved_as = planned.files[0]
        self._say(planned, f"<b>saved:</b> {escaped(', '.join(map(str, planned.files)))}<br>")

    def _say(self, planned: Planned, first: str) -> None:
        self.mission.estimate.setText(first + in_dialog(summary(planned.found), FIELDS))

    def _refuse(self, text: str) -> None:
        self.mission.estimate.setText(
            f'<span style="color:#b00020">{escaped(in_dialog(text, FIELDS))}</span>'
        )

    def _show(self, name: str, layer: QgsVectorLayer | None) -> None:
        """Show a layer on top, in place of the one of that name before."""
        self._remove(name)
        if layer is not None:
            self._shown_ids[name] = layer.id()
            QgsProject.instance().addMapLayer(layer)

    def _remove(self, name: str) -> None:
        layer_id = self._shown_ids.pop(name, "")
        if layer_id and QgsProject.instance().mapLayer(layer_id) is not None:
            QgsProject.instance().removeMapLayer(layer_id)

    def _layer_removed(self, layer_id: str) -> None:
        """A layer that the user removes is not there any more."""
        gone = [name for name, shown in self._shown_ids.items() if shown == layer_id]
        for name in gone:
            del self._shown_ids[name]
        if "regions" in gone:
            self.ticks.show_regions(None)


def _file_of(layer: QgsMapLayer) -> Path:
    return Path(layer.source().split("|")[0])


def _suffix(chosen: str) -> str:
    """The extension of a filter such as `KML (*.kml)`."""
    return chosen.rsplit("*.", 1)[-1].rstrip(")") or MISSION_EXTENSIONS[0]
