"""Places that are chosen on the canvas, as parameters and as words."""

from __future__ import annotations

from typing import Callable

from qgis.core import QgsCoordinateReferenceSystem, QgsProcessingException, QgsProcessingParameterPoint

from .options import Option, Values


def place(
    name: str, label: str, help: str, optional: bool, words: Callable[[Values], list[str]], flag: str
) -> Option:
    """A place that can be chosen on the canvas, and the flag of its words."""
    return Option(
        lambda: QgsProcessingParameterPoint(name, label, None, optional), words, help, False, {flag: ""}
    )


def latlon(values: Values, name: str) -> str:
    """A place as `LAT,LON` on WGS 84, with 9 decimals (0.1 mm).

    Raises
    ------
    QgsProcessingException
        If its CRS is not known, so that it cannot be transformed.
    """
    crs = values.algorithm.parameterAsPointCrs(values.parameters, name, values.context)
    if not crs.isValid():
        raise QgsProcessingException(
            f"{values.label(name)}: the CRS of {values.text(name)!r} is not known; "
            "write it behind, such as '-122.8272,49.4583 [EPSG:4326]'"
        )
    wgs84 = QgsCoordinateReferenceSystem("EPSG:4326")
    point = values.algorithm.parameterAsPoint(values.parameters, name, values.context, wgs84)
    return f"{round(point.y(), 9)!r},{round(point.x(), 9)!r}"
