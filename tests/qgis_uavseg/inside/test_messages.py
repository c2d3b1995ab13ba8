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
def test_the_flag_that_a_field_becomes_is_shown_as_its_label(
    name: str, provider: Any, tmp_path: Path
) -> None:
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
    assert seen >= 3


@pytest.mark.parametrize(
    ("name", "flag", "label"),
    [
        ("extract", "--output", "Regions"),
        ("levels", "-o", "Segments"),
        ("match", "--labels", "Labels"),
        ("classify", "--objects", "Objects"),
        ("plan", "--output", "Mission"),
        ("suggest", "--output", "Picture of the histogram"),
        ("gaps", "--gaps", "Gaps"),
        ("gaps", "--photos", "Photographs"),
    ],
)
def test_outputs_are_fields_too(name: str, flag: str, label: str, provider: Any) -> None:
    algorithm = provider.algorithm(name)
    fields = algorithm.fields(Values.of(algorithm, {}, _context(), Heard()))
    assert in_dialog(f"{flag} ends in .x", fields) == f"“{label}” ends in .x"


def test_an_output_that_an_algorithm_does_not_have_is_of_the_command_line(provider: Any) -> None:
    algorithm = provider.algorithm("suggestlike")
    fields = algorithm.fields(Values.of(algorithm, {}, _context(), Heard()))
    assert "--output is an option of the command line" in in_dialog("give --output", fields)


@pytest.mark.parametrize(("given", "label"), [("SAMPLE", "Sample"), ("PLACE", "Or a place in it")])
def test_of_two_fields_for_a_flag_the_one_that_is_filled_in_is_named(
    given: str, label: str, provider: Any
) -> None:
    algorithm = provider.algorithm("match")
    fields = algorithm.fields(Values.of(algorithm, {given: "1,1"}, _context(), Heard()))
    assert in_dialog("--like", fields) == f"“{label}”"


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


# algorithm, parameters, what is said: as an error, or as a warning or message of a run that succeeds
SAID: list[tuple[str, dict[str, Any], str]] = [
    (
        "extract",
        {"INDEX": "ndvi", "EXPRESSION": "b1"},
        "give “Spectral index” or “Band arithmetic”, not both",
    ),
    ("extract", {"CLASSES": ["a", 0, 0.5], "RANGE": "0.1,0.2"}, "“Range” and “Classes” do not go together"),
    ("extract", {"INDEX": "ndvi"}, "give “Names of the bands”, such as nir=4,red=3"),
    ("extract", {"MIN_AREA": "1000ha"}, "are smaller than “Smallest area”; a smaller one keeps more"),
    ("levels", {"WIDTH": 0.2, "BREAKS": "0.5"}, "give “Width of a level in v” P, or “Breaks” V,V,..."),
    ("match", {"PLACE": "512500,5478500", "RADIUS": 4, "BY": "texture"}, "(“Compare by” color)"),
    ("classify", {"FREE_IS": "black"}, "“Free cells are” white and “Free cells are” black are for a picture"),
    ("plan", {"GSD": 2}, "a ground sampling distance needs a camera (“Camera”)"),
    ("plan", {"ALTITUDE": 300}, "with one, give “Highest above home”"),
    (
        "plan",
        {"ENDURANCE": 1},
        "give more “Minutes in the air” or --max-items, less “Reserve in per cent”, or a home that is nearer "
        "(--max-items is an option of the command line, not of this dialog)",
    ),
    ("plan", {"TERRAIN": "frame"}, "give “Elevation model” to have slopes and the way home checked"),
]


@pytest.mark.parametrize(("name", "given", "text"), SAID)
def test_what_the_program_says_is_shown_in_the_terms_of_the_dialog(
    name: str, given: dict[str, Any], text: str, provider: Any, regions: str, tmp_path: Path
) -> None:
    source = {"REGIONS": regions} if name == "plan" else {"INPUT": QUARRY}
    suffix = {"plan": "plan", "classify": "tif"}.get(name, "gpkg")
    heard, target = Heard(), tmp_path / f"o.{suffix}"
    parameters = {**source, **given, "OUTPUT": str(target)}
    ok = provider.algorithm(name).create().run(parameters, _context(), heard)[1]
    said = heard.warnings if ok else heard.errors
    assert any(text in line for line in said), (heard.errors, heard.warnings)
    assert len({*said}) == len(said), said
    assert target.exists() == ok
    assert f"--output={target}" in heard.commands[-1]  # the log still has the line as one types it
