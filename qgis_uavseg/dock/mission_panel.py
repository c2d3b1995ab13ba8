"""Lower part of the dock: how the ticked regions are flown over, home and keep-out zones on the map."""

from __future__ import annotations

from typing import Callable

from qgis.core import QgsGeometry, QgsPointXY
from qgis.gui import QgsMapCanvas
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QGridLayout,
    QGroupBox,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from ..algorithms.plan import AUTOPILOTS, PATTERNS
from ..flags import field_name
from ..options import plain
from .draw_tools import PlaceTool, PolygonTool
from .home_and_zones import HomeAndZones, PlaceError
from .mission import escaped
from .range_panel import narrow

DEFAULT_ALTITUDE_M = 60.0
LABELS = {
    "--altitude": "Height above home",
    "--pattern": "Pattern",
    "--camera": "Camera",
    "--gsd": "Ground sampling",
    "--spacing": "Between lines",
    "--autopilot": "Autopilot",
    "--endurance": "Endurance",
    "--home-altitude": "Home above the sea",
    "--home": "Home",
    "--avoid": "Keep-out",
}
FIELDS = {flag: field_name(label) for flag, label in LABELS.items()}  # what messages write for a flag


class MissionPanel(QGroupBox):
    """Options of a mission; the dock plans it."""

    def __init__(self, canvas: QgsMapCanvas, parent: QWidget | None = None) -> None:
        super().__init__("Mission over the ticked regions", parent)
        self._canvas = canvas
        self.places = HomeAndZones(canvas, self)
        self.home_tool, self.zone_tool = PlaceTool(canvas), PolygonTool(canvas)
        self.altitude = _number(" m", "without", DEFAULT_ALTITUDE_M, 500)
        self.gsd = _number(" cm", "from the height", 0, 100)
        self.spacing = _number(" m", "from the camera", 0, 1000)
        self.home_altitude = _number(" m", "not known", 0, 9000, lowest=-500)
        self.endurance = _number(" min", "one flight", 0, 600)
        self.pattern, self.autopilot = _choice(PATTERNS), _choice(AUTOPILOTS)
        self.camera = QLineEdit()
        self.camera.setPlaceholderText("none, or e.g. DJI Mavic 3 Enterprise")
        self.home_button, self.zone_button = QPushButton("Set..."), QPushButton("Draw...")
        self.clear_home, self.clear_zones = QPushButton("Clear"), QPushButton("Clear")
        self.home_label, self.zone_label = QLabel(), QLabel()
        self.preview_button, self.save_button = QPushButton("Plan mission"), QPushButton("Save mission...")
        self.more_button = QPushButton("All options...")
        self.estimate = QLabel()
        self._lay_out()
        self._connect()
        self._say_places()

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        rows = (
            ("--altitude", self.altitude),
            ("--pattern", self.pattern),
            ("--camera", self.camera),
            ("--gsd", self.gsd),
            ("--spacing", self.spacing),
            ("--autopilot", self.autopilot),
            ("--endurance", self.endurance),
            ("--home-altitude", self.home_altitude),
        )
        for flag, widget in rows:
            form.addRow(LABELS[flag], widget)
        places = QGridLayout()
        for row, parts in enumerate(
            (
                (QLabel(LABELS["--home"]), self.home_label, self.home_button, self.clear_home),
                (QLabel(LABELS["--avoid"]), self.zone_label, self.zone_button, self.clear_zones),
            )
        ):
            for column, part in enumerate(parts):
                places.addWidget(part, row, column)
        places.setColumnStretch(1, 1)
        buttons = QGridLayout()
        buttons.addWidget(self.preview_button, 0, 0)
        buttons.addWidget(self.save_button, 0, 1)
        buttons.addWidget(self.more_button, 1, 0, 1, 2)
        for button in (self.home_button, self.zone_button):
            button.setCheckable(True)
        widest = self.fontMetrics().horizontalAdvance("-00.000000, -000.000000")
        self.home_label.setMinimumWidth(widest)
        self.home_button.setToolTip("Click on the map where the vehicle takes off")
        self.zone_button.setToolTip("Click the corners on the map; a right click ends the zone")
        for combo in (self.pattern, self.autopilot):
            narrow(combo)
        self.save_button.setEnabled(False)
        self.save_button.setToolTip("After Plan mission, when legs and estimates can be seen")
        self.estimate.setWordWrap(True)
        self.estimate.setTextFormat(Qt.TextFormat.RichText)
        self.estimate.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        layout = QVBoxLayout(self)
        for part in (form, places, buttons):
            layout.addLayout(part)
        layout.addWidget(self.estimate)

    def _connect(self) -> None:
        for button, tool in ((self.home_button, self.home_tool), (self.zone_button, self.zone_tool)):
            button.toggled.connect(self._switch(tool))
            tool.deactivated.connect(lambda button=button: button.setChecked(False))
        self.home_tool.chosen.connect(self._set_home)
        self.zone_tool.drawn.connect(self._add_zone)
        self.clear_home.clicked.connect(lambda: self.places.set_home(None))
        self.clear_zones.clicked.connect(self.places.clear_zones)
        self.places.changed.connect(self._say_places)
        self.gsd.valueChanged.connect(lambda value: self.altitude.setEnabled(not _text(self.gsd)))

    def on_change(self, call: Callable[[], None]) -> None:
        """Call when anything that a mission depends on is changed."""
        for spin in (self.altitude, self.gsd, self.spacing, self.home_altitude, self.endurance):
            spin.valueChanged.connect(lambda value: call())
        for choice in (self.pattern, self.autopilot):
            choice.currentIndexChanged.connect(lambda index: call())
        self.camera.textChanged.connect(lambda text: call())
        self.places.changed.connect(call)

    def options(self) -> tuple[tuple[str, str], ...]:
        """Options of `uavseg plan` and their values; empty for what is left to the program.

        A ground sampling distance gives the height, so the height is left out then.
        """
        height = "" if _text(self.gsd) else _text(self.altitude)
        return (
            ("--altitude", height),
            ("--gsd", _text(self.gsd)),
            ("--pattern", self.pattern.currentData()),
            ("--camera", self.camera.text().strip()),
            ("--spacing", _text(self.spacing)),
            ("--autopilot", self.autopilot.currentData()),
            ("--endurance", _text(self.endurance)),
            ("--home-altitude", _text(self.home_altitude)),
        )

    def clean_up(self) -> None:
        """Remove what is on the map."""
        for tool in (self.home_tool, self.zone_tool):
            self._canvas.unsetMapTool(tool)
        self.places.clean_up()

    def _switch(self, tool: PlaceTool | PolygonTool) -> Callable[[bool], None]:
        def switch(on: bool) -> None:
            if on:
                self._canvas.setMapTool(tool)
            else:
                self._canvas.unsetMapTool(tool)

        return switch

    def _set_home(self, place: QgsPointXY) -> None:
        self.home_button.setChecked(False)
        self._try(lambda: self.places.set_home(place))

    def _add_zone(self, outline: QgsGeometry) -> None:
        self._try(lambda: self.places.add_zone(outline))

    def _try(self, act: Callable[[], None]) -> None:
        """Set a place; one that has no longitude and latitude is refused."""
        try:
            act()
        except PlaceError as error:
            self.estimate.setText(escaped(str(error)))

    def _say_places(self) -> None:
        home, zones = self.places.home, self.places.count_zones()
        self.home_label.setText(
            "chosen by the program" if home is None else f"{home.y():.6f}, {home.x():.6f}"
        )
        self.zone_label.setText(f"{zones} zone{'' if zones == 1 else 's'}" if zones else "none")
        self.clear_home.setEnabled(home is not None)
        self.clear_zones.setEnabled(zones > 0)


def _number(suffix: str, empty: str, value: float, most: float, lowest: float = 0.0) -> QDoubleSpinBox:
    """A number whose lowest value stands for an empty one."""
    spin = QDoubleSpinBox()
    spin.setRange(lowest, most)
    spin.setDecimals(2)
    spin.setSuffix(suffix)
    spin.setSpecialValueText(empty)
    spin.setValue(value if value else lowest)
    return spin


def _text(spin: QDoubleSpinBox) -> str:
    return "" if spin.value() == spin.minimum() else plain(spin.value())


def _choice(words: tuple[str, ...]) -> QComboBox:
    combo = QComboBox()
    combo.addItem("as the program chooses", "")
    for word in words:
        combo.addItem(word, word)
    return combo
