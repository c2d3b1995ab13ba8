"""QGIS plugin of uavseg: Processing algorithms that run the program `uavseg` as a process of its own."""

from __future__ import annotations

from typing import Any


def classFactory(iface: Any) -> Any:
    """The plugin, as QGIS asks for it; `iface` is None under qgis_process."""
    from .plugin import UavsegPlugin

    return UavsegPlugin(iface)
