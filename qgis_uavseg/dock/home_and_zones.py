"""Home and keep-out zones, drawn on the map."""

from __future__ import annotations

from pathlib import Path

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsCsException,
    QgsFeature,
    QgsFillSymbol,
    QgsGeometry,
    QgsPointXY,
    QgsProcessingContext,
    QgsProject,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)
from qgis.gui import QgsMapCanvas, QgsVertexMarker
from qgis.PyQt.QtCore import QObject, pyqtSignal
from qgis.PyQt.QtGui import QColor

from ..targets import polygon_file

WGS84 = "EPSG:4326"
ZONES = "Keep-out zones"
_ZONE = {"color": "227,26,28,60", "outline_color": "#e31a1c", "outline_width": "0.6"}


class PlaceError(Exception):
    """A place has no longitude and latitude; the text says why."""


class HomeAndZones(QObject):
    """Home as a marker, keep-out zones as a layer of the project, which its tools can edit.

    Signals
    -------
    changed
    """

    changed = pyqtSignal()

    def __init__(self, canvas: QgsMapCanvas, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._canvas = canvas
        self.home: QgsPointXY | None = None
        """Longitude and latitude on WGS 84."""
        self._marker: QgsVertexMarker | None = None
        self._layer_id = ""
        canvas.destinationCrsChanged.connect(self._place_marker)
        QgsProject.instance().layerRemoved.connect(self._removed)
        QgsProject.instance().cleared.connect(self._forget_home)

    def set_home(self, place: QgsPointXY | None) -> None:
        """Set home, in the CRS of the map; None leaves it to the program.

        Raises
        ------
        PlaceError
            If the place has no longitude and latitude.
        """
        wgs84 = QgsCoordinateReferenceSystem(WGS84)
        self.home = None if place is None else _transform(self._crs(), wgs84, place)
        self._place_marker()
        self.changed.emit()

    def add_zone(self, outline: QgsGeometry) -> None:
        """Add a keep-out zone, in the CRS of the map.

        Raises
        ------
        PlaceError
            If it has no longitude and latitude.
        """
        shape = QgsGeometry(outline).makeValid()  # a crossed outline keeps all of its parts
        to_wgs84 = QgsCoordinateTransform(
            self._crs(), QgsCoordinateReferenceSystem(WGS84), QgsProject.instance()
        )
        try:
            shape.transform(to_wgs84)
        except QgsCsException as error:
            raise PlaceError(f"that zone has no longitude and latitude: {error}") from error
        layer = self.layer() or self._new_layer()
        for part in shape.asGeometryCollection():
            if part.area() > 0:
                feature = QgsFeature(layer.fields())
                feature.setGeometry(part)
                layer.dataProvider().addFeatures([feature])
        layer.updateExtents()
        layer.triggerRepaint()
        self.changed.emit()

    def clear_zones(self) -> None:
        """Remove all keep-out zones."""
        if self.layer() is not None:
            QgsProject.instance().removeMapLayer(self._layer_id)

    def layer(self) -> QgsVectorLayer | None:
        """The layer of keep-out zones, if there is one."""
        found = QgsProject.instance().mapLayer(self._layer_id) if self._layer_id else None
        return found if isinstance(found, QgsVectorLayer) else None

    def count_zones(self) -> int:
        """How many keep-out zones there are."""
        layer = self.layer()
        return 0 if layer is None else int(layer.featureCount())

    def zone_file(self) -> Path | None:
        """The keep-out zones in a temporary file; None if there are none.

        Raises
        ------
        QgsProcessingException
            If the layer has edits that are not saved.
        """
        layer = self.layer()
        if layer is None or not layer.featureCount():
            return None
        context = QgsProcessingContext()
        context.setProject(QgsProject.instance())
        return Path(polygon_file(layer, ZONES, context))

    def clean_up(self) -> None:
        """Remove the marker; the layer stays in the project."""
        self._canvas.destinationCrsChanged.disconnect(self._place_marker)
        QgsProject.instance().layerRemoved.disconnect(self._removed)
        QgsProject.instance().cleared.disconnect(self._forget_home)
        self.home = None
        self._place_marker()

    def _crs(self) -> QgsCoordinateReferenceSystem:
        crs = self._canvas.mapSettings().destinationCrs()
        if not crs.isValid():
            raise PlaceError(
                "the project has no CRS, so that places on the map have no longitude and latitude"
            )
        return crs

    def _new_layer(self) -> QgsVectorLayer:
        layer = QgsVectorLayer(f"Polygon?crs={WGS84}", ZONES, "memory")
        layer.setRenderer(QgsSingleSymbolRenderer(QgsFillSymbol.createSimple(_ZONE)))
        QgsProject.instance().addMapLayer(layer)
        for signal in (layer.committedFeaturesAdded, layer.committedFeaturesRemoved):
            signal.connect(lambda *_: self.changed.emit())
        layer.committedGeometriesChanges.connect(lambda *_: self.changed.emit())
        self._layer_id = layer.id()
        return layer

    def _removed(self, layer_id: str) -> None:
        if layer_id == self._layer_id:
            self._layer_id = ""
            self.changed.emit()

    def _forget_home(self) -> None:
        """Another project has another home."""
        self.set_home(None)

    def _place_marker(self) -> None:
        if self._marker is not None:
            self._canvas.scene().removeItem(self._marker)
            self._marker = None
        if self.home is None:
            return
        crs = self._canvas.mapSettings().destinationCrs()
        try:
            center = _transform(QgsCoordinateReferenceSystem(WGS84), crs, self.home)
        except PlaceError:
            return  # home is not on this map; its coordinates are shown in the dock
        self._marker = QgsVertexMarker(self._canvas)
        self._marker.setIconType(QgsVertexMarker.ICON_DOUBLE_TRIANGLE)
        self._marker.setColor(QColor("#1a7f37"))
        self._marker.setFillColor(QColor("#ffffff"))
        self._marker.setIconSize(16)
        self._marker.setPenWidth(3)
        self._marker.setCenter(center)


def _transform(
    source: QgsCoordinateReferenceSystem, target: QgsCoordinateReferenceSystem, place: QgsPointXY
) -> QgsPointXY:
    try:
        return QgsCoordinateTransform(source, target, QgsProject.instance()).transform(place)
    except QgsCsException as error:
        raise PlaceError(f"that place cannot be transformed: {error}") from error
