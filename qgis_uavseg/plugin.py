"""The plugin: its provider of Processing algorithms, under QGIS and under qgis_process."""

from __future__ import annotations

from typing import Any

from qgis.core import QgsApplication

from .provider import UavsegProvider


class UavsegPlugin:
    """What QGIS loads and unloads.

    Parameters
    ----------
    iface : QgisInterface, optional
        None under qgis_process, which calls `initProcessing` alone.
    """

    def __init__(self, iface: Any | None) -> None:
        self.iface = iface
        self.provider: UavsegProvider | None = None

    def initProcessing(self) -> None:
        """Add the algorithms."""
        self.provider = UavsegProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        """Add the algorithms and what the desktop shows."""
        self.initProcessing()

    def unload(self) -> None:
        """Remove all of it."""
        if self.provider is not None:
            QgsApplication.processingRegistry().removeProvider(self.provider)
            self.provider = None
