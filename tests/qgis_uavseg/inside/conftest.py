"""QGIS with a canvas, the provider, and the dock over a copy of a sample."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

SAMPLES = Path(__file__).resolve().parents[3] / "samples"


def wait_until(done: Callable[[], bool], seconds: float = 60) -> None:
    """Let QGIS work until something is so."""
    from qgis.PyQt.QtCore import QCoreApplication, QEventLoop

    end = time.monotonic() + seconds
    while not done():
        QCoreApplication.processEvents(QEventLoop.AllEvents, 50)
        QCoreApplication.sendPostedEvents()
        assert time.monotonic() < end, f"it did not happen within {seconds} s"
        time.sleep(0.005)


def photograph(regions: Path, mission: Path, folder: Path) -> None:
    """Plan a survey over regions, and write its photographs but for some in the middle."""
    program = Path(os.environ["UAVSEG_PROGRAM"])
    words = ["--altitude", "60", "--home", "auto", "--camera", "DJI Mavic 3 Enterprise", "-o", mission]
    subprocess.run([program, "plan", regions, *words], check=True, capture_output=True)
    make = [program.with_name("python"), "-m", "tests.photographs.flown", mission, folder]
    subprocess.run([*make, "--without", "20,21,22,23,24,25,26,27"], check=True, cwd=SAMPLES.parent)


def show_map(canvas: Any, layer: Any) -> None:
    """Show all of a layer on a canvas of 600 x 500 pixels, in its CRS."""
    canvas.window().show()
    canvas.setDestinationCrs(layer.crs())
    canvas.setFixedSize(600, 500)
    wait_until(lambda: canvas.mapSettings().outputSize() == canvas.viewport().size())
    canvas.setExtent(layer.extent())


@pytest.fixture
def program() -> str:
    """The program; skipped without."""
    if not os.environ.get("UAVSEG_PROGRAM"):
        pytest.skip("UAVSEG_PROGRAM names no program")
    return os.environ["UAVSEG_PROGRAM"]


@pytest.fixture
def quarry(tmp_path: Path) -> Path:
    """A copy of a sample."""
    folder = tmp_path / "rasters"
    folder.mkdir()
    return Path(shutil.copy(SAMPLES / "quarry.tif", folder))


@pytest.fixture
def dock(qgis_iface: Any, qgis_new_project: None, program: str) -> Any:
    """The dock, on a canvas that shows nothing yet."""
    from qgis_uavseg.dock.regions_dock import RegionsDock

    made = RegionsDock(qgis_iface)
    made.show()
    yield made
    made.clean_up()
    made.deleteLater()


@pytest.fixture
def quarry_dock(dock: Any, quarry: Path) -> Any:
    """The dock with the block map of a raster ready."""
    from qgis.core import QgsProject, QgsRasterLayer

    layer = QgsRasterLayer(str(quarry), "quarry", "gdal")
    QgsProject.instance().addMapLayer(layer)
    show_map(dock._canvas, layer)
    dock.range.rasters.setLayer(layer)
    wait_until(lambda: dock.range.finder.means is not None)
    return dock


@pytest.fixture
def processing(
    qgis_iface: Any, qgis_processing: None, qgis_new_project: None, monkeypatch: pytest.MonkeyPatch
) -> Any:
    """Processing with the provider, and a desktop that dialogs can ask for its browser."""
    import processing
    from qgis.core import QgsApplication
    from qgis.gui import QgsBrowserGuiModel
    from qgis.utils import iface

    from qgis_uavseg.provider import UavsegProvider

    browser = QgsBrowserGuiModel()
    monkeypatch.setattr(iface, "browserModel", lambda: browser, raising=False)
    provider = UavsegProvider()
    QgsApplication.processingRegistry().addProvider(provider)
    yield processing
    QgsApplication.processingRegistry().removeProvider(provider)
