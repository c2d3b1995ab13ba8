"""Inside QGIS's own Python, with pytest-qgis: processes, styles and legs. Skipped where there is no QGIS.

In an environment with --system-site-packages of the Python of QGIS, pytest and pytest-qgis:
`PYTHONPATH=. python -m pytest -c /dev/null --confcutdir=tests/qgis_uavseg tests/qgis_uavseg/inside`.
"""

import json
import os
import stat
import subprocess
import threading
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("qgis.core")
pytest.importorskip("pytest_qgis")

from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsFeature,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingParameterDefinition,
    QgsProject,
    QgsRasterLayer,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QVariant

from qgis_uavseg import legs, process, styles, targets
from qgis_uavseg.options import Values, words_of
from qgis_uavseg.provider import UavsegProvider

SAMPLES = Path(__file__).resolve().parents[3] / "samples"


def _program(path: Path, text: str) -> str:
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


class Heard(QgsProcessingFeedback):
    """Feedback that keeps what it is given."""

    def __init__(self) -> None:
        super().__init__(False)
        self.warnings: list[str] = []
        self.infos: list[str] = []
        self.shares: list[float] = []
        self.progressChanged.connect(self.shares.append)

    def pushWarning(self, warning: str) -> None:
        self.warnings.append(warning)

    def pushInfo(self, info: str) -> None:
        self.infos.append(info)


@pytest.fixture
def provider(qgis_app: Any) -> Any:
    """The provider, registered."""
    made = UavsegProvider()
    QgsApplication.processingRegistry().addProvider(made)
    yield made
    QgsApplication.processingRegistry().removeProvider("uavseg")


def test_progress_warnings_and_errors_arrive_as_what_they_are(qgis_app: Any, tmp_path: Path) -> None:
    script = (
        "echo progress 10 >&2; echo 'uavseg: warning: look' >&2; echo '  regions 4'; echo progress 80 >&2; "
    )
    program = _program(tmp_path / "p", script + "echo 'uavseg: error: it is wet' >&2; exit 1")
    heard = Heard()
    finished = process.run(program, [], heard)
    assert (finished.code, finished.error()) == (1, "it is wet")
    assert (heard.shares, heard.warnings, heard.infos) == ([10.0, 80.0], ["look"], ["  regions 4"])


def test_a_process_that_ignores_the_request_to_end_is_killed_when_cancelled(
    qgis_app: Any, tmp_path: Path
) -> None:
    number = tmp_path / "pid"
    program = _program(tmp_path / "p", f"trap '' TERM; echo $$ > {number}; exec sleep 300")
    heard = Heard()
    threading.Timer(0.5, heard.cancel).start()
    with pytest.raises(process.Cancelled):
        process.run(program, [], heard)
    with pytest.raises(ProcessLookupError):
        os.kill(int(number.read_text()), 0)


def test_a_program_that_does_not_start_is_an_error(qgis_app: Any, tmp_path: Path) -> None:
    with pytest.raises(process.ProcessError, match="does not start"):
        process.run(str(tmp_path / "nothing"), [], Heard())


def test_every_parameter_has_a_label_and_help_and_ids_are_unique(provider: Any) -> None:
    algorithms = provider.algorithms()
    names = ["check", "classify", "extract", "footprints", "gaps", "georeference", "levels", "match", "path"]
    names += ["plan", "suggest", "suggestlike"]
    assert sorted(algorithm.name() for algorithm in algorithms) == names
    for algorithm in algorithms:
        assert algorithm.shortHelpString() and not algorithm.icon().isNull(), algorithm.id()
        for parameter in algorithm.parameterDefinitions():
            assert parameter.description(), (algorithm.id(), parameter.name())
            assert parameter.isDestination() or parameter.help(), (algorithm.id(), parameter.name())


def test_what_is_needed_first_is_not_hidden_under_advanced(provider: Any) -> None:
    advanced = QgsProcessingParameterDefinition.FlagAdvanced
    for algorithm in provider.algorithms():
        for parameter in algorithm.parameterDefinitions():
            if not parameter.flags() & QgsProcessingParameterDefinition.FlagOptional:
                assert not parameter.flags() & advanced, (algorithm.id(), parameter.name())


def _regions(fields: str, rows: list[list[object]]) -> QgsVectorLayer:
    layer = QgsVectorLayer(f"Polygon?crs=EPSG:3857&{fields}", "r", "memory")
    for row in rows:
        feature = QgsFeature(layer.fields())
        feature.setAttributes(row)
        assert layer.dataProvider().addFeature(feature)
    return layer


