"""Files that algorithms read and write; what is not a file is refused with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsProcessingException,
    QgsProcessingUtils,
    QgsProviderRegistry,
    QgsRasterLayer,
    QgsVectorFileWriter,
    QgsVectorLayer,
)

VECTOR_EXTENSIONS: tuple[str, ...] = ("gpkg", "geojson", "fgb", "shp")


def checked_target(target: str, extensions: Sequence[str], label: str) -> str:
    """The file that an output is written to.

    Raises
    ------
    QgsProcessingException
        If it is not a file (`memory:`, `postgres:`, `ogr:dbname=...`), or of another format.
    """
    formats = ", ".join("." + extension for extension in extensions)
    suffix = Path(target).suffix.lower().lstrip(".")
    if not Path(target).is_absolute():
        raise QgsProcessingException(
            f"{label}: {target!r} is not a path of a file; uavseg writes files: give a path that ends in "
            f"{formats}"
        )
    if suffix not in extensions:
        raise QgsProcessingException(f"{label}: {target!r} ends in none of {formats}, which uavseg writes")
    return target


def raster_file(layer: QgsRasterLayer, label: str, feedback: Any) -> str:
    """The file of a raster layer. What QGIS was set to show otherwise than the file has it is a warning.

    Raises
    ------
    QgsProcessingException
        If the layer is not one raster in a file.
    """
    parts = QgsProviderRegistry.instance().decodeUri("gdal", layer.source())
    path = str(parts.get("path") or "")
    if layer.providerType() != "gdal" or not Path(path).is_file() or parts.get("layerName"):
        raise QgsProcessingException(
            f"{label}: the layer {layer.name()!r} is not a raster file on this computer; "
            "save it as a GeoTIFF (Export > Save As) and choose that"
        )
    in_file = QgsRasterLayer(path, "file", "gdal")
    if in_file.isValid() and in_file.crs() != layer.crs():
        feedback.pushWarning(
            f"the project gives the layer {layer.name()!r} the CRS {_name(layer.crs())}, its file has "
            f"{_name(in_file.crs())}; uavseg reads the file. Assign the CRS to the file (Assign "
            f"projection) first"
        )
    if any(layer.dataProvider().userNoDataValues(band + 1) for band in range(layer.bandCount())):
        feedback.pushWarning(
            f"the layer {layer.name()!r} has additional nodata values in its properties; uavseg reads "
            f"the file, "
            "which does not hold them: give one in Nodata value"
        )
    return path


def polygon_file(layer: QgsVectorLayer, label: str, context: Any) -> str:
    """The file of a layer of polygons; a layer that is no whole file is written to a temporary one.

    Raises
    ------
    QgsProcessingException
        If it has edits that are not saved, or cannot be written.
    """
    refuse_unsaved(layer, label)
    path = str(QgsProviderRegistry.instance().decodeUri("ogr", layer.source()).get("path") or "")
    whole = layer.providerType() == "ogr" and not layer.subsetString() and Path(path).is_file()
    if whole and layer.dataProvider().subLayerCount() == 1:
        return path
    target = QgsProcessingUtils.generateTempFilename("polygons.gpkg")
    write_layer(layer, target, context)
    return target


def refuse_unsaved(layer: QgsVectorLayer, label: str) -> None:
    """Refuse a layer with edits that are not saved, which its file does not have.

    Raises
    ------
    QgsProcessingException
    """
    if layer.isEditable() and layer.isModified():
        raise QgsProcessingException(
            f"{label}: the layer {layer.name()!r} has unsaved edits; save them first"
        )


def write_layer(layer: QgsVectorLayer, target: str, context: Any) -> None:
    """Write a layer to a file, in its own CRS.

    Raises
    ------
    QgsProcessingException
        If it cannot be written.
    """
    options = QgsVectorFileWriter.SaveVectorOptions()
    options.driverName = QgsVectorFileWriter.driverForExtension(Path(target).suffix)
    options.layerName = Path(target).stem
    written = QgsVectorFileWriter.writeAsVectorFormatV2(layer, target, context.transformContext(), options)
    if written[0] != QgsVectorFileWriter.WriterError.NoError:
        raise QgsProcessingException(f"{target} cannot be written: {written[1]}")


def _name(crs: QgsCoordinateReferenceSystem) -> str:
    return crs.authid() or (crs.description() if crs.isValid() else "none")
