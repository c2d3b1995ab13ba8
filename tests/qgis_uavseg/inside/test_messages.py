"""Messages of algorithms name the fields of their dialogs, not flags of the command line."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("qgis.core")
pytest.importorskip("pytest_qgis")

from qgis.core import QgsProcessingContext, QgsProcessingFeedback, QgsProject, QgsVectorLayer

from qgis_uavseg.algorithms import ALGORITHMS
from qgis_uavseg.algorithms.base import DialogFeedback
from qgis_uavseg.flags import in_dialog
from qgis_uavseg.options import Values
from qgis_uavseg.provider import UavsegProvider

SAMPLES = Path(__file__).resolve().parents[3] / "samples"
QUARRY = str(SAMPLES / "quarry.tif")
NAMES = [algorithm.NAME for algorithm in ALGORITHMS]


class Heard(QgsProcessingFeedback):
    """Feedback that keeps messages by their kind."""

    def __init__(self) -> None:
        super().__init__(False)
        self.warnings: list[str] = []
        self.infos: list[str] = []
        self.errors: list[str] = []
        self.commands: list[str] = []

    def pushWarning(self, warning: str) -> None:
        self.warnings.append(warning)

    def pushInfo(self, info: str) -> None:
        self.infos.append(info)

    def reportError(self, error: str, fatalError: bool = False) -> None:
        self.errors.append(error)

    def pushCommandInfo(self, info: str) -> None:
        self.commands.append(info)


@pytest.fixture(scope="module")
def provider(qgis_app: Any) -> Iterator[Any]:
    from qgis.core import QgsApplication

    made = UavsegProvider()
    QgsApplication.processingRegistry().addProvider(made)
    yield made
    QgsApplication.processingRegistry().removeProvider(made)


def _context() -> QgsProcessingContext:
    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    return context


def _filled(parameter: Any, polygons: str) -> list[object]:
    """Values of a parameter, of which each becomes another flag."""
    kinds: dict[str, list[object]] = {
        "raster": [QUARRY],
        "source": [polygons],
        "multilayer": [[polygons]],
        "point": ["-122.8272,49.4583 [EPSG:4326]"],
        "boolean": [True],
        "band": [1],
        "number": [2],
        "distance": [2],
        "range": ["0.2,0.5"],
        "matrix": [["dark", 0, 0.5]],
        "file": [polygons],
        "string": ["1"],
    }
    return parameter.options() if parameter.type() == "enum" else kinds[parameter.type()]


@pytest.mark.parametrize("name", NAMES)
def test_the_flag_that_a_field_becomes_is_shown_as_its_label(name: str, provider: Any, tmp_path: Path) -> None:
    algorithm, polygons = provider.algorithm(name), tmp_path / "p.geojson"
    ring = [[0, 0], [1, 0], [1, 1], [0, 0]]
    polygons.write_text(f'{{"type": "Polygon", "coordinates": [{ring}]}}')
    seen = 0
    for option in algorithm.options():
        parameter = option.make()
        for value in _filled(parameter, str(polygons)):
            for unit in range(3 if parameter.name() == "RANGE" else 1):
                given = {parameter.name(): value, "RANGE_IN": unit}
                values = Values.of(algorithm, {"INPUT": QUARRY, **given}, _context(), Heard())
                fields = algorithm.fields(values)
                for word in option.words(values):
                    flag, label = word.split("=")[0], parameter.description().split(" (")[0]
                    for text in (f"{flag} is wrong", f"'{flag}' is wrong", f"give {flag} 1 or {flag}=1."):
                        shown = in_dialog(text, fields)
                        assert f"“{label}”" in shown and "--" not in shown, (text, shown)
                    assert in_dialog(f"{flag}-x", fields).startswith(f"{flag}-x (")
                    seen += 1
    assert seen >= 3 or name == "suggestlike"


@pytest.mark.parametrize("name", NAMES)
def test_fields_have_names_of_their_own(name: str, provider: Any) -> None:
    algorithm = provider.algorithm(name)
    of_label: dict[str, set[str]] = {}
    for option in algorithm.options():
        for more in option.flags.values():
            label = option.make().description()
            of_label.setdefault(label.split(" (")[0] + more, set()).add(label)
    assert all(len(labels) == 1 for labels in of_label.values()), of_label


def test_all_messages_but_the_command_are_translated_and_progress_and_cancelling_pass(qgis_app: Any) -> None:
    heard = Heard()
    shares: list[float] = []
    heard.progressChanged.connect(shares.append)
    feedback = DialogFeedback(heard, {"--detail": "“Detail to keep”"})
    for say in (feedback.pushInfo, feedback.pushWarning, feedback.reportError, feedback.pushCommandInfo):
        say("--detail")
    assert heard.infos == heard.warnings == heard.errors == ["“Detail to keep”"]
    assert heard.commands == ["--detail"]
    feedback.setProgress(40)
    assert shares == [40] and not feedback.isCanceled()
    heard.cancel()
    assert feedback.isCanceled() and DialogFeedback(heard, {}).isCanceled()


@pytest.fixture(scope="module")
def regions(provider: Any, tmp_path_factory: pytest.TempPathFactory) -> str:
    if not os.environ.get("UAVSEG_PROGRAM"):
        pytest.skip("UAVSEG_PROGRAM names no program")
    target = str(tmp_path_factory.mktemp("regions") / "r.gpkg")
    algorithm, heard = provider.algorithm("extract").create(), Heard()
    assert algorithm.run({"INPUT": QUARRY, "OUTPUT": target}, _context(), heard)[1], heard.errors
    assert QgsVectorLayer(target, "r", "ogr").isValid()
    return target