def test_regions_are_coloured_by_class_with_the_colours_of_the_file(qgis_app: Any) -> None:
    layer = _regions(
        "field=class:string&field=color:string", [["wet", "#0000ff"], ["dry", ""], ["wet", "#0000ff"]]
    )
    renderer = styles.region_renderer(layer)
    found = {
        part.value(): part.symbol().symbolLayer(0).strokeColor().name() for part in renderer.categories()
    }
    assert renderer.type() == "categorizedSymbol"
    assert found == {"wet": "#0000ff", "dry": styles.PALETTE[0]}


def test_regions_without_classes_are_coloured_by_their_mean(qgis_app: Any) -> None:
    renderer = styles.region_renderer(_regions("field=mean:double", [[0.2], [0.5], [0.9]]))
    assert (renderer.type(), renderer.classAttribute(), len(renderer.ranges())) == (
        "graduatedSymbol",
        "mean",
        3,
    )
    assert len({part.symbol().symbolLayer(0).strokeColor().name() for part in renderer.ranges()}) == 3
    assert styles.region_renderer(_regions("field=mean:double", [[0.2]])).type() == "singleSymbol"


def test_local_coordinates_are_shown_without_a_crs(qgis_app: Any) -> None:
    """Where a GeoPackage says "undefined", QGIS would look for a transformation, and draw nothing."""
    undefined = QgsCoordinateReferenceSystem()
    undefined.createFromWkt('LOCAL_CS["Undefined SRS",UNIT["metre",1]]')
    for style in styles.fresh_styles()[:2]:
        layer = _regions("field=mean:double", [[0.2]])
        style.postProcessLayer(layer, None, None)
        assert layer.crs().authid() == "EPSG:3857"
        layer.setCrs(undefined)
        style.postProcessLayer(layer, None, None)
        assert not layer.crs().isValid()


def test_legs_have_their_order_and_the_heights_of_their_ends(tmp_path: Path) -> None:
    line = {"type": "LineString", "coordinates": [[1, 2], [1, 2], [3, 2], [3, 5]]}
    flight = {"geometry": line, "properties": {"kind": "flight", "heights_m": [0, 60, 60, 80]}}
    path = tmp_path / "m.geojson"
    path.write_text(json.dumps({"features": [flight]}))
    found = [(*leg.attributes(), leg.geometry().asWkt()) for leg in legs.leg_features([path, path])]
    assert found[:2] == [(1, 1, 60, 60, "LineString (1 2, 3 2)"), (1, 2, 60, 80, "LineString (3 2, 3 5)")]
    assert [leg[:2] for leg in found] == [(1, 1), (1, 2), (2, 1), (2, 2)]


def test_legs_go_on_where_heights_change_their_meaning(tmp_path: Path) -> None:
    pieces = [([[1, 2], [3, 2]], [60, 60]), ([[3, 2], [3, 5], [1, 2]], [55, 55, 60])]
    features = [
        {
            "geometry": {"type": "LineString", "coordinates": places},
            "properties": {"kind": "flight", "heights_m": heights},
        }
        for places, heights in pieces
    ]
    path = tmp_path / "m.geojson"
    path.write_text(json.dumps({"features": features}))
    found = [tuple(leg.attributes()) for leg in legs.leg_features([path])]
    assert found == [(1, 1, 60, 60), (1, 2, 55, 55), (1, 3, 55, 60)]


def test_a_layer_with_unsaved_edits_is_refused(qgis_app: Any) -> None:
    layer = _regions("field=id:int", [[1]])
    targets.refuse_unsaved(layer, "Regions")
    layer.startEditing()
    layer.addFeature(QgsFeature(layer.fields()))
    with pytest.raises(Exception, match="unsaved edits"):
        targets.refuse_unsaved(layer, "Regions")


def test_a_layer_whose_crs_the_project_changed_is_a_warning(qgis_app: Any) -> None:
    layer, heard = QgsRasterLayer(str(SAMPLES / "quarry.tif"), "quarry", "gdal"), Heard()
    assert targets.raster_file(layer, "Raster", heard) == str(SAMPLES / "quarry.tif")
    assert not heard.warnings
    layer.setCrs(QgsCoordinateReferenceSystem("EPSG:32611"))
    targets.raster_file(layer, "Raster", heard)
    assert "EPSG:32611" in heard.warnings[0] and "EPSG:32610" in heard.warnings[0]


def test_what_a_dialog_leaves_empty_gives_no_words(provider: Any) -> None:
    """A dialog passes None, "", the NULL of Qt, and [NULL] for a table without rows."""
    algorithm = provider.algorithm("extract")
    null = QVariant(QVariant.String)
    empty = dict.fromkeys(("BAND", "INDEX", "METHOD", "NODATA", "THREADS"))
    empty.update(
        {"EXPRESSION": "", "STRETCH": "", "CLASSES": [null], "CLASSES_FILE": null, "RANGE": "0.55,1"}
    )
    values = Values.of(algorithm, empty, QgsProcessingContext(), Heard())
    assert words_of(algorithm.options(), values) == ["--range=0.55,1"]


