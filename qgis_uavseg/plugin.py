"""The plugin: its provider of Processing algorithms, under QGIS and under qgis_process."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from qgis.core import Qgis, QgsApplication

from .provider import UavsegProvider

MENU = "UAV Segmentation"


class UavsegPlugin:
    """What QGIS loads and unloads.

    Parameters
    ----------
    iface : QgisInterface, optional
        None under qgis_process, which calls `initProcessing` alone.
    """

    def __init__(self, iface: Any) -> None:
        self.iface = iface
        self.provider: UavsegProvider | None = None
        self._factory: Any = None
        self._actions: list[Any] = []
        self.dock: Any = None

    def initProcessing(self) -> None:
        """Add the algorithms."""
        self.provider = UavsegProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        """Add the algorithms and what the desktop shows."""
        from qgis.PyQt.QtGui import QIcon

        try:
            from qgis.PyQt.QtGui import QAction
        except ImportError:  # of Qt 5
            from qgis.PyQt.QtWidgets import QAction

        from .options_page import OptionsFactory
        from .provider import ICON

        self.initProcessing()
        self._factory = OptionsFactory()
        self.iface.registerOptionsWidgetFactory(self._factory)
        install = QAction(QIcon(str(ICON)), "Install or choose the program...", self.iface.mainWindow())
        install.triggered.connect(self.show_options)
        self._actions = [install]
        if find_spec("numpy"):
            self._add_dock(QIcon(str(ICON)))
        else:
            said = "the dock Regions needs numpy, which the Python of QGIS does not have; algorithms work"
            QgsApplication.messageLog().logMessage(said, MENU, Qgis.MessageLevel.Warning)
        for action in self._actions:
            self.iface.addPluginToMenu(MENU, action)

    def _add_dock(self, icon: Any) -> None:
        from qgis.PyQt.QtCore import Qt

        from .dock.regions_dock import RegionsDock

        self.dock = RegionsDock(self.iface)
        self.iface.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self.dock)
        self.dock.hide()  # until the user opens it; QGIS opens it again where it was open
        show = self.dock.toggleViewAction()
        show.setIcon(icon)
        self._actions.insert(0, show)
        self.iface.addToolBarIcon(show)

    def show_options(self) -> None:
        """Show the page of the program, also where Options cannot be opened at it."""
        from qgis.PyQt.QtWidgets import QDialog, QVBoxLayout

        from .options_page import ProgramPanel

        dialog = QDialog(self.iface.mainWindow())
        dialog.setWindowTitle(MENU)
        dialog.resize(720, 360)
        QVBoxLayout(dialog).addWidget(ProgramPanel(dialog))
        dialog.show()

    def unload(self) -> None:
        """Remove all of it."""
        if self.provider is not None:
            QgsApplication.processingRegistry().removeProvider(self.provider)
            self.provider = None
        if self._factory is None:
            return
        if self.dock is not None:
            self.iface.removeToolBarIcon(self._actions[0])
            self.dock.clean_up()
        for action in self._actions:
            self.iface.removePluginMenu(MENU, action)
        self.iface.unregisterOptionsWidgetFactory(self._factory)
        if self.dock is not None:
            self.iface.removeDockWidget(self.dock)
            self.dock.deleteLater()
        self.dock = self._factory = None
        self._actions = []
