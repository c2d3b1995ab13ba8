"""The dock reads a band, an index or a formula, as the command line does."""

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("qgis.core")
pytest.importorskip("pytest_qgis")

import numpy as np
from conftest import show_map, wait_until
from qgis.core import QgsPointXY, QgsProject, QgsRasterLayer, QgsVectorLayer
from qgis.PyQt.QtTest import QTest

from qgis_uavseg.dock.intensity import BAND, FORMULA, INDEX, Intensity

gdal = pytest.importorskip("osgeo.gdal")


def _write(path: Path, names: tuple[str, ...]) -> Path:
    """A raster of three bands, with names or without: a bright field of nir in a corner."""
    rng = np.random.default_rng(7)
    rows, cols = np.indices((200, 240))
    inside = (rows < 110) & (cols < 130)
    bands = [rng.normal(90, 6, rows.shape), rng.normal(80, 6, rows.shape)]
    bands.append(np.where(inside, 200, 70) + rng.normal(0, 6, rows.shape))
    file = gdal.GetDriverByName("GTiff").Create(str(path), 240, 200, 3, gdal.GDT_Byte)
    file.SetGeoTransform((4e5, 2, 0, 5e6, 0, -2))
    from osgeo import osr

    place = osr.SpatialReference()
    place.ImportFromEPSG(32618)
    file.SetProjection(place.ExportToWkt())
    for number, band in enumerate(bands, 1):
        file.GetRasterBand(number).WriteArray(np.clip(band, 1, 255).astype(np.uint8))
        file.GetRasterBand(number).SetColorInterpretation(gdal.GCI_Undefined)
        if names:
            file.GetRasterBand(number).SetDescription(names[number - 1])
    return path


@pytest.fixture
def named_dock(dock: Any, tmp_path: Path) -> Any:
    """The dock over a raster with names of bands."""
    return _over(dock, _write(tmp_path / "named.tif", ("green", "red", "nir")))


def _over(dock: Any, path: Path) -> Any:
    layer = QgsRasterLayer(str(path), path.stem, "gdal")
    QgsProject.instance().addMapLayer(layer)
    show_map(dock._canvas, layer)
    dock.range.rasters.setLayer(layer)
    wait_until(lambda: not dock.range.finder.is_running)
    return dock


def _choose(dock: Any, kind: str) -> None:
    dock.range.intensity.kinds.setCurrentText(kind)


def _answered(dock: Any) -> None:
    wait_until(lambda: not dock.range.finder.is_running)


def _typed(*words: object) -> None:
    subprocess.run([os.environ["UAVSEG_PROGRAM"], *map(str, words)], check=True, capture_output=True)


def _regions(path: Path) -> list[tuple[int, float, str]]:
    layer = QgsVectorLayer(str(path), "regions", "ogr")
    assert layer.isValid()
    return [(f["pixels"], f["mean"], f.geometry().asWkt(3)) for f in layer.getFeatures()]


def test_an_index_is_divided_and_answered_as_on_the_command_line(named_dock: Any, tmp_path: Path) -> None:
    box, finder = named_dock.range.intensity, named_dock.range.finder
    by_itself = finder.blocks
    _choose(named_dock, INDEX)
    assert box.indices.currentText() == "ndvi" and finder.is_running and finder.means is None
    _answered(named_dock)
    assert finder.blocks == tmp_path / "named.ndvi.uavseg-blocks.tif" != by_itself
    _typed("divide", tmp_path / "named.tif", "--index", "ndvi", "-o", tmp_path / "typed.tif")
    assert finder.blocks.read_bytes() == (tmp_path / "typed.tif").read_bytes()
    finder.find(0.6, 1)
    _answered(named_dock)
    words = ["--index", "ndvi", "--range", "0.6,1", "-o", tmp_path / "typed.gpkg"]
    _typed("extract", tmp_path / "named.tif", *words)
    found = named_dock.layer()
    assert _regions(Path(found.source().split("|")[0])) == _regions(tmp_path / "typed.gpkg")
    assert found.featureCount() > 0 and found.name() == "Regions of named, ndvi, v 0.6 to 1"


