"""The dialog of each algorithm opens and runs, alone, in a batch and in a model."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("qgis.core")
pytest.importorskip("pytest_qgis")

from conftest import SAMPLES, photograph, wait_until
from qgis.core import (
    QgsApplication,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingModelAlgorithm,
    QgsProcessingModelChildAlgorithm,
    QgsProcessingModelChildParameterSource,
    QgsProcessingModelOutput,
    QgsProcessingModelParameter,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterRange,
    QgsProcessingParameterRasterLayer,
    QgsProject,
    QgsRasterLayer,
    QgsVectorLayer,
)

NAMES = (
    *("extract", "levels", "match", "suggest", "suggestlike", "plan", "check", "classify", "path"),
    *("footprints", "gaps", "georeference"),
)
# The parameters of a run; texts in angle brackets are files that the fixture `inputs` made, or results.
RUNS: dict[str, dict[str, Any]] = {
    "extract": {"INPUT": "<quarry>", "RANGE": "0.55,1", "OUTPUT": "<out>/o.gpkg"},
    "levels": {"INPUT": "<quarry>", "WIDTH": 0.25, "OUTPUT": "<out>/o.gpkg"},
    "match": {"INPUT": "<fields>", "PLACE": "548225,6471890", "RADIUS": 4, "OUTPUT": "<out>/o.gpkg"},
    "suggest": {"INPUT": "<quarry>", "REPORT": "<out>/o.html"},
    "suggestlike": {
        "INPUT": "<fields>",
        "PLACE": "548225,6471890",
        "RADIUS": 4,
        "JSON": "<out>/o.json",
        "REPORT": "<out>/o.html",
    },
    "plan": {"REGIONS": "<regions>", "OUTPUT": "<out>/o.plan"},
    "check": {"INPUT": "<mission>", "REPORT": "<out>/o.json"},
    "classify": {"INPUT": "<map>", "STRETCH": "none", "OUTPUT": "<out>/o.tif"},
    "footprints": {"PHOTOGRAPHS": "<photographs>", "OUTPUT": "<out>/o.gpkg"},
    "gaps": {"INPUT": "<survey>", "PHOTOGRAPHS": "<photographs>", "OUTPUT": "<out>/o.gpkg"},
    "georeference": {"PHOTOGRAPHS": "<photographs>", "RESOLUTION": 200, "OUTPUT": "<out>/o.tif"},
    "path": {"INPUT": "<map>", "START": "0.715,1.595", "GOAL": "2.135,0.305", "OUTPUT": "<out>/o.geojson"},
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Files that algorithms read."""
    if not os.environ.get("UAVSEG_PROGRAM"):
        pytest.skip("UAVSEG_PROGRAM names no program")
    folder = tmp_path_factory.mktemp("inputs")
    made = {"regions": "r.gpkg", "mission": "m.plan", "map": "map.tif"}
    made |= {"survey": "s.plan", "photographs": "photographs"}
    paths = {name: str(folder / file) for name, file in made.items()}
    samples = {"quarry": str(SAMPLES / "quarry.tif"), "fields": str(SAMPLES / "fields_rgb.tif")}
    for words in (
        ["extract", samples["quarry"], "--range", "0.55,1", "-o", paths["regions"]],
        ["plan", paths["regions"], "--altitude", "60", "--home", "auto", "-o", paths["mission"]],
        ["simulate", "circles", "-o", paths["map"]],
    ):
        subprocess.run([os.environ["UAVSEG_PROGRAM"], *words], check=True, capture_output=True)
    photograph(Path(paths["regions"]), Path(paths["survey"]), Path(paths["photographs"]))
    return {**samples, **paths}


def _filled(parameters: dict[str, Any], inputs: dict[str, str], out: Path) -> dict[str, Any]:
    places = {**inputs, "out": str(out)}

    def fill(value: Any) -> Any:
        for name, path in places.items():
            value = value.replace(f"<{name}>", path) if isinstance(value, str) else value
        return value

    return {name: fill(value) for name, value in parameters.items()}


def _run(dialog: Any) -> dict[str, Any]:
    """Press Run, and wait for the results."""
    ended: list[bool] = []
    finish = dialog.finish
    dialog.finish = lambda *given, **named: (finish(*given, **named), ended.append(bool(given[0])))
    dialog.show()
    dialog.runAlgorithm()
    wait_until(lambda: bool(ended))
    assert ended == [True], dialog.logHtml() if hasattr(dialog, "logHtml") else ""
    return dialog.results()


@pytest.mark.parametrize("name", NAMES)
def test_a_dialog_runs_its_algorithm(
    name: str, processing: Any, inputs: dict[str, str], tmp_path: Path
) -> None:
    dialog = processing.createAlgorithmDialog(f"uavseg:{name}", _filled(RUNS[name], inputs, tmp_path))
    results = _run(dialog)
    written = [path for path in tmp_path.iterdir() if path.name.startswith("o.")]
    assert written and all(path.stat().st_size for path in written)
    assert str(written[0]) in map(str, results.values())
    dialog.close()


@pytest.mark.parametrize("name", NAMES)
def test_each_parameter_has_a_widget_and_help(name: str, processing: Any) -> None:
    dialog = processing.createAlgorithmDialog(f"uavseg:{name}", {})
    algorithm = dialog.algorithm()
    wrappers = dialog.mainWidget().wrappers
    for definition in algorithm.parameterDefinitions():
        if not definition.isDestination():
            assert definition.help(), definition.name()
            assert wrappers[definition.name()].wrappedWidget() is not None
    assert algorithm.shortHelpString() and not algorithm.icon().isNull()
    assert algorithm.outputDefinitions()
    dialog.close()


