"""What came back from a flight: where photographs lie, what they missed, a map of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from qgis.core import (
    QgsProcessing,
    QgsProcessingException,
    QgsProcessingOutputNumber,
    QgsProcessingParameterFile,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterVectorDestination,
    QgsVectorLayer,
)

from ..options import Option, Values, listed, words_of
from ..places import latlon, place
from ..targets import VECTOR_EXTENSIONS
from .base import ProgramAlgorithm
from .plan import GROUP, MISSION_FILTER

PHOTOGRAPHS = Option(
    lambda: QgsProcessingParameterFile("PHOTOGRAPHS", "Photographs", QgsProcessingParameterFile.Folder),
    lambda _: [],
    "A folder of photographs with their places in EXIF or XMP, as cameras of drones write them.",
    advanced=False,
    flags={"--photos": ""},
)
HOME = place(
    "HOME",
    "Place of takeoff",
    "Over an elevation model, heights are then those above it, not altitudes.",
    True,
    lambda values: [f"--home={latlon(values, 'HOME')}"] if values.given("HOME") else [],
    "--home",
)


def _folder(values: Values) -> str:
    folder = Path(values.text("PHOTOGRAPHS")).absolute()
    if not folder.is_dir():
        raise QgsProcessingException(f"{values.label('PHOTOGRAPHS')}: there is no folder {folder}")
    return str(folder)


class PhotographAlgorithm(ProgramAlgorithm):
    """An algorithm over a folder of photographs."""

    GROUP = GROUP
    COMMAND = ""

    def options(self) -> Sequence[Option]:
        return (PHOTOGRAPHS, *listed(self.COMMAND, "DEM", "CAMERA"), HOME)

    def write(self, values: Values, command: str, target: str) -> None:
        """Run a command over the photographs that writes a file."""
        words = [command, *words_of(self.options(), values), f"--output={target}", "--overwrite"]
        self.succeed(values, [*words, "--progress=plain", "--", _folder(values)])


class Footprints(PhotographAlgorithm):
    """`uavseg footprints`."""

    NAME = "footprints"
    TITLE = "Footprints of photographs"
    COMMAND = "footprints"
    SUMMARY = (
        "Draws the ground that each photograph shows, by its position, the angles of its camera and its "
        "lens: on flat ground, or on an elevation model."
    )
    TAGS = ("photographs", "exif", "xmp", "coverage")

    def add_outputs(self) -> None:
        self.addParameter(
            QgsProcessingParameterVectorDestination("OUTPUT", "Footprints", QgsProcessing.TypeVectorPolygon)
        )
        self.addOutput(QgsProcessingOutputNumber("COUNT", "Number of footprints"))

    def answer(self, values: Values) -> dict[str, Any]:
        target = self.target(values, "OUTPUT", VECTOR_EXTENSIONS)
        self.write(values, self.COMMAND, target)
        return {"OUTPUT": target, "COUNT": QgsVectorLayer(target, "footprints", "ogr").featureCount()}


class Gaps(PhotographAlgorithm):
    """`uavseg check --photos --gaps`."""

    OUTPUT_FLAGS: ClassVar = {"--gaps": "OUTPUT"}
    NAME = "gaps"
    TITLE = "Gaps of a survey"
    COMMAND = "check"
    SUMMARY = (
        "Compares the photographs of a flight with its mission: what they do not show, which are missing or "
        "blurred. The gaps are regions: Plan mission over them is the next flight."
    )
    TAGS = ("photographs", "coverage", "overlap", "missing", "resume")

    def options(self) -> Sequence[Option]:
        mission = Option(
            lambda: QgsProcessingParameterFile(
                "INPUT", "Mission", QgsProcessingParameterFile.File, "", None, False, MISSION_FILTER
            ),
            lambda _: [],
            "The mission that was flown.",
            advanced=False,
        )
        return (mission, *super().options())

    def add_outputs(self) -> None:
        polygon = QgsProcessing.TypeVectorPolygon
        self.addParameter(QgsProcessingParameterVectorDestination("OUTPUT", "Gaps", polygon))
        self.addParameter(
            QgsProcessingParameterVectorDestination("FOOTPRINTS", "Footprints", polygon, None, True, False)
        )
        for name, label in _NUMBERS.items():
            self.addOutput(QgsProcessingOutputNumber(name, label))

    def answer(self, values: Values) -> dict[str, Any]:
        gaps = self.target(values, "OUTPUT", VECTOR_EXTENSIONS)
        shown = self.target(values, "FOOTPRINTS", VECTOR_EXTENSIONS)
        mission = str(Path(values.text("INPUT")).absolute())
        words = ["check", "--json", *words_of(self.options(), values), f"--photos={_folder(values)}"]
        finished = self.command(values, [*words, f"--gaps={gaps}", "--overwrite", "--", mission], False)
        found = json.loads(finished.output) if finished.output.strip() else {}
        if not found.get("coverage"):
            raise QgsProcessingException(finished.error())
        for warning in (*found["warnings"], *found["problems"]):
            values.feedback.pushWarning(warning)
        if shown:
            self.write(values, "footprints", shown)
        coverage = found["coverage"]
        numbers = {**coverage, "missing": len(coverage["missing"]), "blurred": len(coverage["blurred"])}
        results = {"OUTPUT": gaps, **{name: numbers[name.lower()] for name in _NUMBERS}}
        return {**results, "FOOTPRINTS": shown} if shown else results


class Georeference(PhotographAlgorithm):
    """`uavseg georeference`."""

    NAME = "georeference"
    TITLE = "Map of photographs"
    COMMAND = "georeference"
    SUMMARY = (
        "Puts photographs on the ground, by their position, the angles of the camera and its lens, and says "
        "how far they are likely off. Extract regions and Regions like a sample take the map."
    )
    TAGS = ("photographs", "orthophoto", "mosaic", "georeference")

    def options(self) -> Sequence[Option]:
        return (*super().options(), *listed(self.COMMAND, "RESOLUTION"))

    def add_outputs(self) -> None:
        self.addParameter(QgsProcessingParameterRasterDestination("OUTPUT", "Map"))

    def answer(self, values: Values) -> dict[str, Any]:
        target = self.target(values, "OUTPUT", ("tif",))
        self.write(values, self.COMMAND, target)
        return {"OUTPUT": target}


_NUMBERS = {
    "COVERED": "Share of the area that photographs show",
    "GAPS": "Number of gaps",
    "GAPS_M2": "Area of the gaps in square metres",
    "MISSING": "Photographs that are missing",
    "BLURRED": "Photographs that are blurred",
}