def test_another_index_has_another_block_map_and_is_not_divided_twice(named_dock: Any) -> None:
    box, finder = named_dock.range.intensity, named_dock.range.finder
    _choose(named_dock, INDEX)
    _answered(named_dock)
    first = finder.blocks
    box.indices.setCurrentText("gndvi")
    _answered(named_dock)
    assert finder.blocks != first and finder.means is not None
    box.indices.setCurrentText("ndvi")
    assert finder.blocks == first and finder.means is not None and not finder.is_running


def test_a_formula_needs_its_text_and_is_taken_with_enter(named_dock: Any, tmp_path: Path) -> None:
    box, finder = named_dock.range.intensity, named_dock.range.finder
    _choose(named_dock, FORMULA)
    assert not finder.is_running and finder.means is None
    assert "Type a formula of bands" in named_dock.range.state.text()
    assert not named_dock.range.sample.isEnabled() and not named_dock.range.slider.isEnabled()
    QTest.keyClicks(box.formula, "nir - red")
    assert not finder.is_running
    QTest.keyClicks(box.formula, "\r")
    assert finder.is_running
    _answered(named_dock)
    assert finder.means is not None and named_dock.range.sample.isEnabled()
    _typed("divide", tmp_path / "named.tif", "--expr", "nir - red", "-o", tmp_path / "typed.tif")
    assert finder.blocks.read_bytes() == (tmp_path / "typed.tif").read_bytes()


def test_names_of_bands_are_passed_on(dock: Any, tmp_path: Path) -> None:
    box, finder = dock.range.intensity, dock.range.finder
    _over(dock, _write(tmp_path / "plain.tif", ()))
    _choose(dock, INDEX)
    _answered(dock)
    assert finder.means is None and "nir" in dock.range.state.text()  # what the program says
    box.names.setText("green,red,nir")
    box.names.editingFinished.emit()
    _answered(dock)
    assert finder.means is not None, dock.range.state.text()
    words = ["--index", "ndvi", "--band-names", "green,red,nir", "-o", tmp_path / "typed.tif"]
    _typed("divide", tmp_path / "plain.tif", *words)
    assert finder.blocks.read_bytes() == (tmp_path / "typed.tif").read_bytes()


def test_a_sample_is_compared_in_the_same_intensity(named_dock: Any, tmp_path: Path) -> None:
    finder = named_dock.range.finder
    _choose(named_dock, INDEX)
    _answered(named_dock)
    finder.match(QgsPointXY(400130, 4999890), 70)
    _answered(named_dock)
    found = named_dock.layer()
    assert found is not None, named_dock.range.state.text()
    words = ["--index", "ndvi", "--like", "400130,4999890,70", "-o", tmp_path / "typed.gpkg"]
    _typed("match", tmp_path / "named.tif", *words)
    assert _regions(Path(found.source().split("|")[0])) == _regions(tmp_path / "typed.gpkg")


def test_only_what_belongs_to_a_choice_is_shown(dock: Any) -> None:
    box = dock.range.intensity
    rows = {BAND: (box.bands,), INDEX: (box.indices, box.names), FORMULA: (box.formula, box.names)}
    for kind, shown in rows.items():
        _choose(dock, kind)
        for widget in (box.bands, box.indices, box.formula, box.names):
            assert widget.isVisibleTo(box) == (widget in shown), kind
            assert box.form.labelForField(widget).isVisibleTo(box) == (widget in shown), kind


def test_each_choice_has_its_own_words_and_key() -> None:
    choices = [
        Intensity(),
        Intensity(1),
        Intensity(2),
        Intensity(index="ndvi"),
        Intensity(index="ndwi"),
        Intensity(index="ndvi", names="red,nir"),
        Intensity(formula="b1"),
        Intensity(formula="b1/b2"),
        Intensity(formula="b1", names="b1"),
        Intensity(formula="../x"),
    ]
    assert len({tuple(one.words()) for one in choices}) == len({one.key for one in choices}) == len(choices)
    assert choices[0].words() == [] and choices[0].key == ""
    assert choices[5].words() == ["--index=ndvi", "--band-names=red,nir"]
    assert all(part not in one.key for one in choices for part in "/\\.: ")