def test_classes_take_the_place_of_the_default_range_alone(provider: Any) -> None:
    algorithm, heard = provider.algorithm("extract"), Heard()
    table = ["wet", 0, 0.2, "dry", 0.2, 1]
    given = Values.of(algorithm, {"CLASSES": table, "RANGE": "0.55,1"}, QgsProcessingContext(), heard)
    assert words_of(algorithm.options(), given) == ["--class=wet=0,0.2", "--class=dry=0.2,1"]
    assert heard.infos == ["Range is left out: Classes is given"]
    both = Values.of(algorithm, {"CLASSES": table, "RANGE": "0.6,1"}, QgsProcessingContext(), heard)
    assert "--range=0.6,1" in words_of(algorithm.options(), both)  # the program refuses both, and says so


@pytest.mark.skipif(not os.environ.get("UAVSEG_PROGRAM"), reason="UAVSEG_PROGRAM names no program")
def test_results_are_styled_run_after_run(provider: Any, tmp_path: Path) -> None:
    """QGIS deletes a post-processor after it was used; the next run has another."""
    for k in range(3):
        target = str(tmp_path / f"r{k}.gpkg")
        context, algorithm = QgsProcessingContext(), provider.algorithm("extract").create()
        context.setProject(QgsProject.instance())
        details = QgsProcessingContext.LayerDetails("r", QgsProject.instance(), "OUTPUT")
        context.addLayerToLoadOnCompletion(target, details)
        parameters = {"INPUT": str(SAMPLES / "quarry.tif"), "OUTPUT": target}
        assert algorithm.run(parameters, context, Heard())[1]
        layer = QgsVectorLayer(target, "r", "ogr")
        layer.setRenderer(QgsSingleSymbolRenderer(styles._fill("#000000")))
        style = context.layerToLoadOnCompletionDetails(target).postProcessor()
        style.postProcessLayer(layer, context, Heard())
        assert layer.renderer().type() == "graduatedSymbol"
        del context, style, details


@pytest.mark.skipif(not os.environ.get("UAVSEG_PROGRAM"), reason="UAVSEG_PROGRAM names no program")
@pytest.mark.parametrize(("selected", "flown"), [([1], 1), ([1, 2], 2)])
def test_selected_regions_alone_are_flown_over(
    selected: list[int], flown: int, provider: Any, tmp_path: Path
) -> None:
    from qgis.core import QgsProcessingFeatureSourceDefinition

    project = QgsProject.instance()
    answers: dict[str, Any] = {}
    context = QgsProcessingContext()
    context.setProject(project)
    extract = provider.algorithm("extract").create()
    parameters = {"INPUT": str(SAMPLES / "quarry.tif"), "OUTPUT": str(tmp_path / "r.gpkg")}
    answers, ok = extract.run(parameters, context, Heard())
    assert ok
    layer = QgsVectorLayer(answers["OUTPUT"], "r", "ogr")
    project.addMapLayer(layer)
    layer.selectByIds(selected)
    source = QgsProcessingFeatureSourceDefinition(layer.id(), True)
    plan = provider.algorithm("plan").create()
    heard = Heard()
    mission = {"REGIONS": source, "OUTPUT": str(tmp_path / "m.plan"), "LEGS": str(tmp_path / "legs.gpkg")}
    answers, ok = plan.run(mission, context, heard)
    assert ok, heard.infos
    items = json.loads((tmp_path / "m.plan").read_text())["mission"]["items"]
    assert sum(item.get("command") == 16 for item in items) == flown
    assert QgsVectorLayer(answers["LEGS"], "legs", "ogr").featureCount() == flown + 1
    project.removeMapLayer(layer)


@pytest.mark.skipif(not os.environ.get("UAVSEG_PROGRAM"), reason="UAVSEG_PROGRAM names no program")
def test_regions_are_shown_with_the_style_beside_them(qgis_app: Any, tmp_path: Path) -> None:
    for name in ("a.gpkg", "b.fgb"):
        words = ["levels", SAMPLES / "quarry.tif", "--width", "0.2", "-o", tmp_path / name, "--style", "qml"]
        subprocess.run([os.environ["UAVSEG_PROGRAM"], *words], check=True, capture_output=True)
        layer = QgsVectorLayer(str(tmp_path / name), "r", "ogr")
        renderer = layer.renderer()
        assert (renderer.type(), renderer.classAttribute()) == ("categorizedSymbol", "level")
