"""How long the dock of the QGIS plugin takes from the hand to the picture.

Run with the Python of QGIS: ``PYTHONPATH=. QT_QPA_PLATFORM=offscreen python3 benchmarks/qgis_slider.py``.
The block map is that of a raster of 16384 x 16384 pixels by default: 2048 x 2048 cells, coarse and fine
patterns mixed. A handle is dragged; the time is from the event of the mouse until the slider, the map and the
cells above it are painted.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from osgeo import gdal, osr
from qgis.core import QgsApplication, QgsCoordinateReferenceSystem, QgsCoordinateTransform, QgsProject
from qgis.gui import QgsMapCanvas
from qgis.PyQt.QtCore import QEvent, QPointF, Qt
from qgis.PyQt.QtGui import QMouseEvent

from qgis_uavseg.dock.block_means import BlockMeans
from qgis_uavseg.dock.range_panel import RangePanel

DRAGS = 40


def write_means(path: Path, side: int) -> None:
    """Bands as in a block map."""
    rng = np.random.default_rng(1)
    coarse = np.kron(rng.random((side // 8, side // 8)), np.ones((8, 8)))
    means = 0.7 * coarse + 0.3 * rng.random((side, side))
    file = gdal.GetDriverByName("GTiff").Create(str(path), side, side, 2, gdal.GDT_Float32, ["TILED=YES"])
    crs = osr.SpatialReference()
    crs.ImportFromEPSG(32610)
    file.SetProjection(crs.ExportToWkt())
    file.SetGeoTransform((500000, 0.4, 0, 5478620, 0, -0.4))
    for band, values in ((1, means), (2, 8 + 8 * rng.integers(0, 2, means.shape))):
        file.GetRasterBand(band).WriteArray(values.astype(np.float32))


def drag(application: QgsApplication, panel: RangePanel) -> tuple[list[float], float]:
    """Milliseconds of each step, and of the processor for all."""
    slider = panel.slider
    slider.set_range(0.3, 0.7)
    spent, began = [], time.process_time()
    for k in range(DRAGS + 1):
        kind = QEvent.Type.MouseMove if k else QEvent.Type.MouseButtonPress
        place = QPointF(slider.x_of(0.3) + k, 20)
        left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
        start = time.perf_counter()
        event = QMouseEvent(kind, place, left, left, none)
        slider.mouseMoveEvent(event) if k else slider.mousePressEvent(event)
        application.processEvents()  # paints
        spent.append(1e3 * (time.perf_counter() - start))
    return spent[1:], 1e3 * (time.process_time() - began)


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=16384, help="of the raster, in pixels")
    parser.add_argument("--canvas", type=int, nargs=2, default=(1600, 1000))
    given = parser.parse_args()
    application = QgsApplication([], True)
    application.initQgis()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "blocks.tif")
        write_means(path, given.side // 8)
        means = BlockMeans(path)
    canvas = QgsMapCanvas()
    canvas.resize(*given.canvas)
    canvas.show()
    panel = RangePanel(canvas)
    panel.resize(400, 500)
    panel.show()
    panel.finder.means = means
    panel.finder.means_ready.emit(means)
    utm, globe = means.crs, QgsCoordinateReferenceSystem("EPSG:4326")
    to_globe = QgsCoordinateTransform(utm, globe, QgsProject.instance())
    half = means.extent.width() / 4
    print(f"raster {given.side} x {given.side}, canvas {given.canvas[0]} x {given.canvas[1]}, {DRAGS} steps")
    print("map             median ms   most ms   processor ms")
    for name, extent, crs in (
        ("all of it", means.extent, utm),
        ("a quarter", means.extent.buffered(-half), utm),
        ("another CRS", to_globe.transformBoundingBox(means.extent), globe),
    ):
        canvas.setDestinationCrs(crs)
        canvas.setExtent(extent)
        application.processEvents()
        spent, processor = drag(application, panel)
        print(f"{name:14}{np.median(spent):11.1f}{max(spent):10.1f}{processor / len(spent):15.1f}")
    panel.clean_up()


if __name__ == "__main__":
    main()
