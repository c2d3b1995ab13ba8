"""Pictures of the QGIS plugin for `docs/how-to/qgis.md`, made in the desktop itself under a virtual screen.

``python docs/qgis_pictures.py -o docs/pictures --program PATH`` starts QGIS with a profile of its own under
`xvfb-run`; QGIS runs this file again, uses the plugin as a user would, and saves what is seen.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(os.environ.get("UAVSEG_PICTURES_ROOT") or Path(__file__).resolve().parents[1])
NAMES = ("qgis-slider", "qgis-mission", "qgis-dialog", "qgis-levels", "qgis-toolbox")
SIZE = (1180, 840)
INI = """[PythonPlugins]
qgis_uavseg=true
processing=true
[qgis]
checkVersion=false
showTips=false
newsFeed/http/feed/qgis/org/disabled=true
enableMacros=Never
[core]
NewsFeed\\httpfeedqgisorg\\disabled=true
[app]
projections\\unknownCrsBehavior=UseDefaultCrs
"""


def main() -> int:
    """Start QGIS; the number of pictures that are missing afterwards."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "pictures")
    parser.add_argument("--program", default=shutil.which("uavseg"), help="the program uavseg")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder, "profiles", "default", "QGIS")
        settings.mkdir(parents=True)
        (settings / "QGIS3.ini").write_text(INI, encoding="utf-8")
        rasters = Path(folder, "rasters")
        rasters.mkdir()
        for name in ("quarry.tif", "fields_rgb.tif"):
            shutil.copy(ROOT / "samples" / name, rasters)
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        environment |= {
            # QGIS takes the first python3 on the PATH for its own, which is the system's.
            "PATH": os.pathsep.join(["/usr/bin", "/bin", os.environ.get("PATH", "")]),
            "QGIS_PLUGINPATH": str(ROOT),
            "UAVSEG_PROGRAM": str(given.program),
            "UAVSEG_PICTURES": str(given.output.resolve()),
            "UAVSEG_PICTURES_ROOT": str(ROOT),
            "UAVSEG_PICTURES_RASTERS": str(rasters),
            "XDG_RUNTIME_DIR": folder,
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        screen = ["xvfb-run", "-a", "-s", f"-screen 0 {SIZE[0]}x{SIZE[1]}x24"]
        qgis = ["qgis", "--nologo", "--noversioncheck", "--profiles-path", folder, "--code", __file__]
        done = subprocess.run(
            [*screen, *qgis], env=environment, timeout=500, check=False, capture_output=True
        )
    missing = [name for name in NAMES if not (given.output / f"{name}.jpg").is_file()]
    if missing:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        print(f"not made: {', '.join(missing)}; QGIS said:", *said[-15:], sep="\n", file=sys.stderr)
    return len(missing)


class Desktop:
    """The running desktop: its windows, and time to work."""

    def __init__(self, output: Path) -> None:
        from qgis.utils import iface, plugins

        self.iface, self.output = iface, output
        self.plugin = plugins["qgis_uavseg"]
        self.dock = self.plugin.dock
        window = iface.mainWindow()
        window.showNormal()
        window.setGeometry(0, 0, *SIZE)

    def wait(self, done: Callable[[], bool], seconds: float = 90) -> None:
        """Let QGIS work until something is so."""
        from qgis.PyQt.QtWidgets import QApplication

        end = time.monotonic() + seconds
        while not done():
            QApplication.processEvents()
            time.sleep(0.01)
            if time.monotonic() > end:
                raise TimeoutError(f"it did not happen within {seconds} s")

    def pause(self, seconds: float = 1.0) -> None:
        """Let QGIS draw."""
        end = time.monotonic() + seconds
        self.wait(lambda: time.monotonic() > end and not self.iface.mapCanvas().isDrawing())

    def save(self, widget: Any, name: str) -> None:
        """Save what a window shows."""
        self.pause()
        widget.grab().save(str(self.output / f"{name}.jpg"), "JPG", 75)

    def raster(self, name: str) -> Any:
        """Add a raster, and show all of it."""
        from qgis.core import QgsProject, QgsRasterLayer

        path = Path(os.environ["UAVSEG_PICTURES_RASTERS"], name)
        layer = QgsRasterLayer(str(path), path.stem, "gdal")
        QgsProject.instance().addMapLayer(layer)
        QgsProject.instance().setCrs(layer.crs())
        self.show(layer)
        return layer

    def show(self, layer: Any) -> None:
        """Show all of a layer."""
        canvas = self.iface.mapCanvas()
        canvas.setExtent(layer.extent())
        canvas.zoomByFactor(1.05)
        canvas.refresh()


def slider(desktop: Desktop) -> None:
    """The dock while the range is dragged: cells answer."""
    from qgis.PyQt.QtCore import Qt
    from qgis.PyQt.QtWidgets import QDockWidget

    window, dock = desktop.iface.mainWindow(), desktop.dock
    for other in window.findChildren(QDockWidget):
        if other is not dock and other.objectName() not in ("Layers",):
            other.hide()
    dock.show()
    window.resizeDocks([dock], [400], Qt.Orientation.Horizontal)
    layer = desktop.raster("quarry.tif")
    dock.range.rasters.setLayer(layer)
    desktop.wait(lambda: dock.range.finder.means is not None)
    desktop.pause()
    desktop.show(layer)
    dock.range.slider.set_range(0.55, 1.0)
    dock.range.slider.moved.emit(0.55, 1.0)
    desktop.save(window, "qgis-slider")


def mission(desktop: Desktop) -> None:
    """Regions, ticks, home, a keep-out zone, legs, footprints and estimates."""
    from qgis.core import QgsGeometry, QgsPointXY, QgsRectangle

    dock = desktop.dock
    dock.range.slider.released.emit(0.55, 1.0)
    desktop.wait(lambda: dock.layer() is not None)
    dock.ticks.tick([3], False)
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    dock.mission.gsd.setValue(1.5)
    dock.mission.places.set_home(QgsPointXY(512352, 5478352))
    zone = QgsGeometry.fromRect(QgsRectangle(512470, 5478440, 512500, 5478470))
    dock.mission.places.add_zone(zone)
    dock.mission.preview_button.click()
    desktop.wait(lambda: dock.mission.save_button.isEnabled())
    desktop.pause(0.5)
    area = dock.widget()
    area.verticalScrollBar().setValue(area.verticalScrollBar().maximum())
    desktop.save(desktop.iface.mainWindow(), "qgis-mission")


def dialog(desktop: Desktop) -> None:
    """The dialog of Extract regions."""
    import processing

    given = {"INPUT": desktop.dock.range.rasters.currentLayer().id()}
    shown = processing.createAlgorithmDialog("uavseg:extract", given)
    shown.resize(900, 620)
    shown.show()
    desktop.save(shown, "qgis-dialog")
    shown.close()


def levels(desktop: Desktop) -> None:
    """A result with its style."""
    import processing
    from qgis.core import QgsProject

    desktop.dock.hide()
    QgsProject.instance().clear()
    layer = desktop.raster("quarry.tif")
    target = str(Path(os.environ["UAVSEG_PICTURES_RASTERS"], "levels.gpkg"))
    words = {"INPUT": layer.id(), "WIDTH": 0.2, "MIN_AREA": "50", "OUTPUT": target}
    processing.runAndLoadResults("uavseg:levels", words)
    desktop.show(layer)
    desktop.pause()
    desktop.show(layer)
    desktop.save(desktop.iface.mainWindow(), "qgis-levels")


def toolbox(desktop: Desktop) -> None:
    """The algorithms in the toolbox."""
    from qgis.PyQt.QtWidgets import QDockWidget, QTreeView

    shown = desktop.iface.mainWindow().findChild(QDockWidget, "ProcessingToolbox")
    shown.show()
    shown.setFloating(True)
    shown.resize(340, 420)
    tree = shown.findChild(QTreeView)
    model = tree.model()
    tree.collapseAll()
    for row in range(model.rowCount()):
        index = model.index(row, 0)
        if index.data() == "UAV Segmentation":
            tree.expandRecursively(index)
            tree.scrollTo(index, QTreeView.ScrollHint.PositionAtTop)
    desktop.save(shown, "qgis-toolbox")
    shown.setFloating(False)
    shown.hide()


def inside() -> None:
    """Make all pictures, and end QGIS."""
    from qgis.core import QgsProject

    try:
        desktop = Desktop(Path(os.environ["UAVSEG_PICTURES"]))
        for make in (slider, mission, dialog, levels, toolbox):
            make(desktop)
    except Exception:
        traceback.print_exc()  # QGIS would show it in a window, which is not seen here
    finally:
        QgsProject.instance().setDirty(False)
        sys.stderr.flush()
        os._exit(0)  # without the question whether the project is to be saved


if "UAVSEG_PICTURES" in os.environ:
    from qgis.PyQt.QtCore import QTimer

    QTimer.singleShot(3000, inside)
elif __name__ == "__main__":
    sys.exit(main())
