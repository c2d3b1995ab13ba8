"""The plugin: its provider of Processing algorithms, under QGIS and under qgis_process."""

from __future__ import annotations

from typing import Any

from qgis.core import QgsApplication

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
        self._action: Any = None

    def initProcessing(self) -> None:
        """Add the algorithms."""
        self.provider = UavsegProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        """Add the algorithms and what the desktop shows."""
        from qgis.PyQt.QtGui import QIcon
        from qgis.PyQt.QtWidgets import QAction

        from .options_page import OptionsFactory
        from .provider import ICON

        self.initProcessing()
        self._factory = OptionsFactory()
        self.iface.registerOptionsWidgetFactory(self._factory)
        self._action = QAction(QIcon(str(ICON)), "Install or choose the program...", self.iface.mainWindow())
        self._action.triggered.connect(self.show_options)
        self.iface.addPluginToMenu(MENU, self._action)

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
        if self.iface is not None and self._action is not None:
            self.iface.removePluginMenu(MENU, self._action)
            self.iface.unregisterOptionsWidgetFactory(self._factory)
            self._action = self._factory = None
