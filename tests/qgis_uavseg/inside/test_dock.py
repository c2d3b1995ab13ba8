"""The dock "Regions": cells at once, exact regions, a sample, ticks, missions seen before they are saved."""

import json
import os
import stat
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("qgis.core")
pytest.importorskip("pytest_qgis")

import numpy as np
from conftest import SAMPLES, photograph, show_map, wait_until
from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsGeometry,
    QgsPointXY,
    QgsProject,
    QgsRasterLayer,
    QgsRectangle,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QEvent, QPoint, QPointF, Qt
from qgis.PyQt.QtGui import QImage, QMouseEvent, QPainter
from qgis.PyQt.QtTest import QTest

from qgis_uavseg.dock import block_store
from qgis_uavseg.dock.block_means import COLOR, BlockMeans
from qgis_uavseg.dock.finder import RegionFinder
from qgis_uavseg.dock.histogram_slider import HistogramSlider
from qgis_uavseg.dock.mission import MissionRequest

JSON = ("--json", "--footprints")


def _typed(*words: object) -> None:
    subprocess.run([os.environ["UAVSEG_PROGRAM"], *map(str, words)], check=True, capture_output=True)


def _found(dock: Any) -> QgsVectorLayer:
    wait_until(lambda: not dock.range.finder.is_running)
    layer = dock.layer()
    assert layer is not None, dock.range.state.text()
    return layer


@pytest.mark.parametrize("ends", [(0.55, 1), (0, 0.3), (0.2, 0.4), (0.413, 0.657), (0.7, 0.75)])
def test_cells_in_a_range_are_those_of_the_command_line(
    ends: tuple[float, float], quarry: Path, program: str, tmp_path: Path, qgis_app: Any
) -> None:
    blocks, labels = tmp_path / "b.tif", tmp_path / "labels.tif"
    _typed("divide", quarry, "-o", blocks)
    words = [
        "--range",
        f"{ends[0]},{ends[1]}",
        "--refine",
        "none",
        "--labels",
        labels,
        "-o",
        tmp_path / "o.gpkg",
    ]
    _typed("extract", blocks, *words, "--allow-path", quarry.parent)
    layer = QgsRasterLayer(str(labels), "labels", "gdal")
    block = layer.dataProvider().block(1, layer.extent(), layer.width(), layer.height())
    classes = {4: np.uint32, 5: np.int32, 2: np.uint16, 1: np.uint8}
    pixels = np.frombuffer(bytes(block.data()), classes[int(block.dataType())])
    pixels = pixels.reshape(layer.height(), layer.width())
    in_range = BlockMeans(blocks).in_range(*ends)
    assert np.array_equal(in_range.astype(bool), pixels[::8, ::8] > 0)


def test_the_block_map_is_made_once_and_kept_beside_the_raster(quarry_dock: Any, quarry: Path) -> None:
    blocks = quarry.with_name("quarry.uavseg-blocks.tif")
    made = blocks.stat().st_mtime_ns
    quarry_dock.range.take_raster()
    assert quarry_dock.range.finder.means is not None  # at once, without a process
    assert not quarry_dock.range.finder.is_running and blocks.stat().st_mtime_ns == made
    os.utime(quarry, ns=(made + 10**9, made + 10**9))
    quarry_dock.range.take_raster()
    assert quarry_dock.range.finder.means is None and quarry_dock.range.finder.is_running
    wait_until(lambda: quarry_dock.range.finder.means is not None)
    assert blocks.stat().st_mtime_ns > made


def test_a_raster_that_was_replaced_by_an_older_one_has_another_block_map(quarry: Path) -> None:
    blocks = quarry.with_name("quarry.uavseg-blocks.tif")
    assert not block_store.is_fresh(blocks, quarry)
    blocks.touch()
    assert block_store.is_fresh(blocks, quarry)
    older = quarry.with_name("older.tif")
    older.write_bytes(b"other")
    os.utime(older, (1, 1))
    time.sleep(0.02)
    older.replace(quarry)
    assert quarry.stat().st_mtime < blocks.stat().st_mtime and not block_store.is_fresh(blocks, quarry)


