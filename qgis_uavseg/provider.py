"""Processing provider "UAV Segmentation"."""

from __future__ import annotations

from pathlib import Path

from qgis.core import QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from .algorithms import ALGORITHMS
from .targets import VECTOR_EXTENSIONS

ICON = Path(__file__).resolve().parent / "icon.svg"


class UavsegProvider(QgsProcessingProvider):
    """All algorithms; they stay listed where the program is missing, and say what to type."""

    def id(self) -> str:
        return "uavseg"

    def name(self) -> str:
        return "UAV Segmentation"

    def longName(self) -> str:
        return "UAV Segmentation (uavseg)"

    def icon(self) -> QIcon:
        return QIcon(str(ICON))

    def svgIconPath(self) -> str:
        return str(ICON)

    def loadAlgorithms(self) -> None:
        for algorithm in ALGORITHMS:
            self.addAlgorithm(algorithm())

    def supportsNonFileBasedOutput(self) -> bool:
        return False

    def supportedOutputVectorLayerExtensions(self) -> list[str]:
        return list(VECTOR_EXTENSIONS)

    def defaultVectorFileExtension(self, hasGeometry: bool = True) -> str:
        return VECTOR_EXTENSIONS[0]

    def supportedOutputRasterLayerExtensions(self) -> list[str]:
        return ["tif"]
