"""Styles of results: regions by class, level or mean; missions with arrows and order; states of a map.

QGIS keeps no reference to a post-processor of Python, and deletes it after it was used: each run has its own,
made before it starts and kept here. They hold no state: what a layer is follows from its fields.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

from qgis.core import (
    QgsCategorizedSymbolRenderer,
    QgsClassificationEqualInterval,
    QgsCoordinateReferenceSystem,
    QgsFillSymbol,
    QgsGradientColorRamp,
    QgsGradientStop,
    QgsGraduatedSymbolRenderer,
    QgsLineSymbol,
    QgsMarkerLineSymbolLayer,
    QgsMarkerSymbol,
    QgsPalettedRasterRenderer,
    QgsPalLayerSettings,
    QgsProcessingLayerPostProcessorInterface,
    QgsRendererCategory,
    QgsSingleSymbolRenderer,
    QgsTextBufferSettings,
    QgsTextFormat,
    QgsVectorLayer,
    QgsVectorLayerSimpleLabeling,
)
from qgis.PyQt.QtGui import QColor

PALETTE = ("#1f78b4", "#e6ab02", "#33a02c", "#e31a1c", "#6a3d9a", "#b15928", "#a6761d", "#666666")
ONE_COLOR = "#ffa500"
LEG_COLOR = "#d7191c"
STATES = (
    (0, "nodata", "#00000000"),
    (1, "free", "#ffffffff"),
    (2, "unknown", "#ff9e9e9e"),
    (3, "occupied", "#ff000000"),
)
_FILL_ALPHA = 90  # of 255
_CLASSES_OF_MEAN = 5


class _RegionStyle(QgsProcessingLayerPostProcessorInterface):
    """Regions by class, by level, by mean, or in one colour."""

    def postProcessLayer(self, layer: Any, context: Any, feedback: Any) -> None:
        if not isinstance(layer, QgsVectorLayer):
            return
        _drop_undefined_crs(layer)
        layer.setRenderer(region_renderer(layer))
        layer.triggerRepaint()


class _LegStyle(QgsProcessingLayerPostProcessorInterface):
    """Legs of a mission with arrows along them and their numbers."""

    def postProcessLayer(self, layer: Any, context: Any, feedback: Any) -> None:
        if not isinstance(layer, QgsVectorLayer):
            return
        _drop_undefined_crs(layer)
        layer.setRenderer(QgsSingleSymbolRenderer(arrow_symbol()))
        if layer.fields().indexOf("leg") >= 0:
            layer.setLabeling(QgsVectorLayerSimpleLabeling(_leg_labels()))
            layer.setLabelsEnabled(True)
        layer.triggerRepaint()


class _StateStyle(QgsProcessingLayerPostProcessorInterface):
    """States of an occupancy map: free white, unknown grey, occupied black."""

    def postProcessLayer(self, layer: Any, context: Any, feedback: Any) -> None:
        classes = [QgsPalettedRasterRenderer.Class(v, QColor(color), name) for v, name, color in STATES]
        layer.setRenderer(QgsPalettedRasterRenderer(layer.dataProvider(), 1, classes))
        layer.triggerRepaint()


class Styles(NamedTuple):
    """Post-processors of one run; QGIS deletes each after it was used."""

    regions: QgsProcessingLayerPostProcessorInterface
    legs: QgsProcessingLayerPostProcessorInterface
    states: QgsProcessingLayerPostProcessorInterface


_kept: deque[Styles] = deque(maxlen=200)  # longer than a batch of tasks waits for its layers


def fresh_styles() -> Styles:
    """New post-processors, to be made in the main thread; a reference is kept here."""
    _kept.append(Styles(_RegionStyle(), _LegStyle(), _StateStyle()))
    return _kept[-1]


def style_on_load(target: str, style: QgsProcessingLayerPostProcessorInterface, context: Any) -> None:
    """Style a result when it is loaded into the project, if it will be."""
    if target and context.willLoadLayerOnCompletion(target):
        context.layerToLoadOnCompletionDetails(target).setPostProcessor(style)


def _drop_undefined_crs(layer: QgsVectorLayer) -> None:
    """Show local coordinates as they are: from the "undefined" of a GeoPackage there is no transformation."""
    crs = layer.crs()
    if not crs.authid() and "undefined" in crs.description().lower() + crs.toWkt().lower():
        layer.setCrs(QgsCoordinateReferenceSystem())


def region_renderer(layer: QgsVectorLayer) -> Any:
    """The renderer of a layer of regions, by what fields it has."""
    for field in ("class", "level"):
        if layer.fields().indexOf(field) >= 0:
            return _by_category(layer, field)
    values = _unique(layer, "mean")
    if len(values) < 2:
        return QgsSingleSymbolRenderer(_fill(ONE_COLOR))
    renderer = QgsGraduatedSymbolRenderer("mean")
    renderer.setSourceSymbol(_fill(ONE_COLOR))
    renderer.setSourceColorRamp(_ramp())
    renderer.setClassificationMethod(QgsClassificationEqualInterval())
    renderer.updateClasses(layer, min(_CLASSES_OF_MEAN, len(values)))
    _translucent(renderer)
    return renderer


def arrow_symbol(color: str = LEG_COLOR) -> QgsLineSymbol:
    """A line with an arrow in its middle, in its direction."""
    symbol = QgsLineSymbol.createSimple({"color": color, "width": "0.6"})
    arrow = QgsMarkerSymbol.createSimple(
        {"name": "filled_arrowhead", "color": color, "outline_color": color, "size": "3.2"}
    )
    markers = QgsMarkerLineSymbolLayer()
    markers.setPlacement(QgsMarkerLineSymbolLayer.CentralPoint)
    markers.setSubSymbol(arrow)
    symbol.appendSymbolLayer(markers)
    return symbol


def _by_category(layer: QgsVectorLayer, field: str) -> QgsCategorizedSymbolRenderer:
    values = _unique(layer, field)
    given = _given_colors(layer) if field == "class" else {}
    categories = []
    for k, value in enumerate(values):
        if field == "level":
            color = _ramp().color(k / max(len(values) - 1, 1)).name()
        else:
            color = given.get(value) or PALETTE[k % len(PALETTE)]
        categories.append(QgsRendererCategory(value, _fill(color), str(value)))
    return QgsCategorizedSymbolRenderer(field, categories)


def _given_colors(layer: QgsVectorLayer) -> dict:
    """Colours of classes that the file of classes gave."""
    if layer.fields().indexOf("color") < 0:
        return {}
    pairs = ((feature["class"], feature["color"]) for feature in layer.getFeatures())
    return {name: str(color) for name, color in pairs if QColor(str(color)).isValid()}


def _unique(layer: QgsVectorLayer, field: str) -> list[Any]:
    index = layer.fields().indexOf(field)
    return sorted(value for value in layer.uniqueValues(index) if value is not None) if index >= 0 else []


def _fill(color: str) -> QgsFillSymbol:
    inside = QColor(color)
    rgba = f"{inside.red()},{inside.green()},{inside.blue()},{_FILL_ALPHA}"
    return QgsFillSymbol.createSimple({"color": rgba, "outline_color": inside.name(), "outline_width": "0.5"})


def _translucent(renderer: QgsGraduatedSymbolRenderer) -> None:
    """Give each class the fill and outline of its colour; the ramp sets opaque fills."""
    for k, part in enumerate(renderer.ranges()):
        renderer.updateRangeSymbol(k, _fill(part.symbol().color().name()))


def _ramp() -> QgsGradientColorRamp:
    """Viridis by three of its colours."""
    middle = [QgsGradientStop(0.5, QColor("#21918c"))]
    return QgsGradientColorRamp(QColor("#440154"), QColor("#fde725"), False, middle)


def _leg_labels() -> QgsPalLayerSettings:
    text, halo = QgsTextFormat(), QgsTextBufferSettings()
    halo.setEnabled(True)
    halo.setSize(0.8)
    text.setSize(8)
    text.setBuffer(halo)
    settings = QgsPalLayerSettings()
    settings.fieldName = "leg"
    settings.placement = QgsPalLayerSettings.Line
    settings.setFormat(text)
    return settings