def test_without_a_folder_to_write_to_the_block_map_is_cached(
    quarry: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, qgis_app: Any
) -> None:
    monkeypatch.setattr(block_store, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(block_store.os, "access", lambda path, mode: False)
    cached = block_store.block_file(quarry)
    assert cached.parent == tmp_path / "cache" and cached.name.endswith(".quarry.uavseg-blocks.tif")
    assert block_store.block_file(quarry, "band2") != cached
    monkeypatch.setattr(block_store, "KEPT", 3)
    block_store.make_room(cached.parent)
    for k in range(5):
        path = cached.parent / f"{k}{block_store.SUFFIX}"
        path.touch()
        os.utime(path, (k, k))
    block_store.make_room(cached.parent)
    assert sorted(path.name[0] for path in cached.parent.iterdir()) == ["3", "4"]


def _mouse(widget: Any, kind: Any, x: float, button: Any = Qt.LeftButton) -> None:
    buttons = Qt.NoButton if kind == QEvent.MouseButtonRelease else button
    place = QPointF(x, 30)
    event = QMouseEvent(kind, place, button, buttons, Qt.NoModifier)
    {
        QEvent.MouseButtonPress: widget.mousePressEvent,
        QEvent.MouseMove: widget.mouseMoveEvent,
        QEvent.MouseButtonRelease: widget.mouseReleaseEvent,
    }[kind](event)


def test_handles_are_dragged_and_do_not_pass_each_other(qgis_app: Any) -> None:
    slider, moved, released = HistogramSlider(), [], []
    slider.resize(300, 110)
    slider.set_histogram([1, 4, 2, 8], (0.2, 0.8))
    slider.set_range(0.3, 0.6)
    slider.moved.connect(lambda *ends: moved.append(ends))
    slider.released.connect(lambda *ends: released.append(ends))
    _mouse(slider, QEvent.MouseButtonPress, slider.x_of(0.3))
    _mouse(slider, QEvent.MouseMove, slider.x_of(0.5))
    assert moved[-1] == (pytest.approx(0.5, abs=1e-3), 0.6) and not released
    _mouse(slider, QEvent.MouseMove, slider.x_of(0.7))
    assert moved[-1] == (0.599, 0.6)
    _mouse(slider, QEvent.MouseMove, -5)
    assert moved[-1] == (0.0, 0.6)  # beyond the histogram the range is open
    _mouse(slider, QEvent.MouseButtonRelease, -5)
    assert released == [(0.0, 0.6)]
    slider.set_range(0.3, 0.6)
    _mouse(slider, QEvent.MouseButtonPress, slider.x_of(0.45))
    _mouse(slider, QEvent.MouseMove, slider.x_of(0.55))
    assert moved[-1] == (pytest.approx(0.4, abs=2e-3), pytest.approx(0.7, abs=2e-3))
    _mouse(slider, QEvent.MouseButtonRelease, slider.x_of(0.55))


def test_arrow_keys_move_the_handle_that_was_used_last(qgis_app: Any) -> None:
    slider, released = HistogramSlider(), []
    slider.set_range(0.3, 0.6)
    slider.released.connect(lambda *ends: released.append(ends))
    QTest.keyClick(slider, Qt.Key_Left)
    assert released == [(0.3, 0.599)]
    QTest.keyClick(slider, Qt.Key_Right, Qt.ShiftModifier)
    assert released[-1] == (0.3, 0.609)


def _painted(dock: Any) -> np.ndarray:
    """Pixels of the canvas that the preview covers, 1; others 0."""
    item = dock.range.preview
    image = QImage(dock._canvas.mapSettings().outputSize(), QImage.Format_ARGB32)
    image.fill(0)
    painter = QPainter(image)
    item.paint(painter)
    painter.end()
    data = image.constBits().asarray(image.sizeInBytes())
    return np.frombuffer(bytes(data), np.uint8).reshape(image.height(), image.width(), 4)[..., 3] > 0


def test_the_preview_lies_where_the_cells_are(quarry_dock: Any) -> None:
    dock = quarry_dock
    dock.range.show_range(0.55, 1)
    painted = _painted(dock)
    means = dock.range.finder.means
    inside = means.in_range(0.55, 1).astype(bool)
    assert 0 < painted.mean() < 1
    rows, cols = inside.shape
    box = means.extent
    for shown in (box, QgsRectangle(512400, 5478400, 512500, 5478480)):  # all, and a part
        dock._canvas.setExtent(shown)
        painted, compared = _painted(dock), 0
        to_pixel = dock._canvas.mapSettings().mapToPixel()
        for row in range(0, rows, 3):
            for col in range(0, cols, 3):
                x = box.xMinimum() + (col + 0.5) * box.width() / cols
                y = box.yMaximum() - (row + 0.5) * box.height() / rows
                spot = to_pixel.transform(QgsPointXY(x, y))
                if 0 <= spot.x() < painted.shape[1] and 0 <= spot.y() < painted.shape[0]:
                    assert painted[int(spot.y()), int(spot.x())] == inside[row, col]
                    compared += 1
        assert compared > 40


def test_the_preview_follows_the_crs_of_the_project(quarry_dock: Any) -> None:
    dock, canvas = quarry_dock, quarry_dock._canvas
    dock.range.show_range(0, 1)
    canvas.setDestinationCrs(QgsCoordinateReferenceSystem("EPSG:4326"))
    canvas.setExtent(QgsRectangle(-122.832, 49.4565, -122.823, 49.4605))
    painted = _painted(dock)
    assert 0.05 < painted.mean() < 0.95
    cols = np.flatnonzero(painted.any(axis=0))
    west = canvas.mapSettings().mapToPixel().toMapCoordinates(int(cols.min()), 0).x()
    assert west == pytest.approx(-122.829738, abs=5e-5)


def test_on_release_the_regions_are_those_of_the_command_line(
    quarry_dock: Any, quarry: Path, tmp_path: Path
) -> None:
    quarry_dock.range.slider.set_range(0.55, 1)
    quarry_dock.range.slider.released.emit(0.55, 1.0)
    layer = _found(quarry_dock)
    _typed("extract", quarry, "--range", "0.55,1", "-o", tmp_path / "typed.gpkg")
    typed = QgsVectorLayer(str(tmp_path / "typed.gpkg"), "typed", "ogr")
    ours = {feature["id"]: feature.geometry().asWkt() for feature in layer.getFeatures()}
    assert ours == {feature["id"]: feature.geometry().asWkt() for feature in typed.getFeatures()}
    assert quarry_dock.ticks.ids() == set(ours) and quarry_dock.ticks.are_all_ticked()
    assert not quarry_dock.range.preview.isVisible()


def test_moving_the_range_again_ends_the_search(quarry_dock: Any, tmp_path: Path, monkeypatch: Any) -> None:
    ended = tmp_path / "ended"
    slow = tmp_path / "uavseg"
    slow.write_text(
        '#!/bin/sh\n[ "$1" = --version ] && { echo uavseg 1.0.0; exit; }\n'
        f"trap 'touch {ended}; exit 1' TERM\necho progress 10 >&2\nwhile :; do sleep 0.05; done\n"
    )
    slow.chmod(slow.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("UAVSEG_PROGRAM", str(slow))
    failed: list[str] = []
    quarry_dock.range.finder.failed.connect(failed.append)
    seen: list[int] = []
    quarry_dock.range.finder.progressed.connect(seen.append)
    quarry_dock.range.slider.released.emit(0.55, 1.0)
    wait_until(lambda: 10 in seen)
    quarry_dock.range.slider.moved.emit(0.5, 1.0)
    assert not quarry_dock.range.finder.is_running  # at once: the hand does not wait for the process
    wait_until(ended.exists, 5)
    assert not failed and quarry_dock.layer() is None and quarry_dock.range.preview.isVisible()


def test_an_error_of_the_program_is_shown(dock: Any, tmp_path: Path) -> None:
    broken = tmp_path / "broken.tif"
    broken.write_bytes((SAMPLES / "quarry.tif").read_bytes())
    layer = QgsRasterLayer(str(broken), "broken", "gdal")
    QgsProject.instance().addMapLayer(layer)
    broken.write_bytes(b"II*\0")
    dock.range.rasters.setLayer(layer)
    wait_until(lambda: not dock.range.finder.is_running)
    assert "broken.tif" in dock.range.state.text() and not dock.range.slider.isEnabled()


def test_a_missing_program_is_named_with_what_to_type(
    quarry: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, qgis_app: Any
) -> None:
    monkeypatch.setenv("UAVSEG_PROGRAM", str(tmp_path / "none"))
    finder, failed = RegionFinder(), []
    finder.failed.connect(failed.append)
    finder.set_raster(QgsRasterLayer(str(quarry), "quarry", "gdal"))
    assert "is not a file; type: python3 -m venv" in failed[0]


def test_a_disc_on_the_map_finds_regions_like_it(dock: Any, tmp_path: Path) -> None:
    fields = tmp_path / "fields.tif"
    fields.write_bytes((SAMPLES / "fields_rgb.tif").read_bytes())
    layer = QgsRasterLayer(str(fields), "fields", "gdal")
    QgsProject.instance().addMapLayer(layer)
    canvas = dock._canvas
    show_map(canvas, layer)
    dock.range.rasters.setLayer(layer)
    dock.range.sample.click()
    assert canvas.mapTool() is dock.range.disc_tool
    spots = [canvas.mapSettings().mapToPixel().transform(QgsPointXY(x, 6471890)) for x in (548225, 548229)]
    places = [QPoint(round(spot.x()), round(spot.y())) for spot in spots]
    viewport = canvas.viewport()
    QTest.mousePress(viewport, Qt.LeftButton, Qt.NoModifier, places[0])
    QTest.mouseMove(viewport, places[1])
    QTest.mouseRelease(viewport, Qt.LeftButton, Qt.NoModifier, places[1])
    assert dock.range.finder._finding.is_running
    found = _found(dock)
    assert found.featureCount() > 0 and found.fields().indexOf("similarity") >= 0
    assert not dock.range.sample.isChecked()
    similarities = [dock.ticks.topLevelItem(0).text(column) for column in range(dock.ticks.columnCount())]
    assert all(similarities)


def _with_regions(dock: Any) -> QgsVectorLayer:
    dock.range.find(0.55, 1.0)
    return _found(dock)


def test_regions_are_ticked_in_the_list_and_on_the_map(quarry_dock: Any) -> None:
    dock, layer = quarry_dock, _with_regions(quarry_dock)
    assert dock.count.text() == "4 of 4 regions are ticked"
    dock.none_button.click()
    assert dock.ticks.ids() == set()
    largest = next(feature for feature in layer.getFeatures() if feature["id"] == 1)
    dock.tick_at(largest.geometry().pointOnSurface().asPoint())
    assert dock.ticks.ids() == {1} and dock.count.text() == "1 of 4 regions are ticked"
    rules = [rule.filterExpression() for rule in layer.renderer().rootRule().children()]
    assert rules == ['"id" IN (1)', "ELSE"]
    dock.ticks.topLevelItem(1).setCheckState(0, Qt.Checked)
    assert dock.ticks.ids() == {1, 2}
    dock.tick_at(largest.geometry().pointOnSurface().asPoint())
    assert dock.ticks.ids() == {2}


def _plan(dock: Any) -> None:
    dock.mission.preview_button.click()
    wait_until(lambda: not dock.planner.is_running)


def test_a_mission_is_seen_and_what_is_saved_is_that(quarry_dock: Any, tmp_path: Path) -> None:
    dock = quarry_dock
    _with_regions(dock)
    dock.ticks.tick([1, 3], False)
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    dock.mission.gsd.setValue(1.5)
    assert not dock.mission.save_button.isEnabled()
    _plan(dock)
    assert dock.mission.save_button.isEnabled(), dock.mission.estimate.text()
    legs, footprints = dock.layer("legs"), dock.layer("footprints")
    target = tmp_path / "seen.plan"
    dock.save(target)
    wait_until(lambda: not dock.planner.is_running)
    words = ["--ids", "2,4", "--camera", "DJI Mavic 3 Enterprise", "--gsd", "1.5", "--home", "auto"]
    regions = Path(dock.layer().source().split("|")[0])
    _typed("plan", regions, *words, "-o", tmp_path / "typed.plan")
    assert target.read_bytes() == (tmp_path / "typed.plan").read_bytes()
    assert f"saved:</b> {target}" in dock.mission.estimate.text()
    _typed("check", target)
    estimate = json.loads(
        subprocess.run(
            [os.environ["UAVSEG_PROGRAM"], "plan", regions, *words, *JSON, "-o", tmp_path / "t.plan"],
            capture_output=True,
            check=True,
        ).stdout
    )["flights"][0]
    assert f"{estimate['photographs']} photographs" in dock.mission.estimate.text()
    assert footprints.featureCount() == estimate["photographs"]
    assert legs.featureCount() > 10
    across, along = estimate["footprint_m"]
    outlines = [f.geometry().asPolygon()[0] for f in footprints.getFeatures()]
    seen = [[[corner.x(), corner.y()] for corner in outline[:4]] for outline in outlines]
    assert seen == estimate["footprints"]
    first = next(footprints.getFeatures()).geometry()
    meters = first.area() * 111_200 * 111_200 * np.cos(np.radians(49.458))
    assert meters == pytest.approx(across * along, rel=0.01)


def test_gaps_of_photographs_are_regions_for_the_next_flight(quarry_dock: Any, tmp_path: Path) -> None:
    dock = quarry_dock
    mission, photographs, gaps = tmp_path / "m.plan", tmp_path / "photographs", tmp_path / "gaps.gpkg"
    photograph(_file(_with_regions(dock)), mission, photographs)
    done = subprocess.run(
        [os.environ["UAVSEG_PROGRAM"], "check", mission, "--photos", photographs, "--gaps", gaps],
        capture_output=True,
    )
    assert done.returncode == 1 and gaps.exists()
    loaded = QgsProject.instance().addMapLayer(QgsVectorLayer(str(gaps), "Gaps", "ogr")).id()
    dock.show_gaps(gaps)
    assert QgsProject.instance().mapLayer(loaded) is None
    layer = dock.layer()
    assert _file(layer) == gaps and "gaps" in layer.name()
    assert layer.featureCount() == len(dock.ticks.ids()) > 0
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    _plan(dock)
    assert dock.mission.save_button.isEnabled(), dock.mission.estimate.text()
    assert dock.layer("footprints").featureCount() > 0


def _file(layer: QgsVectorLayer) -> Path:
    return Path(layer.source().split("|")[0])


def test_footprints_cover_what_is_flown_over(quarry_dock: Any) -> None:
    dock, layer = quarry_dock, _with_regions(quarry_dock)
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    _plan(dock)
    shown = QgsGeometry.unaryUnion([f.geometry() for f in dock.layer("footprints").getFeatures()])
    from qgis.core import QgsCoordinateTransform

    to_wgs84 = QgsCoordinateTransform(
        layer.crs(), QgsCoordinateReferenceSystem("EPSG:4326"), QgsProject.instance()
    )
    for feature in layer.getFeatures():
        region = feature.geometry()
        region.transform(to_wgs84)
        assert shown.contains(region)


def test_photographs_that_are_taken_in_hover_have_footprints_too(quarry_dock: Any) -> None:
    dock = quarry_dock
    _with_regions(dock)
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    dock.mission.pattern.setCurrentIndex(dock.mission.pattern.findData("visit"))
    _plan(dock)
    assert "4 photographs" in dock.mission.estimate.text()
    assert dock.layer("footprints").featureCount() == 4 and dock.layer("legs").featureCount() == 5


def test_photographs_without_a_footprint_are_said(quarry_dock: Any) -> None:
    dock = quarry_dock
    _with_regions(dock)
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    dock.mission.pattern.setCurrentIndex(dock.mission.pattern.findData("orbit"))
    _plan(dock)
    assert "no footprints: the camera looks at places" in dock.mission.estimate.text()
    assert dock.layer("footprints") is None and dock.layer("legs") is not None


def test_several_flights_are_seen_and_saved_and_no_other_file_is_replaced(
    quarry_dock: Any, tmp_path: Path
) -> None:
    dock = quarry_dock
    _with_regions(dock)
    dock.mission.camera.setText("DJI Mavic 3 Enterprise")
    dock.mission.endurance.setValue(10)
    _plan(dock)
    flights = {leg["flight"] for leg in dock.layer("legs").getFeatures()}
    assert len(flights) > 1 and f"Flight {len(flights)}:" in dock.mission.estimate.text()
    dock.save(tmp_path / "m.plan")
    wait_until(lambda: not dock.planner.is_running)
    written = sorted(path.name for path in tmp_path.glob("*.plan"))
    assert len(written) == len(flights)
    assert all(name in dock.mission.estimate.text() for name in written)
    other = tmp_path / written[-1]
    other.write_bytes(b"other")
    for name in written[:-1]:
        (tmp_path / name).unlink()
    dock.save(tmp_path / "m.plan")
    wait_until(lambda: not dock.planner.is_running)
    assert other.read_bytes() == b"other" and other.name in dock.mission.estimate.text()
    assert [path.name for path in tmp_path.glob("*.plan")] == [other.name]


def test_what_changes_after_the_look_is_not_saved(quarry_dock: Any, tmp_path: Path) -> None:
    dock = quarry_dock
    _with_regions(dock)
    changes = (
        lambda: dock.mission.altitude.setValue(70),
        lambda: dock.ticks.tick([2], False),
        lambda: dock.mission.places.set_home(QgsPointXY(512345, 5478350)),
        lambda: dock.mission.places.add_zone(
            QgsGeometry.fromRect(QgsRectangle(512640, 5478600, 512650, 5478610))
        ),
        lambda: dock.mission.places.clear_zones(),
    )
    for change in changes:
        _plan(dock)
        assert dock.mission.save_button.isEnabled(), dock.mission.estimate.text()
        change()
        assert not dock.mission.save_button.isEnabled()
        assert dock.layer("legs") is None and dock.layer("footprints") is None
        dock.save(tmp_path / "m.plan")
        assert (
            not (tmp_path / "m.plan").exists() and "Press Plan mission first" in dock.mission.estimate.text()
        )


def test_what_changes_during_the_planning_is_not_saved_either(quarry_dock: Any) -> None:
    _with_regions(quarry_dock)
    quarry_dock.mission.preview_button.click()
    assert quarry_dock.planner.is_running
    quarry_dock.mission.altitude.setValue(70)
    assert not quarry_dock.planner.is_running and not quarry_dock.mission.save_button.isEnabled()


def test_home_and_keep_out_zones_are_drawn_and_kept(quarry_dock: Any, tmp_path: Path) -> None:
    dock, canvas = quarry_dock, quarry_dock._canvas
    _with_regions(dock)
    dock.mission.home_button.click()
    assert canvas.mapTool() is dock.mission.home_tool
    spot = canvas.mapSettings().mapToPixel().transform(QgsPointXY(512350, 5478350))
    QTest.mouseClick(
        canvas.viewport(), Qt.LeftButton, Qt.NoModifier, QPoint(round(spot.x()), round(spot.y()))
    )
    home = dock.mission.places.home
    assert home.x() == pytest.approx(-122.8296, abs=2e-4) and home.y() == pytest.approx(49.4577, abs=2e-4)
    dock.mission.zone_button.click()
    for x, y in ((512480, 5478440), (512500, 5478440), (512500, 5478470), (512480, 5478470)):
        corner = canvas.mapSettings().mapToPixel().transform(QgsPointXY(x, y))
        place = QPoint(round(corner.x()), round(corner.y()))
        QTest.mouseClick(canvas.viewport(), Qt.LeftButton, Qt.NoModifier, place)
    QTest.mouseClick(canvas.viewport(), Qt.RightButton, Qt.NoModifier, place)
    assert dock.mission.places.count_zones() == 1 and dock.mission.zone_label.text() == "1 zone"
    dock.mission.zone_button.click()
    _plan(dock)
    zone = QgsGeometry.unaryUnion([f.geometry() for f in dock.mission.places.layer().getFeatures()])
    legs = list(dock.layer("legs").getFeatures())
    assert legs and not any(leg.geometry().intersects(zone) for leg in legs)
    first = legs[0].geometry().asPolyline()[0]
    assert (first.x(), first.y()) == (pytest.approx(home.x(), abs=1e-6), pytest.approx(home.y(), abs=1e-6))


def test_without_a_crs_of_the_project_there_is_no_home(quarry_dock: Any) -> None:
    quarry_dock._canvas.setDestinationCrs(QgsCoordinateReferenceSystem())
    quarry_dock.mission.home_tool.chosen.emit(QgsPointXY(2.1, 0.3))
    assert quarry_dock.mission.places.home is None
    assert "the project has no CRS" in quarry_dock.mission.estimate.text()
    quarry_dock.mission.zone_tool.drawn.emit(QgsGeometry.fromRect(QgsRectangle(0, 0, 1, 1)))
    assert quarry_dock.mission.places.layer() is None


def test_what_must_not_be_flown_is_refused_with_its_reason(quarry_dock: Any, tmp_path: Path) -> None:
    dock = quarry_dock
    dock.mission.preview_button.click()
    assert "Find regions first" in dock.mission.estimate.text()
    _with_regions(dock)
    dock.ticks.tick_all(False)
    dock.mission.preview_button.click()
    assert "Tick the regions" in dock.mission.estimate.text()
    dock.ticks.tick_all(True)
    dock.mission.home_altitude.setValue(200)
    dock.mission.preview_button.click()
    assert "set home on the map" in dock.mission.estimate.text()
    dock.mission.home_altitude.setValue(dock.mission.home_altitude.minimum())
    dock.mission.altitude.setValue(300)
    _plan(dock)
    said = dock.mission.estimate.text()
    assert "120" in said and not dock.mission.save_button.isEnabled()
    assert "--max-altitude is an option of the command line" in said
    dock.mission.gsd.setValue(2)
    _plan(dock)
    assert "needs a camera (“Camera”)</span>" in dock.mission.estimate.text()


def test_words_of_a_request(tmp_path: Path) -> None:
    options = (("--altitude", "60"), ("--camera", ""), ("--home-altitude", "212"))
    request = MissionRequest(
        tmp_path / "r.gpkg", (1, 3), options, QgsPointXY(-122.8272, 49.4583), tmp_path / "z.gpkg"
    )
    assert request.words(tmp_path / "m.plan") == [
        "plan",
        "--home=49.4583,-122.8272,212",
        "--altitude=60",
        f"--avoid={tmp_path / 'z.gpkg'}",
        "--ids=1,3",
        f"--output={tmp_path / 'm.plan'}",
        "--json",
        "--footprints",
        "--",
        str(tmp_path / "r.gpkg"),
    ]
    (tmp_path / "m.plan").touch()  # the dialog of the file asked whether it is to be replaced
    assert "--overwrite" in request.words(tmp_path / "m.plan")


def test_more_regions_than_are_listed_are_not_flown_over(
    quarry_dock: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from qgis_uavseg.dock import tick_list

    monkeypatch.setattr(tick_list, "MOST", 2)
    _with_regions(quarry_dock)
    assert quarry_dock.count.text() == (
        "2 of 4 regions are ticked; only the 2 largest are listed and can be flown over"
    )
    assert quarry_dock.request().ids == (1, 2)


def test_stopping_says_how_to_go_on_and_closing_clears_the_map(quarry_dock: Any) -> None:
    quarry_dock.range.show_range(0.3, 0.5)
    assert quarry_dock.range.preview.isVisible()
    quarry_dock.close()
    assert not quarry_dock.range.preview.isVisible()
    quarry_dock.range.finder.means = None
    quarry_dock.range.stop_button.click()
    assert "choose the raster again" in quarry_dock.range.state.text()


def test_a_layer_that_is_removed_is_forgotten(quarry_dock: Any) -> None:
    layer = _with_regions(quarry_dock)
    QgsProject.instance().removeMapLayer(layer.id())
    assert quarry_dock.layer() is None and quarry_dock.ticks.topLevelItemCount() == 0


def test_cells_that_are_smaller_than_pixels_are_drawn_in_steps(quarry_dock: Any) -> None:
    dock = quarry_dock
    dock.range.show_range(0.55, 1)
    share = dock.range.finder.means.in_range(0.55, 1).mean()
    box = dock.range.finder.means.extent
    dock._canvas.setExtent(box.buffered(15 * box.width()))  # a cell is a third of a pixel
    painted = _painted(dock)
    per_pixel = dock._canvas.mapUnitsPerPixel()
    pixels = box.width() / per_pixel * box.height() / per_pixel
    assert per_pixel > 2 * box.width() / dock.range.finder.means.shape[1]
    assert painted.sum() / pixels == pytest.approx(share, abs=0.1)


def test_the_color_of_cells_lets_the_raster_show_through() -> None:
    assert 100 < COLOR.alpha() < 220


def test_a_raster_that_is_added_is_not_touched_until_it_is_chosen(dock: Any, quarry: Path) -> None:
    QgsProject.instance().addMapLayer(QgsRasterLayer(str(quarry), "quarry", "gdal"))
    wait_until(lambda: dock.range.rasters.count() > 1)
    assert dock.range.rasters.currentLayer() is None and not dock.range.finder.is_running
    assert [path.name for path in quarry.parent.iterdir()] == ["quarry.tif"]


def test_the_plugin_is_loaded_and_unloaded_without_a_trace(qgis_iface: Any, program: str) -> None:
    from qgis.core import QgsApplication

    from qgis_uavseg import classFactory

    for _ in range(2):
        plugin = classFactory(qgis_iface)
        plugin.initGui()
        assert QgsApplication.processingRegistry().providerById("uavseg") is not None
        assert plugin.dock.windowTitle() == "Regions"
        items = len(plugin.dock._canvas.scene().items())
        plugin.unload()
        assert QgsApplication.processingRegistry().providerById("uavseg") is None
        assert plugin.dock is None and len(qgis_iface.mapCanvas().scene().items()) < items


def test_the_dialog_of_the_dock_plans_the_same_mission(
    processing: Any, quarry_dock: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from qgis.core import QgsApplication, QgsProcessingContext, QgsProcessingFeedback

    dock = quarry_dock
    _with_regions(dock)
    dock.ticks.tick([3], False)
    dock.mission.pattern.setCurrentIndex(dock.mission.pattern.findData("survey"))
    dock.mission.spacing.setValue(20)
    dock.mission.home_altitude.setValue(212)
    dock.mission.places.set_home(QgsPointXY(512352, 5478352))
    dock.mission.places.add_zone(QgsGeometry.fromRect(QgsRectangle(512470, 5478440, 512500, 5478470)))
    requested: list[Any] = []
    monkeypatch.setattr(processing, "execAlgorithmDialog", lambda *given: requested.append(given))
    dock.mission.more_button.click()
    ((name, given),) = requested
    algorithm = QgsApplication.processingRegistry().createAlgorithmById(name)
    assert set(given) <= {definition.name() for definition in algorithm.parameterDefinitions()}
    feedback, context = QgsProcessingFeedback(False), QgsProcessingContext()
    context.setProject(QgsProject.instance())
    results, ok = algorithm.run({**given, "OUTPUT": str(tmp_path / "dialog.plan")}, context, feedback)
    assert ok, feedback.textLog()
    _plan(dock)
    dock.save(tmp_path / "dock.plan")
    wait_until(lambda: not dock.planner.is_running)
    assert (tmp_path / "dialog.plan").read_bytes() == (tmp_path / "dock.plan").read_bytes()
    assert results["FLIGHTS"] == 1