def test_results_of_a_dialog_are_loaded_with_their_style(
    processing: Any, inputs: dict[str, str], tmp_path: Path
) -> None:
    for name, renderer in (("extract", "graduatedSymbol"), ("levels", "categorizedSymbol")):
        (tmp_path / name).mkdir()
        parameters = _filled(RUNS[name], inputs, tmp_path / name)
        dialog = processing.createAlgorithmDialog(f"uavseg:{name}", parameters)
        _run(dialog)
        wait_until(lambda: len(QgsProject.instance().mapLayers()) == 1)
        (layer,) = QgsProject.instance().mapLayers().values()
        assert layer.renderer().type() == renderer
        QgsProject.instance().removeAllMapLayers()
        dialog.close()


def test_a_batch_runs_each_row(processing: Any, inputs: dict[str, str], tmp_path: Path) -> None:
    from processing.gui.BatchAlgorithmDialog import BatchAlgorithmDialog

    algorithm = QgsApplication.processingRegistry().createAlgorithmById("uavseg:extract")
    dialog = BatchAlgorithmDialog(algorithm, None)
    panel, context = dialog.mainWidget(), QgsProcessingContext()
    panel.addRow(1)
    for row, ends in enumerate(((0.55, 1), (0, 0.3))):
        values = {"INPUT": inputs["quarry"], "RANGE": list(ends)}
        for definition in algorithm.parameterDefinitions():
            wrapper = panel.wrappers[row][panel.parameter_to_column[definition.name()]]
            if definition.name() in values:
                wrapper.setParameterValue(values[definition.name()], context)
        column = panel.parameter_to_column["OUTPUT"]
        panel.tblParameters.cellWidget(row + 1, column).setValue(str(tmp_path / f"{row}.gpkg"))
    ended: list[int] = []
    dialog.finish = lambda results, errors: ended.extend((len(results), len(errors)))
    dialog.show()
    dialog.runAlgorithm()
    assert ended == [2, 0]
    counts = [QgsVectorLayer(str(tmp_path / f"{row}.gpkg"), "r", "ogr").featureCount() for row in (0, 1)]
    assert counts[0] == 4 and counts[1] > 0
    dialog.close()


def _child(model: Any, name: str, algorithm: str, **sources: Any) -> QgsProcessingModelChildAlgorithm:
    child = QgsProcessingModelChildAlgorithm(f"uavseg:{algorithm}")
    child.setChildId(name)
    for parameter, source in sources.items():
        child.addParameterSources(parameter, [source])
    return child


def _model() -> QgsProcessingModelAlgorithm:
    """From a raster and a range to regions, to a mission, to a check of it."""
    source = QgsProcessingModelChildParameterSource
    model = QgsProcessingModelAlgorithm("Raster to mission", "missions")
    for definition in (
        QgsProcessingParameterRasterLayer("raster", "Raster"),
        QgsProcessingParameterRange("range", "Range", 1, "0.55,1"),
    ):
        model.addModelParameter(definition, QgsProcessingModelParameter(definition.name()))
    regions = _child(
        model,
        "regions",
        "extract",
        INPUT=source.fromModelParameter("raster"),
        RANGE=source.fromModelParameter("range"),
        MIN_AREA=source.fromStaticValue("50"),
    )
    plan = _child(model, "plan", "plan", REGIONS=source.fromChildOutput("regions", "OUTPUT"))
    output = QgsProcessingModelOutput("Mission")
    output.setChildId("plan")
    output.setChildOutputName("OUTPUT")
    plan.setModelOutputs({"Mission": output})
    check = _child(model, "check", "check", INPUT=source.fromChildOutput("plan", "OUTPUT"))
    for child in (regions, plan, check):
        model.addChildAlgorithm(child)
    definition = QgsProcessingParameterFileDestination("plan:Mission", "Mission", "Missions (*.plan)")
    model.addModelParameter(definition, QgsProcessingModelParameter("plan:Mission"))
    model.updateDestinationParameters()
    return model


def test_a_model_goes_from_a_raster_to_a_checked_mission(
    processing: Any, inputs: dict[str, str], tmp_path: Path
) -> None:
    file, target = tmp_path / "mission.model3", tmp_path / "m.plan"
    assert _model().toFile(str(file))
    model = QgsProcessingModelAlgorithm()
    assert model.fromFile(str(file))
    model.initAlgorithm()
    assert model.canExecute()[0], model.canExecute()[1]
    feedback, context = QgsProcessingFeedback(False), QgsProcessingContext()
    context.setProject(QgsProject.instance())
    (output,) = (d.name() for d in model.parameterDefinitions() if d.isDestination())
    parameters = {"raster": inputs["quarry"], "range": [0.55, 1], output: str(target)}
    results, ok = model.run(parameters, context, feedback)
    assert ok, feedback.textLog()
    assert len(json.loads(target.read_text())["mission"]["items"]) > 4
    assert results["CHILD_RESULTS"]["check"]["OK"] is True


def test_a_raster_of_the_project_is_an_input(processing: Any, inputs: dict[str, str], tmp_path: Path) -> None:
    layer = QgsRasterLayer(inputs["quarry"], "quarry", "gdal")
    QgsProject.instance().addMapLayer(layer)
    dialog = processing.createAlgorithmDialog("uavseg:extract", {"OUTPUT": str(tmp_path / "o.gpkg")})
    assert dialog.createProcessingParameters()["INPUT"] == layer.id()
    assert _run(dialog)["COUNT"] == 4
    dialog.close()
